"""What is confident on a real servo: 16 recordings, models from nothing to friction, labels from the position."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple
from unittest import mock

import numpy as np

from bench.beyond._runs import percent, table
from dsd_cli.cli.plan import detection_plan
from dsd_cli.detect.doubts import Doubts
from dsd_cli.detect.session import Session
from dsd_cli.files.config import Config
from dsd_cli.files.template import load_template
from dsd_cli.signals.cleaning import Cleaner
from dsd_cli.signals.log import Array

ROOT = Path(__file__).parents[2]
FOLDER = (ROOT / os.environ.get("DSD_RECORDINGS", "../shared/recordings") / "bam_xl330").resolve()
#: u in volts: gravity and viscous friction by least squares on the forces below 3 Hz; J of the same fit, to two digits.
NOTHING = "{}"
GRAVITY = "{gravity={amplitude=6.5, phase=0.0}}"
VISCOUS = "{gravity={amplitude=6.37, phase=0.0}, viscous_friction={coefficient=0.527}}"
DRY = "{{gravity={{amplitude={g}, phase=0.0}}, viscous_friction={{coefficient={b}}}, coulomb_friction={{level={c}}}}}"
MODELS = {
    "nothing": (0.08, NOTHING),
    "gravity": (0.08, GRAVITY),
    "gravity, viscous": (0.08, VISCOUS),
    "and a tenth of the dry friction": (0.08, DRY.format(g=5.98, b=0.43, c=0.05)),
    "and half of the dry friction": (0.08, DRY.format(g=5.98, b=0.43, c=0.25)),
    "gravity, viscous, dry, as fitted": (0.08, DRY.format(g=5.98, b=0.43, c=0.5)),
    "gravity, viscous, dry, as published": (0.07, DRY.format(g=4.99, b=0.425, c=0.133)),
}
RHOS = (0.6, 1.0, 2.0)


class Score(NamedTuple):
    """Confident samples, those of them with another inertia or a delay, and all samples."""

    confident: int
    wrong: int
    samples: int


def read(path: Path) -> dict[str, Array]:
    columns = np.genfromtxt(path, delimiter=",", names=True)
    return {"t": columns["t_s"], "u": columns["u_V"], "position": columns["position_rad"]}


def config(inertia: float, effects: str, rho: float) -> Config:
    """Candidates 40 % and 40 ms apart."""
    grid = ", ".join(f"{inertia * 1.4**k:.4g}" for k in (-2, -1, 0, 1, 2))
    return load_template("servo").override(
        (
            f"observer={{nominal_inertia={inertia}, time_constant=0.03}}",
            f"model={{effects={effects}}}",
            f"states={{delays=[0.0, 0.04, 0.08], inertias=[{grid}]}}",
            f"detector={{window=200, rho={rho}, hold=3.0}}",
            'signals={time="t", u="u", position="position", velocity="", d_hat=""}',
        )
    )


def score(logs: Sequence[dict[str, Array]], inertia: float, effects: str, rho: float) -> Score:
    sure, wrong, rows = 0, 0, 0
    for log in logs:
        plan = detection_plan(config(inertia, effects, rho), {name: name for name in log}, {}, "log")
        session = Session(plan, Cleaner(None))
        for part in (*session.feed(log["t"], log), *session.finish()):
            axes = plan.grid.axes
            right = np.isclose(axes["inertia"][part.state], inertia) & (axes["delay"][part.state] == 0.0)
            sure, rows = sure + int(part.confident.sum()), rows + part.confident.size
            wrong += int((part.confident & ~right).sum())
    return Score(sure, wrong, rows)


def cells(found: Score) -> tuple[str, str]:
    return percent(found.confident / found.samples), percent(found.wrong / found.confident) if found.confident else "-"


def section(pictures: Path) -> str:
    logs = [read(path) for path in sorted(FOLDER.glob("*.csv"))]
    if not logs:  # without the recordings the table stays as it is
        page = (pictures / "how" / "beyond.md").read_text(encoding="utf-8")
        return re.findall(r"<!-- made by servo -->\n(.*?)<!-- end of servo -->", page, re.DOTALL)[0]
    rows = []
    for name, (inertia, effects) in MODELS.items():
        for rho in RHOS:
            with mock.patch.object(Doubts, "model", return_value=None):
                alone = score(logs, inertia, effects, rho)
            rows.append((name, f"{rho:g}", *cells(alone), *cells(score(logs, inertia, effects, rho))))
    head = ("the model has", "rho, V", "confident by the lead alone", "of these wrong", "confident", "of these wrong")
    return table(head, rows)
