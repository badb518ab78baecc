"""How the model compares, and where it fails."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import PurePath

from dsd_cli.identify.compare.comparison import Comparison
from dsd_cli.identify.compare.regimes import Band, Bin
from dsd_cli.report.conclusions import conclusion, no_dependence
from dsd_cli.report.page.html import Html, bar, joined, left, table, tag, typeset
from dsd_cli.report.page.parts import missing, panel, panels, section
from dsd_cli.report.page.story import Story


def comparison_section(story: Story) -> Html:
    """What `compare` says of the model as given."""
    title = "How the model compares"
    if story.comparison.value is None:
        return section("compare", title, missing(story.comparison.missing))
    result = story.comparison.value.result
    assert isinstance(result, Comparison)
    parts: list[Html | None] = [
        tag("p", "The model as the config has it, nothing fitted: ", typeset(conclusion(result)), "."),
        _accuracies(result),
        _by_log(result),
    ]
    if story.views.value is not None:
        parts += [panel("d_hat-given"), panel("residual-given")]
    parts.append(_noise_lines(result))
    return section("compare", title, *parts)


def _accuracies(result: Comparison) -> Html:
    unit, force, aside = result.units.force, result.force.log, result.holdout
    columns = [("all logs" if len(result.logs) > 1 else "this log", force, result.accuracy)]
    if aside is not None:
        columns.append((f"held out: {PurePath(aside.log).name}", result.force.holdout, aside.accuracy))
    rows = [
        (left("samples judged"), *(f"{a.samples:,}" for *_, a in columns), left("")),
        (left("force error, rms"), *(_figure(f.rmse if f else None) for _, f, _ in columns), left(_below(unit, force))),
        (
            left("\u2003of it the sensor's noise (floor)"),
            *(_figure(f.floor if f else None) for _, f, _ in columns),
            left(unit),
        ),
        (left("fit of the forces"), *(_figure(f.fit_percent if f else None) for _, f, _ in columns), left("%")),
        (left("error of d_hat, rms"), *(_figure(a.rmse) for *_, a in columns), left(unit)),
        (left("\u2003bias"), *(_figure(a.bias) for *_, a in columns), left(unit)),
        (left("\u2003largest"), *(_figure(a.max_error) for *_, a in columns), left(unit)),
        (left("fit of d_hat"), *(_figure(a.fit_percent) for *_, a in columns), left("%")),
    ]
    made = table(("", *(name for name, *_ in columns), "unit"), rows)
    why = tag("p", f"No force error: {result.force.missing}", class_="dim") if result.force.missing else None
    return joined([made, why])


def _below(unit: str, force: object) -> str:
    hz = getattr(force, "band_hz", math.nan)
    return f"{unit}, below {hz:.3g} Hz" if math.isfinite(hz) else unit


def _by_log(result: Comparison) -> Html | None:
    if len(result.by_log) < 2:
        return None
    rows = [
        (
            left(PurePath(one.log).name),
            f"{one.accuracy.samples:,}",
            *map(_figure, (one.accuracy.rmse, one.accuracy.bias)),
        )
        for one in result.by_log
    ]
    return table(("log", "samples", "rms of d_hat's error", "bias"), rows, "", "Log by log")


def _noise_lines(result: Comparison) -> Html:
    tests = result.residual
    own = "more than noise has" if tests.remembers else "little enough to be noise"
    command = "it follows u" if tests.follows_u else "it does not follow u by an amount that matters"
    return tag(
        "p",
        f"Is the residual of d_hat noise? Its own past predicts {_percent(tests.predictable_share)} of its variance "
        f"({own}); {command} (largest correlation {tests.largest_with_u:.2f}, by chance ±{tests.widest_with_u:.3f}).",
        class_="dim",
    )


def where_section(story: Story) -> Html:
    """Where the error is."""
    title = "Where it fails"
    if story.comparison.value is None:
        return section("where", title, missing(story.why_not(story.comparison)))
    result = story.comparison.value.result
    assert isinstance(result, Comparison)
    where, unit = result.where, result.units
    strips = [
        _strip("time", "s", where.time),
        _strip("velocity", unit.of_velocity, where.velocity),
        _strip("position", unit.of_position, where.position),
        _strip("frequency", "Hz", where.frequency),
    ]
    views = story.views.value
    clouds = [f"given-{cloud.on}" for cloud in views.clouds] if views else []
    return section(
        "where",
        title,
        tag("h3", "The force residual" if result.where_of == "force" else "The error of d_hat"),
        panels(*clouds) if clouds else None,
        tag("div", tag("div", _dependences(result)), tag("div", _regimes(result)), class_="pair"),
        tag("div", *(s for s in strips if s), class_="strips"),
    )


def _dependences(result: Comparison) -> Html:
    shown = [d for d in result.dependence if d.explains >= 0.01][:8]
    if not shown:
        return tag("p", f"What the force residual depends on: {no_dependence(result)}.")
    rows = [(left(d.on), tag("td", _percent(d.explains), bar(d.explains))) for d in shown]
    return table(("a function of", "explains of the force residual (held-out)"), rows)


def _regimes(result: Comparison) -> Html | None:
    if not result.where.regimes:
        return None
    rows = [
        (
            left(f"({r.regime})" if r.overlaps else r.regime),
            tag("td", _percent(r.share_of_samples), bar(r.share_of_samples)),
            tag("td", _percent(r.share_of_error), bar(r.share_of_error, "strong")),
            f"{r.rmse:.3g}",
        )
        for r in result.where.regimes
    ]
    note = tag("p", "Regimes in brackets overlap the others.", class_="dim")
    heads = ("regime", "of the samples", "of the error", f"rms, {result.units.force}")
    return joined([table(heads, rows), note if any(r.overlaps for r in result.where.regimes) else None])


def _strip(over: str, unit: str, bins: Sequence[Bin | Band]) -> Html | None:
    """Shares of the error, bin by bin, as columns."""
    if not bins:
        return None
    top = max(max(one.share_of_error for one in bins), 1e-12)
    columns = [
        tag(
            "i",
            style=f"height:{100.0 * one.share_of_error / top:.1f}%",
            title=f"{one.start:.4g} to {one.end:.4g} {unit}: {_percent(one.share_of_error)} of the error",
        )
        for one in bins
    ]
    worst = max(bins, key=lambda one: one.share_of_error)
    most = f"most, {_percent(worst.share_of_error)}, from {worst.start:.3g} to {worst.end:.3g} {unit}"
    return tag(
        "figure",
        tag("figcaption", tag("b", over), f" · {most}"),
        tag("div", *columns, class_="columns"),
        tag("div", tag("span", f"{bins[0].start:.3g}"), tag("span", f"{bins[-1].end:.3g} {unit}"), class_="ends"),
        class_="strip",
    )


def _figure(value: float | None) -> str:
    return "-" if value is None else f"{value:.3g}"


def _percent(share: float) -> str:
    return f"{100 * share:.1f} %"
