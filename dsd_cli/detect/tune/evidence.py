"""What a log says of every state, sample by sample: the inputs of the engine, and the squared errors they make."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsd_cli.detect.engine import Engine, Labels
from dsd_cli.detect.grid import Grid
from dsd_cli.detect.numpy_prediction import make_prediction
from dsd_cli.detect.plan import Plan
from dsd_cli.detect.recursions import Decisions
from dsd_cli.detect.rows import Inputs, joined
from dsd_cli.detect.session import Session
from dsd_cli.detect.settings import DetectorSettings
from dsd_cli.detect.spec import WARMUP
from dsd_cli.detect.transition import Transition
from dsd_cli.errors import DataError, TooShort, UsageError
from dsd_cli.signals.cleaning import Cleaner
from dsd_cli.signals.log import Array

#: Samples that are looked at; a longer recording is represented by so many of it.
MOST_SAMPLES = 20_000
#: Fewer judged samples than this tell nothing about dwell times and noise.
LEAST_SAMPLES = 200


class Gatherer(Session):
    """A session that keeps what goes into its engine: one list of inputs per recording of the log."""

    def __init__(self, plan: Plan, cleaner: Cleaner) -> None:
        super().__init__(plan, cleaner)
        self.recordings: list[list[Inputs]] = [[]]

    def _restart(self) -> None:
        super()._restart()
        self.recordings.append([])

    def _run_inputs(self, inputs: Inputs) -> Labels:
        self.recordings[-1].append(inputs)
        return super()._run_inputs(inputs)

    def evidence(self) -> Evidence:
        """The part of the log that identifies its states best: of one recording, at most MOST_SAMPLES.

        Raises
        ------
        DataError : no sample can be judged, or u moves the axis in no part of the log.
        """
        recordings = [joined(parts) for parts in self.recordings if parts]
        if not recordings or self.engine is None:
            raise TooShort("no sample can be judged", "is the log long enough, and signals.time_unit right?")
        found = [
            Evidence(between(inputs, begin, begin + MOST_SAMPLES), self.engine, _part(recordings, k, begin))
            for k, inputs in enumerate(recordings)
            for begin in range(0, inputs.u.size, MOST_SAMPLES)
        ]
        (judged, moved), best = max(((one.answer(), one) for one in found), key=lambda pair: pair[0])
        if judged >= LEAST_SAMPLES and moved == 0.0:
            raise DataError("nowhere does u move the axis", "tuning needs a recording in which it accelerates")
        return best


def between(inputs: Inputs, begin: int, end: int) -> Inputs:
    """Samples `begin` to `end` of them."""
    forces = inputs.forces
    if forces is not None:
        forces = type(forces)(*(column[begin:end] for column in forces))
    u, d_hat, t = (column[begin:end] for column in inputs[:3])
    resting = None if inputs.resting is None else inputs.resting[begin:end]
    motion = None if inputs.motion is None else inputs.motion[begin:end]
    return Inputs(u, d_hat, t, forces, resting, motion)


def _part(recordings: list[Inputs], k: int, begin: int) -> str:
    """What messages call MOST_SAMPLES of recording k, from `begin` on; empty where it is all of the log."""
    t = recordings[k].t
    if len(recordings) == 1 and t.size <= MOST_SAMPLES:
        return ""
    last = t[min(begin + MOST_SAMPLES, t.size) - 1]
    which = f"recording {k + 1} of {len(recordings)} without a gap, " if len(recordings) > 1 else ""
    return f"{which}t = {t[begin]:.10g} to {last:.10g} s"


@dataclass(frozen=True)
class Evidence:
    """A recording, and the engine that it was read for.

    Attributes
    ----------
    engine : its grid, measurement and settings; it is not run.
    part : which part of the log it is, in words; empty where it is all.
    """

    inputs: Inputs
    engine: Engine
    part: str = ""

    def answer(self) -> tuple[int, float]:
        """(samples that can be judged, at most LEAST_SAMPLES; what the acceleration owes to the forces, unit of u^2).

        A state predicts Q { Jn a } = (Jn/J) z, with z what acts on the plant. Of the sum of squares of Q { Jn a } the
        part (sum y z)^2 / sum z^2 goes with z, whatever J is: at rest and where no force acts it is 0, also if u
        pushes against a friction that the model lacks, or noise shakes the sensor. The delay that has most counts.
        Samples in which the axis is not faster than `rest_speed` are rest.
        """
        w, z = self.predictions()
        judged, motion = np.isfinite(z).all(axis=1), self.inputs.motion
        moves = judged if motion is None else judged & ~np.isnan(motion[:, 1])
        y, z = (self.engine.measurement.sign * self.inputs.d_hat + w)[moves], z[moves]
        size = (z**2).sum(axis=0)
        with np.errstate(invalid="ignore", divide="ignore"):
            shared = np.where(size > 0.0, (y @ z) ** 2 / size, 0.0)
        return min(int(judged.sum()), LEAST_SAMPLES), float(shared.max())

    def run(self, settings: DetectorSettings, inputs: Inputs | None = None) -> Labels:
        """Labels of the recording (or of other inputs on its clock) with that tuning; changes beside them are not
        looked for, which cost most of the time and are in no label."""
        inputs = inputs or self.inputs
        one = Engine(self.engine.grid, replace(settings, change=0.0), self.engine.measurement)
        return one.run(inputs.u, inputs.d_hat, t=inputs.t, forces=inputs.forces)

    def with_grid(self, grid: Grid) -> Evidence:
        """The same recording looked at with other candidates (and no initial state)."""
        settings = replace(self.engine.settings, initial=0, transition=Transition())
        return replace(self, engine=Engine(grid, settings, self.engine.measurement))

    def squares(self) -> tuple[Array, NDArray[Any]]:
        """Squared error of every state at every judged sample, shape (judged, states); and which samples these are.

        Raises
        ------
        DataError : too few samples can be judged.
        """
        settings = replace(self.engine.settings, method="imm", rho=1.0, transition=Transition())
        one = _Likelihoods(self.engine.grid, settings, self.engine.measurement)
        one.run(self.inputs.u, self.inputs.d_hat, t=self.inputs.t, forces=self.inputs.forces)
        at = np.flatnonzero((one.status != WARMUP) & np.isfinite(one.matrix).all(axis=1))
        if at.size < LEAST_SAMPLES:
            where = f" in the longest part, {self.part}" if self.part else ""
            raise TooShort(f"{at.size} samples can be judged{where}", f"tuning needs at least {LEAST_SAMPLES}")
        return 2.0 * (one.spec.log_likelihood_constant - one.matrix[at]), at

    def predictions(self) -> tuple[Array, Array]:
        """(w, z): Q u, shape (n,), and Q of what acts on the plant per delay and effect values, shape (n, G E).

        A state predicts d_hat = sign ((Jn/J) z - w). Rows of the warm-up are NaN.
        """
        inputs, spec = self.inputs, self.engine.spec
        prediction: Any = make_prediction(spec)
        stamps = inputs.t if spec.timed else None
        forces = (None, None, None) if inputs.forces is None else tuple(inputs.forces)
        w, z, warm = prediction.run(inputs.u, np.zeros_like(inputs.u), stamps, *forces)
        z = np.array(z, dtype=np.float64).reshape(len(w), -1)
        z[: len(w) - warm] = np.nan
        return np.asarray(w), z


class _Likelihoods(Engine):
    """Keeps the log likelihoods of all states instead of choosing among them."""

    def _make_recursion(self) -> None:
        return None

    def _from_likelihoods(self, matrix: Array, status: NDArray[Any]) -> Decisions:
        self.matrix, self.status = matrix, status.copy()
        nothing = np.zeros(len(status))
        return Decisions(np.zeros(len(status), dtype=np.int32), nothing, nothing, np.zeros(len(status), dtype=bool))


def refuse(plan: Plan) -> None:
    """What tuning cannot tune.

    Raises
    ------
    UsageError : a grid of one state, or damping states.
    """
    if len(plan.grid) < 2:
        raise UsageError("[states] has one state", "tuning needs at least two candidates to distinguish")
    if plan.settings.output != "d_hat":
        raise UsageError('dsd tune cannot tune detector.output = "derivative"', 'use output = "d_hat"')
