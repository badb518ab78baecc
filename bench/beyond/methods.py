"""Item `methods`: every method on the same states and the same logs."""

from __future__ import annotations

import itertools
from pathlib import Path

from dsd_cli.cli.plan import detection_plan
from dsd_cli.cli.simulate import simulation_settings
from dsd_cli.detect.side_by_side import MethodScore, TimedSession, score
from dsd_cli.files.template import load_template
from dsd_cli.plant.simulation import simulate
from dsd_cli.signals.cleaning import Cleaner

METHODS = ("dsd", "average", "combination", "imm", "viterbi", "smooth", "profile")
#: Name -> (template, overrides); all with J = 1 unless said otherwise, and noise on d_hat.
LOGS = {
    "sine, 3 changes of delay and inertia, noise 1": (
        "paper-sine",
        (
            "simulate.duration=8",
            "simulate.noise=1.0",
            "detector.rho=1.0",
            "simulate.events=[{time=2, delay=0.4}, {time=4, inertia=0.5}, {time=6, delay=0.2, inertia=2.0}]",
        ),
    ),
    "step, delay change at 1.5 s (Fig. 8), noise 0.01": ("paper-delay-change", ("simulate.noise=0.01",)),
}
SEEDS = range(1, 6)
#: Methods whose window is their memory: A as in the paper, all elements equal. The others get theirs from stay 0.999.
WINDOWED = ("dsd", "average", "combination", "profile")


def section(pictures: Path) -> str:
    """The tables of all logs; `pictures` gets none."""
    return "\n\n".join(_table(name, *given) for name, given in LOGS.items())


def _table(name: str, template: str, overrides: tuple[str, ...]) -> str:
    lines = [
        f"{name.capitalize()}; {len(SEEDS)} seeds:",
        "",
        "| method | right | confident | of these right | followed | after | false switches | us each |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for method in METHODS:
        found = [_score(template, overrides, method, seed) for seed in SEEDS]
        lines.append(f"| {method} | " + " | ".join(_cells(found)) + " |")
    return "\n".join(lines)


def _score(template: str, overrides: tuple[str, ...], method: str, seed: int) -> MethodScore:
    sticky = "uniform" if method in WINDOWED else "{stay=0.999}"
    average = ("detector.average=10",) if method in ("average", "combination") else ()
    config = load_template(template).override(
        [
            *overrides,
            f"simulate.seed={seed}",
            f"detector.transition={sticky}",
            f'detector.method="{method}"',
            *average,
        ]
    )
    log = simulate(simulation_settings(config))
    plan = detection_plan(config, {"t": "t", "u": "u", "d_hat": "d_hat"}, {}, name=template)
    session = TimedSession(plan, Cleaner(None))
    rows = list(itertools.chain(session.feed(log["t"], log.channels), session.finish()))
    truth = {name: log[name] for name in ("true_delay", "true_inertia")}
    return score(method, rows, truth, plan.grid, session)


def _cells(found: list[MethodScore]) -> list[str]:
    def mean(values: list[float | None]) -> str:
        known = [v for v in values if v is not None]
        return f"{100 * sum(known) / len(known):.1f} %" if known else "-"

    delays = [one.detection_delay for one in found if one.detection_delay is not None]
    return [
        mean([one.share_correct for one in found]),
        mean([one.confident_share for one in found]),
        mean([one.share_correct_confident for one in found]),
        f"{sum(one.followed or 0 for one in found)} of {sum(one.changes or 0 for one in found)}",
        f"{1e3 * sum(delays) / len(delays):.0f} ms" if delays else "-",
        f"{sum(one.false_switches or 0 for one in found) / len(found):.1f}",
        f"{min(one.nanoseconds for one in found) / 1e3:.3g}",
    ]
