"""The table of docs/measured/paper.md: what the paper does not say, and what each choice does to its figures.

python -m tests.paper.choices
"""

from __future__ import annotations

import numpy as np

from tests.paper.runs import BETWEEN, INERTIAS, follow_lag, neighbours, run

CHOICES = (
    (0.001, "error", True),
    (0.001, "error", False),
    (0.001, "output", True),
    (0.001, "output", False),
    (0.002, "error", True),
    (0.005, "error", True),
    (0.010, "error", True),
)


def main() -> None:
    print(
        "| sample time | derivative on | Q on the prediction | Fig. 6, J = 0.5 and 1.0 | neighbours only, J = 0.6-0.9 "
        "| wrong delays after 1.5 s, J = 0.6 / 0.7 / 0.8 / 0.9 | Fig. 7 | Fig. 8: lag for J = 0.5 / 1.0 |"
    )
    print("|" + "---|" * 8)
    for choice in CHOICES:
        print(row(*choice))


def row(sample_time: float, derivative: str, q: bool) -> str:
    """One line of the table."""
    given = (
        f"simulate.sample_time={sample_time}",
        f"simulate.controller.derivative={derivative}",
        f"detector.observer_filter={str(q).lower()}",
    )
    steps = {j: run("paper-step", f"model.inertia={j}", *given) for j in INERTIAS}
    exact = [np.mean((steps[j].delay(0.75) == 0.3) & (steps[j].inertia(0.75) == j)) for j in (0.5, 1.0)]
    strays = {j: np.mean(~np.isin(steps[j].inertia(0.75), list(neighbours(j)))) for j in BETWEEN}
    wrong = [np.mean(steps[j].delay(1.5) != 0.3) for j in BETWEEN]
    sines = [np.mean(run("paper-sine", f"model.inertia={j}", *given).delay(0.8) == 0.3) for j in INERTIAS]
    lags = [follow_lag(run("paper-delay-change", f"model.inertia={j}", *given)) for j in (0.5, 1.0)]
    stray = ", ".join(f"{100 * s:.2g} % stray for J = {j}" for j, s in strays.items() if s > 0)
    return " | ".join(
        (
            f"| {1e3 * sample_time:g} ms",
            derivative,
            "yes" if q else "no",
            "yes" if min(exact) == 1 else "**no** (" + " / ".join(f"{100 * x:.4g} %" for x in exact) + ")",
            stray or "yes",
            " / ".join(f"{100 * x:.4g} %" for x in wrong),
            "yes" if min(sines) == 1 else f"**no** ({100 * min(sines):.4g} %)",
            " / ".join(f"{lag:.3f} s" for lag in lags) + " |",
        )
    )


if __name__ == "__main__":
    main()
