"""The tables of the paired study, and docs/measured/paired.md with its picture."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import chain
from pathlib import Path
from typing import Any

from bench import paired_score as score

Row = dict[str, Any]
DOCS = Path(__file__).parents[1] / "docs"
PAGE, PICTURE = DOCS / "measured" / "paired.md", DOCS / "paired-reliability.png"

HEAD = """# The same logs for every version

`python -m bench paired` draws logs once and asks each version of the tool, with its own package, through its own
commands. Tiers are the two rigs of this project (`tests/oracle`) and axes that no laboratory has: geared joints of
which friction is most of the drive, crawls through cogging, cycles, small travel, one direction, play with stiff and
soft contact, small effects of no catalogue behind one that is in it, d_hat by other makers. None of these uses the
package to make a log. "Right" is what the maker of the log knows: the verdict of `diagnose`; for sets the effects of
`improve` and no other; "unknown" at the end for effects of no catalogue. "Sure and wrong": another name at 90 % or
more, no tie stated that has the truth.
"""

TAIL = """Bars are 95 % intervals. The verdict is the effect that is worth most: where it is rather doubtful it is there
more often than it says, for the commoner of two that tie is named; of *every effect listed* each bin with 30 answers
says what comes true. Rows of d_hat are one axis behind nine makers, so that one hard axis counts there nine times.
"""


def text(rows: Sequence[Row], names: Sequence[str]) -> list[str]:
    """Everything, as Markdown: tiers, then what the probabilities and errors are worth."""
    if not names:
        return ["no rows yet"]
    lines = [*_table(rows, names), "", *_worth(rows, names)]
    for name in names:
        own = [r for r in rows if r["engine"] == name]
        lines += ["", *_bins(f"{name}: stated probability of a verdict", filter(None, map(score.stated, own)))]
        lines += ["", *_bins(f"{name}: of every effect listed", chain.from_iterable(map(score.names, own)))]
    return lines


def _table(rows: Sequence[Row], names: Sequence[str]) -> list[str]:
    two = list(names[:2]) if len(names) > 1 else []
    head = ["tier", *(f"{n}: right | sure and wrong | s CPU" for n in names)]
    head += [f"only {n}" for n in two] + (["p"] if two else [])
    lines = ["| " + " | ".join(head) + " |", "|---" * (1 + 3 * len(names) + (3 if two else 0)) + "|"]
    tiers = list(dict.fromkeys(r["tier"] for r in rows))
    for tier in [*tiers, None]:
        own = [r for r in rows if tier is None or r["tier"] == tier]
        cells = [tier or "**all**"]
        for name in names:
            cells += _cells([r for r in own if r["engine"] == name])
        if two:
            first, second, p = score.mcnemar(score.paired(own, *two))
            cells += [str(first), str(second), f"{p:.2g}"]
        lines.append("| " + " | ".join(cells) + " |")
    return lines


def _cells(rows: Sequence[Row]) -> list[str]:
    if not rows:
        return ["", "", ""]
    right, wrong = sum(map(score.right, rows)), sum(map(score.sure_and_wrong, rows))
    return [f"{right} of {len(rows)}", str(wrong), f"{sum(r['seconds'] for r in rows) / len(rows):.1f}"]


def _worth(rows: Sequence[Row], names: Sequence[str]) -> list[str]:
    lines = [
        "| | logs | errors | Brier score | values within 1.96 standard errors | inertia alone | CPU, s a log |",
        "|---|---|---|---|---|---|---|",
    ]
    for name in names:
        own = [r for r in rows if r["engine"] == name]
        every, inertia = score.coverage(own), score.coverage(own, "inertia")
        answers = [s for s in map(score.stated, own) if s]
        cells = [name, str(len(own)), str(sum(r["verdict"] == "error" for r in own)), f"{score.brier(answers):.3f}"]
        cells += [_share(every.held, every.of), _share(inertia.held, inertia.of)]
        cells.append(f"{sum(r['seconds'] for r in own) / len(own):.2f}")
        lines.append("| " + " | ".join(cells) + " |")
    return lines


def _share(hits: int, of: int) -> str:
    return f"{hits} of {of} ({100 * hits / of:.0f} %)" if of else ""


def _bins(title: str, answers: Iterable[tuple[float, bool]]) -> list[str]:
    lines = [f"| {title} | mean | holds |", "|---|---|---|"]
    for b in score.reliability(answers):
        lines.append(f"| {b.low:.2f} to {b.high:.2f} | {b.stated:.3f} | {_share(b.hits, b.of)} |")
    return lines


def write(rows: Sequence[Row], names: Sequence[str]) -> None:
    """The page and its picture."""
    commits = {n: sorted({r["commit"] for r in rows if r["engine"] == n}) for n in names}
    seeds = sorted({r["seed"] for r in rows})
    said = ", ".join(f"{n} is {' and '.join(c)}" for n, c in commits.items())
    few = len(rows) / max(len({r["tier"] for r in rows}) * len(names), 1)
    lines = [*HEAD.splitlines(), f"Seeds {seeds[0]} to {seeds[-1]}, {few:.1f} logs a tier; {said}.", ""]
    lines += [*text(rows, names), ""]
    picture = f"![stated probability against share that holds](../{PICTURE.name})"
    lines += [picture, "", *TAIL.splitlines()]
    PAGE.write_text("\n".join(lines) + "\n", encoding="utf-8")
    _draw(rows, names)


def _draw(rows: Sequence[Row], names: Sequence[str]) -> None:
    """A reliability diagram: bars are 95 % intervals of the share."""
    from scipy.stats import binomtest

    from bench.figures.__main__ import small
    from dsd_cli.report.figure import rendered, sheet

    def figure() -> Any:
        drawn = sheet(5.2, 4.6)
        panel = drawn.subplots()
        panel.plot([0, 1], [0, 1], color="0.6", lw=0.8)
        for name in names:
            bins = score.reliability(s for s in map(score.stated, [r for r in rows if r["engine"] == name]) if s)
            share = [b.hits / b.of for b in bins]
            spans = [binomtest(b.hits, b.of).proportion_ci() for b in bins]
            low = [s - span.low for s, span in zip(share, spans, strict=True)]
            high = [span.high - s for s, span in zip(share, spans, strict=True)]
            panel.errorbar([b.stated for b in bins], share, [low, high], marker="o", ms=4, lw=1, capsize=2, label=name)
        panel.set(xlabel="stated probability", ylabel="share that holds", xlim=(0, 1.02), ylim=(0, 1.02))
        panel.legend(loc="upper left")
        return drawn

    PICTURE.write_bytes(small(rendered(figure, ".png")))
