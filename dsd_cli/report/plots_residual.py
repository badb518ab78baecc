"""What a residual is made of: its correlation, its share by regime, and on what it depends."""

from __future__ import annotations

from typing import Any

import numpy as np

from dsd_cli.identify.compare.comparison import Comparison
from dsd_cli.report.conclusions import no_dependence
from dsd_cli.report.figure import MEASURED, PREDICTED, RESIDUAL, SHARE, nothing
from dsd_cli.report.timeline import zero

#: Bars of the dependence.
_MOST_BARS = 8


def draw_correlation(axis: Any, result: Comparison) -> None:
    """With its own past and with u before, and what chance alone would give."""
    tests = result.residual
    step = result.sample_time * 1e3
    lag = np.arange(1, tests.lags + 1) * step
    axis.axhspan(-tests.band, tests.band, color=SHARE, alpha=0.6, lw=0, label="chance (99 %)")
    zero(axis)
    axis.plot(lag, tests.autocorrelation, color=RESIDUAL, lw=1.4, label="with its own past")
    axis.plot(
        np.arange(tests.lags + 1) * step,
        tests.correlation_with_u,
        color=MEASURED,
        lw=1.4,
        ls="--",
        label="with u before",
    )
    axis.axhline(tests.band_u, color=MEASURED, lw=0.8, ls=":")
    axis.axhline(-tests.band_u, color=MEASURED, lw=0.8, ls=":", label="chance (99 %), u")
    axis.set_xlabel("lag (ms)")
    axis.set_ylabel("correlation, residual of d_hat")
    shown = [*tests.autocorrelation, *tests.correlation_with_u, tests.band_u, -tests.band_u]
    low, high = min(*shown, -0.1), max(*shown, 0.1)
    axis.set_ylim(low - 0.05 * (high - low), high + 0.45 * (high - low))
    step = 0.5 if high - low > 0.6 else 0.1 if high - low > 0.15 else 0.05
    axis.set_yticks([tick for tick in np.arange(-1.0, 1.0 + step / 2, step) if low - 0.02 <= tick <= high + 0.02])
    axis.legend(loc="upper right", ncols=2)


def draw_regimes(axis: Any, result: Comparison) -> None:
    """Share of the error and of the samples; those in brackets overlap the others."""
    regimes = result.where.regimes
    names = [f"({r.regime})" if r.overlaps else r.regime for r in regimes]
    place = np.arange(len(regimes))
    axis.barh(place - 0.2, [100 * r.share_of_error for r in regimes], 0.4, color=PREDICTED, label="of the error")
    axis.barh(place + 0.2, [100 * r.share_of_samples for r in regimes], 0.4, color=SHARE, label="of the samples")
    axis.set_yticks(place, names)
    axis.invert_yaxis()
    overlap = "; (...) overlap the others" if any(r.overlaps for r in regimes) else ""
    of = "force residual" if result.where_of == "force" else "error of d_hat"
    axis.set_xlabel(f"share of the {of} (%){overlap}")
    axis.legend(loc="best")


def draw_dependence(axis: Any, result: Comparison) -> None:
    """How much of the residual a function of each channel explains on data that it was not fitted to."""
    found = sorted(result.dependence, key=lambda one: -one.explains)[:_MOST_BARS]
    if not found:
        nothing(axis, no_dependence(result))
        return
    shares = [100.0 * max(one.explains, 0.0) for one in found]
    colors = [PREDICTED if one.on == result.conclusion else SHARE for one in found]
    axis.barh(range(len(found)), shares, color=colors, height=0.7)
    for place, share in enumerate(shares):
        axis.annotate(f"{share:.3g} %", (share, place), (3, 0), textcoords="offset points", va="center", fontsize=8.5)
    axis.set_yticks(range(len(found)), [one.on for one in found])
    axis.invert_yaxis()
    axis.set_xlim(0.0, 1.15 * max(*shares, 1.0))
    axis.set_xlabel("a function of it explains of the force residual (%, held-out)")
