"""Item `damping`: the three claims of the paper's reference [10], and where the third ends."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tests.paper.test_damping import MOVING, PULSES, labels

SEEDS = range(1, 4)
UNIFORM = ("detector.transition=uniform",)


def section(pictures: Path) -> str:
    """One table; `pictures` gets none."""
    lines = [
        "| what is in the plant | damping | most frequent label | right (nearer), stay 0.999 | A uniform |",
        "|---|---|---|---|---|",
    ]
    for what, plant, cases in (
        ("one step", (), ((0.0, 0.0), (1.0, 1.0), (2.0, 2.0))),
        ("one step, damping between candidates", (), ((0.3, 0.0), (0.7, 1.0), (1.3, 1.0), (1.7, 2.0))),
        ("pulses of 0.4 and -0.3 once the step is quiet", PULSES, ((0.0, 0.0), (1.0, 1.0), (2.0, 2.0))),
        ("a pulse of 0.5 while the axis accelerates", _early(0.5), ((0.0, 0.0), (1.0, 1.0), (2.0, 2.0))),
    ):
        lines += [_line(what, plant, damping, nearer) for damping, nearer in cases]
    return "\n".join(lines)


def _early(force: float) -> tuple[str, ...]:
    return (f"model.effects.external_force.events=[{{start=0.5, end=0.9, force={force}}}]",)


def _line(what: str, plant: tuple[str, ...], damping: float, nearer: float) -> str:
    shares, frequent = [], 0.0
    for detector in ((), UNIFORM):
        found = [labels(damping, seed, plant, *detector) for seed in SEEDS]
        late = np.concatenate([label[t > MOVING] for t, label, _ in found])
        shares.append(f"{100 * np.mean(late == nearer):.1f} %")
        if not detector:
            values, counts = np.unique(late, return_counts=True)
            frequent = float(values[counts.argmax()])
    return f"| {what} | {damping:g} | {frequent:g} | " + " | ".join(shares) + " |"
