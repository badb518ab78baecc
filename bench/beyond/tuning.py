"""Item `tuning`: what `dsd tune` chooses, against the best of 125 tunings that are judged by the truth."""

from __future__ import annotations

from pathlib import Path

from bench.beyond._tuning_runs import LOGS, correct, evidence, sweep
from dsd_cli.detect.tune.tuning import tune

SEEDS = (1, 2)


def section(pictures: Path) -> str:
    """One line per log and seed; `pictures` gets none."""
    lines = [
        "| log | seed | as configured | best of 5 x 5 x 5 | tuned | rho, window, 1 - stay | added | expected lag | "
        "false changes an hour |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    worst = 0.0
    for name in LOGS:
        for seed in SEEDS:
            line, behind = _line(name, seed)
            lines.append(line)
            worst = max(worst, behind)
    lines += ["", f"At worst {100 * max(worst, 0.0):.2f} % behind the best of the sweep."]
    return "\n".join(lines)


def _line(name: str, seed: int) -> tuple[str, float]:
    one, log = evidence(name, seed)
    best, _ = max(sweep(one, log), key=lambda pair: pair[0])
    tuning = tune(one)
    settings = tuning.after.settings
    got = correct(one.with_grid(tuning.grid), settings, log)
    stay = settings.transition.stay
    lag = tuning.expected.delay_median
    cells = (
        name,
        str(seed),
        f"{100 * correct(one, one.engine.settings, log):.1f} %",
        f"{100 * best:.2f} %",
        f"{100 * got:.2f} %",
        f"{settings.rho:g}, {settings.window}, {'uniform' if stay is None else f'{1 - stay:.0e}'}",
        ", ".join(f"{added.axis} {added.value:g}" for added in tuning.added) or "-",
        "-" if lag is None else f"{1e3 * lag:.0f} ms",
        f"{tuning.expected.false_per_hour:.3g} (of {3600 * tuning.expected.hours:.0f} s)",
    )
    return "| " + " | ".join(cells) + " |", best - got
