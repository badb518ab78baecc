"""A 4096-count encoder at 1 kHz: white rho beside noise whose spectrum is known; and the rest under friction."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from bench.beyond._runs import percent, table
from dsd_cli.cli.plan import detection_plan
from dsd_cli.cli.simulate import simulation_settings
from dsd_cli.detect.session import Session
from dsd_cli.files.config import Config
from dsd_cli.files.template import load_template
from dsd_cli.plant.simulation import simulate
from dsd_cli.signals.cleaning import Cleaner
from dsd_cli.signals.log import Array

STEP = 2.0 * np.pi / 4096
#: Candidates 40 % apart, delays 2 ms apart; every combination of the middle ones is a truth.
INERTIAS, DELAYS = (0.007, 0.01, 0.014), (0.0, 0.002, 0.004)
GRID = ("states.inertias=[0.005,0.007,0.01,0.014,0.02]", "simulate.noise=0")
SMOOTH = (
    *GRID,
    "model.effects={viscous_friction={coefficient=0.01}}",
    'simulate.reference={kind="multisine", amplitude=1.0, frequencies=[0.7,1.9,4.3,7.1]}',
)
KNOWN = f"detector.sensor_noise={{position={STEP / np.sqrt(12.0):.4g}}}"


class Case(NamedTuple):
    config: Config
    delay: float
    inertia: float
    log: dict[str, Array]


class Score(NamedTuple):
    """Shares: of the judged labels, right; of all, confident; of the confident ones, right, and right in J alone."""

    right: float
    confident: float
    right_confident: float
    inertia_confident: float


@cache
def cases(overrides: tuple[str, ...], step: float = STEP) -> tuple[Case, ...]:
    """Logs of nine plants, their position as the encoder has it."""
    found = []
    for inertia in INERTIAS:
        for delay in DELAYS:
            config = load_template("servo").override((*overrides, f"model.inertia={inertia}", f"model.delay={delay}"))
            log = simulate(simulation_settings(config))
            position = np.round(np.array(log["position"]) / step) * step
            columns = {"t": np.array(log["t"]), "u": np.array(log["u"]), "position": position}
            found.append(Case(config, delay, inertia, columns))
    return tuple(found)


def score(logs: Sequence[Case], *overrides: str) -> Score:
    """Labels from the position alone."""
    judged, right, sure, sure_right, sure_inertia, rows = (0,) * 6
    for case in logs:
        plan = detection_plan(
            case.config.override(('signals.d_hat=""', 'signals.velocity=""', *overrides)),
            {name: name for name in case.log},
            {},
            "log",
        )
        session = Session(plan, Cleaner(None))
        for part in (*session.feed(case.log["t"], case.log), *session.finish()):
            inertia = plan.grid.axes["inertia"][part.state] == case.inertia
            good = inertia & (plan.grid.axes["delay"][part.state] == case.delay)
            use = np.isfinite(part.log_likelihood)
            rows, judged, right = rows + use.size, judged + int(use.sum()), right + int((use & good).sum())
            sure, sure_right = sure + int(part.confident.sum()), sure_right + int((part.confident & good).sum())
            sure_inertia += int((part.confident & inertia).sum())
    return Score(right / judged, sure / rows, sure_right / max(sure, 1), sure_inertia / max(sure, 1))


def _rows(logs: Sequence[Case], rhos: Sequence[float], *known: str) -> list[tuple[str, ...]]:
    rows = []
    for method in ("dsd", "profile"):
        for rho in rhos:
            found = score(logs, f"detector.method={method}", f"detector.rho={rho}", *known)
            wrong = "-" if found.confident == 0.0 else percent(found.right_confident)
            inertia = "-" if found.confident == 0.0 else percent(found.inertia_confident)
            what = "spectrum known" if known else "white"
            rows.append((what, method, f"{rho:g}", percent(found.right), percent(found.confident), wrong, inertia))
    return rows


def section(pictures: Path) -> str:
    head = ("noise", "method", "rho", "labels right", "confident", "of these right", "right in J")
    parts = []
    for title, overrides in (("Without dry friction, always moving:", SMOOTH), ("To and fro with dry friction:", GRID)):
        logs = cases(overrides)
        rows = [*_rows(logs, (0.1, 0.3, 0.5, 1.0)), *_rows(logs, (0.02, 0.05, 0.1), KNOWN)]
        parts.append(f"{title}\n\n{table(head, rows)}")
    return "\n\n".join(parts)
