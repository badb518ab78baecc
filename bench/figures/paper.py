"""Fig. 6-8 of the paper: the labels of its runs over time, one row for each inertia."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from dsd_cli.report.figure import LIMIT, MEASURED, SHARE, rendered, sheet
from tests.paper.runs import INERTIAS, Run, run

#: Name -> (template, title, inertias, s at which the delay becomes 0.4 s, s from which the claims are judged).
PICTURES: dict[str, tuple[str, str, tuple[float, ...], float, float]] = {
    "paper-fig6": ("paper-step", "Fig. 6: step at 0.3 s, delay 0.3 s", INERTIAS, np.inf, 0.75),
    "paper-fig7": ("paper-sine", "Fig. 7: sine of 20 rad/s, delay 0.3 s", INERTIAS, np.inf, 0.8),
    "paper-fig8": ("paper-delay-change", "Fig. 8: step, delay 0.3 s, from 1.5 s on 0.4 s", (0.5, 1.0), 1.5, 0.75),
}


def draw(name: str, path: Path) -> None:
    """One figure."""
    path.write_bytes(rendered(lambda: _figure(*PICTURES[name]), ".png"))


def _figure(template: str, title: str, inertias: tuple[float, ...], change: float, judged: float) -> Any:
    figure = sheet(10.0, 1.05 * len(inertias) + 1.6)
    panels = figure.subplots(len(inertias), 2, sharex=True, sharey="col", squeeze=False)
    figure.suptitle(title)
    for (inertia_panel, delay_panel), inertia in zip(panels, inertias, strict=True):
        labelled = run(template, f"model.inertia={inertia}")
        truth = np.where(labelled.t < change, 0.3, 0.4)
        _draw(inertia_panel, labelled, labelled.labels.inertia, np.full(truth.size, inertia), (0.5, 1.0, 2.0))
        _draw(delay_panel, labelled, labelled.labels.delay, truth, (0.2, 0.3, 0.4))
        inertia_panel.set_ylabel(f"J = {inertia:g}")
        for panel in (inertia_panel, delay_panel):
            panel.axvline(judged, color="0.25", lw=0.8, ls=(0, (4, 2)))
    panels[0, 0].set_title("(a) label of the inertia")
    panels[0, 1].set_title("(b) label of the delay (s)")
    for panel in panels[-1]:
        panel.set_xlabel("time (s)")
    handles, names = panels[0, 0].get_legend_handles_labels()
    handles.append(panels[0, 0].axvline(judged, color="0.25", lw=0.8, ls=(0, (4, 2))))
    figure.legend(handles, [*names, "the claims are judged from here on"], loc="outside lower center", ncols=4)
    return figure


def _draw(panel: Any, labelled: Run, label: np.ndarray, truth: np.ndarray, candidates: tuple[float, ...]) -> None:
    t = labelled.t
    for value in candidates:
        panel.axhline(value, color="0.85", lw=0.7, zorder=1)
    low, high = min(candidates), max(candidates)
    room = 0.15 * (high - low)
    unsure = ~labelled.labels.confident
    panel.fill_between(
        t, low - room, high + room, where=unsure, step="post", color=SHARE, alpha=0.6, lw=0, label="not confident"
    )
    panel.step(t, truth, where="post", color=LIMIT, lw=1.2, ls="--", label="true")
    panel.step(t, label, where="post", color=MEASURED, lw=1.7, label="label")
    panel.set_yticks(candidates, [f"{value:g}" for value in candidates])
    panel.set_ylim(low - room, high + room)
