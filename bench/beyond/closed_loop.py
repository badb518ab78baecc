"""Item `closed_loop`: tracking error without and with adaptation, 1,000 random loops, time of a controller's step."""

from __future__ import annotations

import os
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

from bench.beyond._adaptive_runs import FAR, GRID, Outcome, outcomes
from dsd_cli.detect import DetectorSettings, Engine
from dsd_cli.detect.engine import Measurement as Measured
from dsd_cli.detect.feedback import Adaptation
from dsd_cli.plant.adaptive import AdaptiveController
from dsd_cli.plant.controllers import ControllerSettings
from dsd_cli.plant.controllers import Measured as Sample
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.plant.references import Step
from dsd_cli.plant.simulation import Measurement, SimulationSettings, simulate
from dsd_cli.signals.log import Log

T = 2e-3
INERTIAS = (0.5, 0.55, 0.6, 0.7, 0.8, 0.9, 1.0, 1.1, 1.25, 1.4, 1.6, 1.8, 2.0)
RUNS = int(os.environ.get("DSD_LOOPS", "1000"))


def section(pictures: Path) -> str:
    """Three tables, and the picture beyond-closed-loop.png."""
    logs = {j: (_run(j, False), _run(j, True)) for j in INERTIAS}
    _draw(logs, pictures / "beyond-closed-loop.png")
    return "\n\n".join((_errors(logs), _random(), _step_times()))


def adaptation(window: int = 50, rho: float = 0.1) -> Adaptation:
    """The paper's nine states."""
    return Adaptation(Engine(GRID, DetectorSettings(window=window, rho=rho, hold=3.0), Measured(T, 1.0, 0.01)))


def _run(inertia: float, adapt: bool) -> Log:
    settings = SimulationSettings(
        PlantModel(inertia, 0.3),
        20.0,
        T,
        controller=ControllerSettings(derivative="error"),
        reference=Step(0.3),
        measurement=Measurement(0.01, seed=1),
    )
    return simulate(settings, adaptation() if adapt else None)


def _last(log: Log) -> float:
    """Largest tracking error of the last 2 s."""
    return float(np.abs(log["reference"] - log["position"])[-round(2.0 / T) :].max())


def _errors(logs: dict[float, tuple[Log, Log]]) -> str:
    lines = [
        "| true J | abs(1 - Jn/J) | error without | error with | adopted at | believed in the end |",
        "|---|---|---|---|---|---|",
    ]
    for inertia, (without, adapted) in logs.items():
        held = np.isfinite(adapted["adopted_inertia"])
        since = f"{adapted['t'][held.argmax()]:.2f} s" if held.any() else "never"
        end = f"J = {adapted['adopted_inertia'][-1]:g}, L = {adapted['adopted_delay'][-1]:g} s" if held.any() else "-"
        found = (f"{abs(1 - 1 / inertia):.3f}", f"{_last(without):.3f}", f"{_last(adapted):.4f}", since, end)
        lines.append(f"| {inertia:g} | " + " | ".join(found) + " |")
    return "\n".join(lines)


def _draw(logs: dict[float, tuple[Log, Log]], path: Path) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.0, 4.2), layout="constrained")
    left, right = figure.subplots(1, 2)
    errors = np.array([[_last(log) for log in pair] for pair in logs.values()])
    left.plot(INERTIAS, errors[:, 0], "o-", color="#b5482f", label="without (the paper's Fig. 5)")
    left.plot(INERTIAS, errors[:, 1], "s-", color="#2f6db5", label="with --adapt")
    left.set(xlabel="true inertia J (Jn = 1)", ylabel="tracking error after 20 s (step of 1)", ylim=(-0.03, 1.1))
    left.legend(frameon=False)
    for inertia, style in ((0.5, "-"), (2.0, "--")):
        for log, color in zip(logs[inertia], ("#b5482f", "#2f6db5"), strict=True):
            right.plot(log["t"], log["position"], style, color=color, lw=1.2)
    right.plot(log["t"], log["reference"], color="0.5", lw=0.8)
    right.set(xlabel="t (s)", ylabel="position", title="J = 0.5 (solid) and 2 (dashed)", ylim=(-0.1, 2.4))
    for axis in (left, right):
        axis.spines[["top", "right"]].set_visible(False)
    figure.savefig(path, dpi=110)


def _random() -> str:
    step = 50
    with ProcessPoolExecutor(max_workers=2) as pool:
        parts = pool.map(_part, [(a, min(a + step, RUNS)) for a in range(0, RUNS, step)])
        found = [one for part in parts for one in part]
    without, adapted = ([one[i] for one in found] for i in (0, 1))
    only = sum(b.diverged and not a.diverged for a, b in found)
    lines = [
        f"| {RUNS:,} random loops | without | with |",
        "|---|---|---|",
        f"| diverged (end more than {FAR:g} times the reference's span away) | {_count(without)} | {_count(adapted)} |",
        f"| diverged with, not without | | {only} |",
        *(f"| tracking error, {name} | {_quantile(without, q)} | {_quantile(adapted, q)} |" for name, q in _QUANTILES),
        f"| smaller error with adaptation | | {100 * np.mean([b.error < a.error for a, b in found]):.0f} % |",
    ]
    return "\n".join(lines)


_QUANTILES = (("median", 0.5), ("9 of 10 below", 0.9), ("largest", 1.0))


def _part(seeds: tuple[int, int]) -> list[tuple[Outcome, Outcome]]:
    return [(without, adapted) for _, without, adapted in outcomes(range(*seeds))]


def _count(found: list[Outcome]) -> int:
    return sum(one.diverged for one in found)


def _quantile(found: list[Outcome], q: float) -> str:
    return f"{np.quantile([one.error for one in found], q):.2f}"


def _step_times() -> str:
    """Of one sample: the engine, what is adopted of it, and the control law; with a garbage collector at work."""
    feedback = adaptation()
    controller = AdaptiveController(ControllerSettings(derivative="error"), ObserverSettings(), T, 0.4)
    rng = np.random.default_rng(1)
    engine = adaptation().engine
    samples = np.cumsum(rng.normal(size=(20_000, 2)), axis=0) * 0.01
    rows: dict[str, list[int]] = {"Engine.step": [], "Adaptation.step": [], "AdaptiveController.step": []}
    for u, d in samples.tolist():
        clock: Any = time.perf_counter_ns
        a = clock()
        engine.step(u, d)
        b = clock()
        believed = feedback.step(u, d)
        c = clock()
        controller.adopt(believed)
        controller.step(Sample(1.0, 0.0, u, d, d))
        end = clock()
        for times, took in zip(rows.values(), (b - a, c - b, end - c), strict=True):
            times.append(took)
    lines = ["| one step, 9 states | median | p99 |", "|---|---|---|"]
    for name, times in rows.items():
        middle, high = np.percentile(times, [50, 99]) / 1e3
        lines.append(f"| {name} | {middle:.2f} us | {high:.2f} us |")
    return "\n".join(lines)
