"""What compare, diagnose, add and improve found: plain data, rendered elsewhere."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

from dsd_cli.identify.recordings.excerpts import Deviations
from dsd_cli.identify.recordings.recording import Mended
from dsd_cli.plant.model import DELAY as DELAY
from dsd_cli.plant.model import INERTIA as INERTIA
from dsd_cli.plant.model import PlantModel
from dsd_cli.signals.units import Units

#: Verdicts that are no effect.
NONE, UNKNOWN = "none", "unknown"
#: What a rung of the ladder did.
StepKind = Literal["given", "refit", "added", "taken back", "learnt"]


@dataclass(frozen=True)
class Estimate:
    """A fitted value; `unit` with {u}, {v}, {q} as in `Parameter`; std_error NaN where it cannot be given.

    at_bound : the value stands on its bound, so neither it nor its error is reliable.
    held : the user fixed it; its standard error is 0.
    pull : standard deviations by which the log alone is off the prior; NaN without one.
    grade : "identified", "weak" or "not" by the relative error, "held"; "" where nobody asked.
    correlations : of its error with those of the values of this fit that stand before it, by their names; none with
        those that are held or that the log does not identify.
    """

    value: float
    std_error: float
    unit: str
    at_bound: bool = False
    held: bool = False
    pull: float = math.nan
    grade: str = ""
    correlations: Mapping[str, float] = field(default_factory=dict)


#: "inertia", "delay" or "<effect>.<parameter>" -> estimate.
Estimates = Mapping[str, Estimate]
#: (value, value, correlation) of pairs that a log hardly separates, the strongest first.
Correlations = tuple[tuple[str, str, float], ...]


@dataclass(frozen=True)
class Missing:
    """An effect that belongs to what the model as given lacks. probability : that it does, whatever else is missing."""

    effect: str
    probability: float


@dataclass(frozen=True)
class Unexplained:
    """What the effects that were found leave of u beyond the sensor's noise.

    share_of_u : its rms over that of u, within the band; if unknown, no less than is explained of it. probability :
    that anything is there. on : channels on which it depends, as far as that is known.
    """

    share_of_u: float = math.nan
    probability: float = math.nan
    on: tuple[str, ...] = ()


@dataclass(frozen=True)
class Score:
    """rms of the residual r of the balance of forces within the band, unit of u: on what the model was fitted to, and
    on blocks that no fit saw.

    fit_percent : 100 (1 - |r| / |u - mean u|). relative_error_percent : 100 rms(r) / rms(u), of u within the band.
    """

    rmse: float
    heldout_rmse: float
    fit_percent: float
    relative_error_percent: float


@dataclass(frozen=True)
class Candidate:
    """One effect (or inertia, delay), added to the model and fitted with all that is in it.

    probability : that it is part of the final set, against whatever else could stand in its place; several effects
        can be missing at once, so these do not sum to 1.
    parameters : of this effect alone, by parameter name.
    indistinguishable_from : effects that explain this log as well.
    untestable : why it could not be tested on this log; then the numbers are NaN and `model` is None.
    note : what to know about the fit: a value on its bound, a fit that did not converge.
    model, score, all_values : of the model with the effect in it and everything fitted.
    seen : {parameter: (value, standard error)} that the response above the band identified; the balance may not show
        it.
    of_excerpt : the values are those of the excerpt that was searched; the errors are still of all rows.
    """

    effect: str
    rmse_after: float
    heldout_rmse_before: float
    heldout_rmse_after: float
    probability: float
    parameters: Estimates
    indistinguishable_from: tuple[str, ...] = ()
    untestable: str = ""
    note: str = ""
    model: PlantModel | None = None
    score: Score | None = None
    all_values: Estimates = field(default_factory=dict)
    seen: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    of_excerpt: bool = False


@dataclass(frozen=True)
class Ceiling:
    """What the best free-form function of the channels reaches on held-out blocks; `on` names those channels."""

    heldout_rmse: float
    on: tuple[str, ...]


@dataclass(frozen=True)
class LogLevels:
    """A value that differs between logs of one rig (`Effect.varies`).

    deviations : of each log from the mean. mean : of the logs, each counting once; the model has it, or has no such
    effect. values : by log, in the order of the logs.
    """

    deviations: Deviations
    mean: float
    logs: tuple[str, ...]
    values: tuple[Estimate, ...]


@dataclass(frozen=True)
class Diagnosis:
    """The answer of `dsd diagnose`.

    verdict : an effect's id, "inertia", "delay", "none" or "unknown". probability : of the verdict.
    score : of the model as it stands; `refitted` with its own values fitted to the log.
    ranking : best first; untestable ones last.
    estimates : inertia, delay and the values of all effects, fitted together with the whole set that was found.
    model : with the verdict's effect in it; refitted_model : without, its values fitted; refitted_values : these, with
        their correlations. given : the model as given, with what is fixed in it.
    advice : what to do next, one sentence each.
    depends_on : channels on which an unknown remainder depends. nearest : the effect that comes nearest to what is
        unknown, or beside "none" to what is left in creeping, though the log does not confirm it; "" if none does.
    at_stops : most of what is left is from stops and creeping, where it is hardly known. blocked : what must be mended
        before anything that is missing can be identified, "" if nothing. stand_ins : effect that was found, or taken
        before -> values for which it may only stand in, because the user gave them otherwise than the log has them.
    held_out : logs that no fit saw; the held-out errors are theirs. noise : rms of r that no smooth function of
        anything explains, unit of u.
    found : the whole set of effects that the search found; the verdict is the one of them that is worth most alone.
    whole_model : with all of them; None where nothing was found. whole_values : its values, where they are several,
        whole_heldout_rmse : and its held-out error there.
    correlations : of the estimates.
    band_hz, floor : end of the band in which forces were balanced, Hz; rms of r that the sensor alone leaves in it.
    levels : values that differ between the logs: every error but `score` is beside them. inverse : whether u by the
        motion was evidence, not the motion by u.
    missing, unexplained : the two questions, each with its number: what is missing, and is that all?
    mended : the recordings without a part of u that did not act, of which all this is; None as a rule.
    """

    logs: tuple[str, ...]
    samples: int
    verdict: str
    probability: float
    score: Score
    refitted: Score
    ranking: tuple[Candidate, ...]
    ceiling: Ceiling
    advice: tuple[str, ...]
    estimates: Estimates
    model: PlantModel
    refitted_model: PlantModel
    noise: float
    found: tuple[str, ...] = ()
    band_hz: float = math.nan
    floor: float = math.nan
    provenance: Mapping[str, str] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    depends_on: tuple[str, ...] = ()
    correlations: Correlations = ()
    given: PlantModel = field(default_factory=PlantModel)
    units: Units = field(default_factory=Units)
    refitted_values: Estimates = field(default_factory=dict)
    refitted_correlations: Correlations = ()
    whole_model: PlantModel | None = None
    whole_values: Estimates = field(default_factory=dict)
    whole_heldout_rmse: float = math.nan
    nearest: str = ""
    at_stops: bool = False
    blocked: str = ""
    stand_ins: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    levels: tuple[LogLevels, ...] = ()
    held_out: tuple[str, ...] = ()
    missing: tuple[Missing, ...] = ()
    unexplained: Unexplained = field(default_factory=Unexplained)
    inverse: bool = False
    mended: Mended | None = None

    def joint_values(self, effect: str) -> Estimates:
        """Those of one effect by parameter name (of inertia and delay by their own); empty for one not in the set."""
        return own_values(self.whole_values, effect) if effect in self.found else {}

    def alone(self, candidate: Candidate) -> Estimates:
        """The values of a candidate fitted without the others; where more than it is missing they have no standard
        error, for the one that the fit gives ignores the bias which the others cause."""
        or_it = not self.found or {candidate.effect, *candidate.indistinguishable_from} & {*self.found, INERTIA, DELAY}
        more_missing = bool(self.whole_values) or self.verdict == UNKNOWN or not or_it
        return without_errors(candidate.parameters) if more_missing else candidate.parameters


@dataclass(frozen=True)
class Addition:
    """The answer of `dsd add`: the model with one more effect, all values fitted again.

    refitted : of the model without it, its own values fitted again.
    """

    effect: str
    model: PlantModel
    before: Score
    after: Score
    estimates: Estimates
    warnings: tuple[str, ...] = ()
    refitted: Score | None = None
    correlations: Correlations = ()
    units: Units = field(default_factory=Units)


@dataclass(frozen=True)
class Step:
    """One rung of the ladder: what was done ("as given", "refit" or an effect's id), and the errors after it.

    `kind` says whether the effect was added or taken back. levels : values that differ between the logs, beside which
    it was fitted.
    """

    step: int
    effect: str
    score: Score
    estimates: Estimates
    model: PlantModel
    kind: StepKind = "added"
    levels: tuple[LogLevels, ...] = ()


@dataclass(frozen=True)
class Ladder:
    """The answer of `dsd improve`; `stopped` says why no further step was taken, `last` is the last diagnosis.

    `values` : of the model at the end, fitted once more with the noise as it is beside it; `correlations` of these;
    `levels` : those that differ between the logs. missing : what the model as given lacked, as it was added, then what
    the last diagnosis still names.
    """

    steps: tuple[Step, ...]
    verdict: str
    stopped: str
    last: Diagnosis
    holdout: tuple[str, ...] = ()
    values: Estimates = field(default_factory=dict)
    correlations: Correlations = ()
    warnings: tuple[str, ...] = ()
    levels: tuple[LogLevels, ...] = ()
    missing: tuple[Missing, ...] = ()


def own_values(estimates: Estimates, effect: str) -> Estimates:
    """The values of one effect, "inertia" or "delay", by parameter name."""
    if effect in (INERTIA, DELAY):
        return {name: one for name, one in estimates.items() if name == effect}
    return {name.partition(".")[2]: one for name, one in estimates.items() if name.startswith(f"{effect}.")}


def without_errors(estimates: Estimates) -> Estimates:
    """Values whose standard errors hold for a model that lacks nothing, said of one that does."""
    return {name: replace(one, std_error=math.nan, grade="") for name, one in estimates.items()}
