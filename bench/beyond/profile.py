"""The paper's runs with an inertia between the candidates: eq. 18-19 beside the profile likelihood."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from bench.beyond._runs import detected, labelled, percent, simulated, table
from dsd_cli.files.config import Config, States
from dsd_cli.signals.log import Array, Log

INERTIAS = (0.5, 0.6, 0.7, 0.8, 0.9, 1.0)
MOVING = ("paper-delay-change", 'simulate.reference={kind="sine", frequency=20.0}')
RUNS = {
    "Fig. 6, step": ("paper-step",),
    "Fig. 7, sine": ("paper-sine",),
    "Fig. 8, delay change": ("paper-delay-change",),
    "Fig. 8 with the sine": MOVING,
}
#: Standard deviation on d_hat, and rho.
NOISES = ((0.0, 0.3), (0.01, 0.3), (0.1, 0.3), (1.0, 1.0), (10.0, 10.0))
SEEDS = 1
#: Shorter than the templates: after 3 s nothing moves any more.
SHORT = "simulate.duration=3"
#: s after a change in which a window holds more of the old state than of the new one.
FOLLOW = 0.1


def section(pictures: Path) -> str:
    rows = [row(name, noise, rho) for name in RUNS for noise, rho in NOISES]
    head = ("run", "noise", "rho", "dsd alone: confident", "wrong", "dsd: confident", "wrong")
    head += ("profile: confident", "wrong", "label at the end right")
    _picture(pictures / "beyond-profile.png")
    return table(head, rows) + "\n\n![Fig. 6 with J = 0.7](../beyond-profile.png)"


#: The engine of method dsd by itself; what `dsd detect` asks beside its lead; method profile.
WAYS = ("alone", "dsd", "profile")


def counts(template: tuple[str, ...], way: str, noise: float, rho: float, seeds: int = SEEDS) -> tuple[float, ...]:
    """Over six inertias: share of confident labels, number of confident ones with a wrong delay, and right at the end.

    The samples in which a window still holds the old state are left out.
    """
    confident, wrong, total, end = 0, 0, 0, []
    for inertia in INERTIAS:
        config, log = simulated(*template, SHORT, f"model.inertia={inertia}")
        truth = np.array(log["true_delay"])
        changes = log["t"][1:][np.diff(truth) != 0.0]
        use = np.all(
            [~((log["t"] >= c) & (log["t"] < c + FOLLOW)) for c in changes] or [np.ones(len(log), bool)], axis=0
        )
        for seed in range(seeds if noise else 1):
            sure, delay = _labels(config, log, way, noise, seed, f"detector.rho={rho}", "detector.hold=3")
            confident += int(sure.sum())
            wrong += int((sure & use & (delay != truth)).sum())
            total += len(log)
            end.append(bool(delay[-1] == truth[-1]))
    return confident / total, wrong, float(np.mean(end))


def _labels(config: Config, log: Log, way: str, noise: float, seed: int, *tuning: str) -> tuple[Array, Array]:
    """Whether the delay is confident, and which it is."""
    if way == "dsd":
        rows = detected(config, log, noise, seed, *tuning)
        return rows.confident, np.array(config.require(States).delays)[
            rows.state // len(config.require(States).inertias)
        ]
    _, labels = labelled(config, log, noise, seed, f"detector.method={'dsd' if way == 'alone' else way}", *tuning)
    return labels.estimates[4] if labels.estimates else labels.confident, labels.delay


def row(name: str, noise: float, rho: float) -> tuple[str, ...]:
    found = [counts(RUNS[name], way, noise, rho) for way in WAYS]
    shown = [text for one in found for text in (percent(one[0]), str(one[1]))]
    return (name, f"{noise:g}", f"{rho:g}", *shown, percent(found[-1][2]))


def _picture(path: Path) -> None:
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    config, log = simulated("paper-step", SHORT, "model.inertia=0.7")
    t = log["t"]
    figure, axes = plt.subplots(2, 1, figsize=(8, 5), sharex=True, layout="constrained")
    for method, colour in (("dsd", "tab:orange"), ("profile", "tab:blue")):
        _, labels = labelled(config, log, 0.01, 0, f"detector.method={method}", "detector.rho=0.3", "detector.hold=3")
        for axis, values, truth in zip(axes, (labels.delay, labels.inertia), (0.3, 0.7), strict=True):
            axis.axhline(truth, color="grey", lw=0.8)
            if method == "dsd":
                axis.plot(t, values, color=colour, lw=1.0, label="dsd, label")
                sure = np.where(labels.confident, values, np.nan)
                axis.plot(t, sure, color="tab:red", lw=3.0, label="dsd, confident")
        if labels.estimates:
            delay, delay_std, inertia, inertia_std, *flags = labels.estimates
            for axis, value, std, flag in zip(axes, (delay, inertia), (delay_std, inertia_std), flags, strict=True):
                axis.fill_between(t, value - 1.96 * std, value + 1.96 * std, color=colour, alpha=0.25, lw=0)
                axis.plot(t, value, color=colour, lw=1.0, label="profile, held")
                axis.plot(t, np.where(flag, value, np.nan), color=colour, lw=3.0, label="profile, confident")
    axes[0].set(
        ylabel="delay, s", ylim=(0.15, 0.45), title="Fig. 6, J = 0.7 between the candidates 0.5 and 1, noise 0.01"
    )
    axes[1].set(ylabel="inertia", xlabel="t, s", ylim=(0.4, 1.1), xlim=(0.3, 3.0))
    axes[0].legend(loc="lower right", ncols=2, fontsize=8)
    figure.savefig(path, dpi=110)
    plt.close(figure)
