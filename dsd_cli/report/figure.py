"""The one style of all pictures: colours, lines, text, and the file they become."""

from __future__ import annotations

import io
import textwrap
from collections.abc import Callable
from typing import Any

import numpy as np

from dsd_cli.errors import printable
from dsd_cli.signals.envelope import envelope
from dsd_cli.signals.log import Array
from dsd_cli.signals.units import Units

#: Suffix of a file -> format; each name is one that a user may give to --plot.
FORMATS = {".png": "png", ".svg": "svg", ".pdf": "pdf"}
#: Told apart by all eyes and, by their lightness, in grey: after Okabe and Ito.
MEASURED, PREDICTED, OTHER, RESIDUAL, SHARE = "#0b5394", "#e07b00", "#b5459b", "#444444", "#c3cdd7"
FORWARD, BACKWARD, LIMIT, ZERO = "#0b5394", "#e07b00", "#a3180f", "0.6"
#: Of models side by side: colour, line.
MODELS = ((MEASURED, "-"), (PREDICTED, "--"), (OTHER, "-."), ("#008060", ":"), (RESIDUAL, (0, (6, 1, 1, 1))))
#: Points of a line over the width of a page, and of a cloud.
LINE_POINTS, CLOUD_POINTS = 2400, 4000
_DPI, _SEED = 120, 20261121
_STYLE: Any = {
    "font.size": 9.5,
    "axes.titlesize": 10.0,
    "axes.labelsize": 9.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.xmargin": 0.01,
    "axes.formatter.limits": (-4, 5),
    "axes.formatter.useoffset": False,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "lines.linewidth": 1.1,
    "svg.hashsalt": "dsd",
    "figure.constrained_layout.use": True,
}
#: Without a date, so that the same picture is the same file.
_METADATA: dict[str, dict[str, Any]] = {
    "png": {"Software": None},
    "svg": {"Date": None},
    "pdf": {"CreationDate": None},
}


def rendered(draw: Callable[[], Any], suffix: str) -> bytes:
    """The figure that `draw` makes, as the content of a file; `suffix` is one of `FORMATS`."""
    import logging
    import warnings

    logging.getLogger("matplotlib").setLevel(logging.ERROR)  # that it finds no folder for its fonts is not ours to say
    import matplotlib

    content, form = io.BytesIO(), FORMATS[suffix.lower()]
    with matplotlib.rc_context(_STYLE), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a letter that the font lacks is a box
        figure = draw()
        figure.savefig(content, format=form, dpi=_DPI, metadata=_METADATA[form], bbox_inches="tight", pad_inches=0.12)
    return content.getvalue()


def sheet(width: float, height: float) -> Any:
    """An empty figure, inches."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height))


def in_picture(text: str) -> str:
    """A text as it stands: no formula between dollars, no control characters; line ends stay."""
    return "\n".join(map(printable, text.split("\n"))).replace("$", r"\$")


def shortened(name: str, most: int = 44) -> str:
    """A long name without its middle."""
    return name if len(name) <= most else f"{name[: most // 2 - 1]}...{name[-(most - most // 2 - 2) :]}"


def headline(figure: Any, text: str, width: int) -> None:
    """The title of a figure, broken into lines of `width` characters."""
    lines = [textwrap.fill(line, width) for line in text.split("\n")]
    figure.suptitle(in_picture("\n".join(lines)).replace("`", ""), fontsize=11)


def channel_label(name: str, units: Units) -> str:
    """`velocity (rad/s)`: what stands beside the axis of a channel."""
    unit = {
        "t": "s",
        "u": units.u,
        "d_hat": units.force,
        "velocity": units.of_velocity,
        "position": units.of_position,
        "delay": "s",
        "inertia": units.words("{u}/({v}/s)") if units.u and units.position else "",
    }.get(name, "")
    return f"{'time' if name == 't' else name}{f' ({unit})' if unit else ''}"


def line(axis: Any, t: Array, x: Array, color: str, label: str | None = None, **style: Any) -> None:
    """A line over time that shows every peak, however many samples there are."""
    axis.plot(*envelope(t, x, LINE_POINTS), color=color, label=label, **({"lw": 1.0} | style))


def cloud(axis: Any, x: Array, y: Array, color: str, **style: Any) -> None:
    """Points; of very many a random part, and those that stick out."""
    axis.plot(*thinned(x, y, CLOUD_POINTS), ".", color=color, mew=0, **({"ms": 2.5, "alpha": 0.35} | style))


def thinned(x: Array, y: Array, points: int) -> tuple[Array, Array]:
    """At most `points` of the finite points: along x the lowest and the highest of each part, the rest by chance."""
    finite = np.isfinite(x) & np.isfinite(y)
    x, y = x[finite], y[finite]
    if x.size <= points:
        return x, y
    order = np.argsort(x, kind="stable")
    edge = envelope(x[order], y[order], points // 10)
    chosen = np.sort(np.random.default_rng(_SEED).choice(x.size, points - edge[0].size, replace=False))
    return np.concatenate([x[chosen], edge[0]]), np.concatenate([y[chosen], edge[1]])


def binned_median(x: Array, y: Array, bins: int, least: int = 5) -> tuple[Array, Array]:
    """(median of x, median of y) of equal bins of x, neighbours taken together until they hold `least` samples.

    Medians, so that one sample that is far off does not bend the curve. 0 is an edge of a bin, and no bin reaches over
    it; an empty bin breaks the curve (NaN). What does not add up to `least` samples is left out.
    """
    finite = np.isfinite(x) & np.isfinite(y)
    x, y = x[finite], y[finite]
    if not x.size:
        return np.zeros(0), np.zeros(0)
    width = max(float(np.ptp(x)) / bins, 1e-300)
    place = np.floor(x / width).astype(np.int64) if np.ptp(x) > 0.0 else np.zeros(x.size, dtype=np.int64)
    order = np.argsort(place, kind="stable")
    found, starts = np.unique(place[order], return_index=True)
    at: list[float] = []
    middle: list[float] = []
    rows = np.zeros(0, dtype=np.intp)
    for k, part in enumerate(np.split(order, starts[1:])):
        hole = k > 0 and found[k] > found[k - 1] + 1
        if hole and at and np.isfinite(at[-1]):
            at, middle = [*at, np.nan], [*middle, np.nan]
        rows = part if hole or found[k] == 0 else np.concatenate([rows, part])
        if rows.size >= least:
            at, middle = [*at, float(np.median(x[rows]))], [*middle, float(np.median(y[rows]))]
            rows = rows[:0]
    return np.array(at), np.array(middle)


def legend_above(axis: Any, columns: int, lift: float = 0.0) -> None:
    """A legend over the upper right corner, which takes room above and none beside; `lift` : lines it stands higher."""
    lines = round(lift) + -(-len(axis.get_legend_handles_labels()[1]) // columns)
    axis.set_title("\n".join([" "] * lines), fontsize=9.5)
    place = axis.legend(loc="lower right", bbox_to_anchor=(1.0, 0.985 + 0.11 * lift), ncols=columns, borderaxespad=0.0)
    place.set_in_layout(False)


def nothing(axis: Any, text: str) -> None:
    """What stands where there is nothing to draw."""
    axis.text(0.5, 0.5, text, ha="center", va="center", transform=axis.transAxes, color="0.45", wrap=True)
    axis.set_xticks([])
    axis.set_yticks([])
