"""docs/measured/hidden.md and its picture, from the numbers of bench/results/hidden.json alone."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

from bench import hidden_score as score
from bench.hidden_cases import AMPLITUDES, SENSINGS
from bench.hidden_peers import METHODS, summary
from bench.hidden_text import CLOSING, HARD, METHOD, OPENING, PEERS

DOCS = Path(__file__).parents[1] / "docs"
PAGE, PICTURE = DOCS / "measured" / "hidden.md", DOCS / "hidden-calibration.png"
Row = dict[str, Any]
#: Columns of the confusion table that are no effects, shown last.
LAST = ("inertia", "delay", "none", "unknown", "error")


def write(data: dict[str, Any]) -> None:
    """The page and the picture."""
    found = score.summary(data["parts"])
    PAGE.write_text("\n".join(_page(data, found)) + "\n", encoding="utf-8")
    picture(found["calibration"], PICTURE)
    print(f"written: {PAGE.relative_to(DOCS.parent)}, {PICTURE.relative_to(DOCS.parent)}")


def _page(data: dict[str, Any], found: dict[str, Any]) -> Iterator[str]:
    yield OPENING
    yield from _headline(found)
    yield "\n## One effect is hidden\n"
    yield from _singles(found["singles"])
    yield "\n## What is taken for what\n"
    yield from _confusion(found["confusion"])
    yield "\n## Two effects at once\n"
    yield from _pairs(found["pairs"])
    yield "\n## Effects that are in no library\n"
    yield from _strangers(found["strangers"])
    yield "\n## Is the stated probability true?\n"
    yield from _calibration(found["calibration"])
    yield "\n## Beside PySINDy and an expert's least squares\n"
    yield from _peers(data)
    yield HARD
    yield from _wrong(data["parts"])
    yield METHOD
    yield from _runs(data["runs"])
    yield CLOSING


def table(head: Sequence[str], body: Iterable[Sequence[str]]) -> Iterator[str]:
    yield f"| {' | '.join(head)} |"
    yield f"|{'---|' * len(head)}"
    for cells in body:
        yield f"| {' | '.join(cells)} |"


def percent(found: dict[str, Any] | None) -> str:
    """Share, and the counts behind it."""
    if not found or not found["of"]:
        return "-"
    return f"{100 * found['share']:.1f} % ({found['hits']} of {found['of']})"


def _headline(found: dict[str, Any]) -> Iterator[str]:
    alone, clean, two, strange = (found[k] for k in ("singles", "none", "pairs", "strangers"))
    met = {True: "", False: "missed"}

    def row(what: str, value: dict[str, Any], aim: float, most: bool = False) -> tuple[str, ...]:
        if not value["of"]:
            return what, "not run", "", ""
        good = value["share"] <= aim if most else value["share"] >= aim
        return what, percent(value), f"{'at most' if most else 'at least'} {100 * aim:g} %", met[good]

    yield from table(
        ("what", "found", "aim", ""),
        (
            row("one effect: the verdict is its name", alone["top1"], 0.98),
            row("the same, or the name is among the ties that the verdict states", alone["tied"], 0.98),
            row("nothing missing: something was named all the same", clean["alarms"], 0.02, most=True),
            row("two effects: both are in the ladder", two["both"], 0.95),
            row("two effects: these two and no other", two["exactly"], 0.90),
            row("an effect that is in no library: `unknown` at the end", strange["unknown"], 0.90),
        ),
    )
    if found["seconds"]:
        middle, slow = found["seconds"]["median"], found["seconds"]["q90"]
        yield f"\nOne diagnosis of a log of 10 s at 1 kHz took {middle:.1f} s (90 % of them less than {slow:.1f} s),"
        yield "two at a time on two cores that other work shared."
    yield f"Wrong, no tie stated, and 90 % or more sure: {percent(alone['wrong_and_sure'])}."


def _singles(found: dict[str, Any]) -> Iterator[str]:
    yield (
        f"Of {found['logs']} logs {found['too_faint']} are left out because the true law would lower the error by less "
        f"than 5 %, and {found['untestable']} because the tool itself says that this log cannot test the effect.\n"
    )
    both = [(k, found["by_amplitude"][k]) for k in AMPLITUDES if k in found["by_amplitude"]]
    both += [(f"logged: {k}", found["by_sensing"][k]) for k in SENSINGS if k in found["by_sensing"]]
    head = ("logs", "named", "named or stated as a tie")
    yield from table(head, ((k, percent(g["top1"]), percent(g["tied"])) for k, g in both))
    yield "\nError with the effect added over the floor of the sensor; values within 3 standard errors:\n"
    head = ("effect", "named", "named or tie", "error / sensor: median", "90 %", "values")
    yield from table(head, (_effect_row(k, g) for k, g in sorted(found["by_effect"].items())))


def _effect_row(name: str, group: dict[str, Any]) -> tuple[str, ...]:
    ratio = group["error_ratio"]
    ends = (f"{ratio['median']:.3f}", f"{ratio['q90']:.3f}") if ratio else ("-", "-")
    return name, percent(group["top1"]), percent(group["tied"]), *ends, percent(group["values"])


def _confusion(found: dict[str, dict[str, int]]) -> Iterator[str]:
    yield "Rows: what was hidden. Columns: the verdict; only verdicts that occur have one.\n"
    named = {verdict for verdicts in found.values() for verdict in verdicts}
    order = [n for n in sorted(found) if n not in LAST] + [n for n in LAST if n in found]
    columns = [n for n in order if n in named and n not in LAST]
    columns += sorted(named - set(columns) - set(LAST)) + [n for n in LAST if n in named]
    head = ["hidden", *(c.replace("_", " ") for c in columns)]
    body = ([truth, *(_cell(found[truth].get(c, 0), c == truth) for c in columns)] for truth in order)
    yield from table(head, body)


def _cell(count: int, diagonal: bool) -> str:
    if not count:
        return ""
    return f"**{count}**" if diagonal else str(count)


def _pairs(found: dict[str, Any]) -> Iterator[str]:
    yield "`dsd improve --auto` from a model that lacks both. Fitting inertia or delay again is no effect;"
    yield "a wrong one is found if a step names it, or if 90 % of the gap to the true value is closed at the end.\n"
    groups = sorted(found["by_pair"].items())
    body = [(k.replace("+", " and "), percent(g["both"]), percent(g["exactly"])) for k, g in groups]
    yield from table(("hidden", "both found", "both and no other"), body)


def _strangers(found: dict[str, Any]) -> Iterator[str]:
    yield "What is there: friction or viscosity that grows with time, friction that depends on the position, a load"
    yield "that walks at random, a force v q. The ladder may take known effects first; the end must be `unknown`.\n"
    body = [
        (name, percent(group), "; ".join(f"{end.replace('>', '→')} ({n})" for end, n in found["ends"][name].items()))
        for name, group in sorted(found["by_stranger"].items())
    ]
    yield from table(("hidden", "unknown at the end", "ladders"), body)


def _calibration(bins: Sequence[dict[str, Any]]) -> Iterator[str]:
    yield "All diagnoses of the study by what they said of their own verdict.\n"
    head = ("stated", "mean of stated", "right", "share right")
    yield from table(
        head,
        (
            (
                f"{b['from']:g} to {b['to']:g}",
                f"{b['stated']:.3f}",
                f"{b['hits']} of {b['of']}",
                f"{b['hits'] / b['of']:.3f}",
            )
            for b in bins
        ),
    )
    yield f"\n![Share of right verdicts against the stated probability](../{PICTURE.name})"


def _peers(data: dict[str, Any]) -> Iterator[str]:
    peers = data.get("peers")
    if not peers or not peers["rows"]:
        yield (peers or {}).get("missing", "Not run yet: `python -m bench hidden --only peers`.")
        return
    yield PEERS.format(version=peers["pysindy"])
    found = summary(peers, data["parts"])
    head = (
        "",
        "one effect: named",
        "nothing missing: false alarms",
        "pairs: both",
        "pairs: exactly the two",
        "s per log",
    )
    yield from table(head, (_peer_row(name, found[name]) for name in (*METHODS, "dsd")))


def _peer_row(name: str, g: dict[str, Any]) -> tuple[str, ...]:
    alarms, exact = percent(g["alarms"]), percent(g["exactly"])
    if "useful_alarms" in g and name != "shelf":
        alarms += f"; with a tolerance {g['useful_alarms']['hits']}"
        exact += f"; with a tolerance {g['useful_exactly']['hits']}"
    seconds = f"{g['seconds']['median']:.2f}" if g["seconds"] else "-"
    label = METHODS.get(name, "**dsd**, with nothing laid out by hand")
    return label, percent(g["top1"]), alarms, percent(g["both"]), exact, seconds


def _wrong(parts: dict[str, list[Row]]) -> Iterator[str]:
    """Which effects are missed most, and what is said instead."""
    alone = [r for r in score.counted(parts.get("singles", ())) if not score.right(r)]
    table_ = score.confusion(alone)
    order = sorted(table_, key=lambda name: -sum(table_[name].values()))
    body = [
        (name, str(sum(table_[name].values())), ", ".join(f"{v} ({n})" for v, n in table_[name].items()))
        for name in order
    ]
    if body:
        yield from table(("hidden", "missed", "verdict instead"), body)


def _runs(runs: dict[str, Any]) -> Iterator[str]:
    head = ("part", "logs", "seconds", "processes", "date", "version")
    body = [
        (k, str(r["logs"]), f"{r['seconds']:.0f}", str(r["workers"]), r["date"], r.get("version", ""))
        for k, r in runs.items()
    ]
    yield ""
    yield from table(head, body)


def picture(bins: Sequence[dict[str, Any]], path: Path) -> None:
    """Share right against stated, with two-sided 95 % intervals (Wilson)."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(5.2, 4.6), dpi=130)
    axes.plot([0, 1], [0, 1], color="0.6", linewidth=1, label="stated = true")
    for b in bins:
        low, high = _wilson(b["hits"], b["of"])
        axes.plot([b["stated"]] * 2, [low, high], color="#2a6f97", linewidth=1.5)
    stated, share = [b["stated"] for b in bins], [b["hits"] / b["of"] for b in bins]
    axes.plot(stated, share, "o", color="#2a6f97", markersize=5, label="share right, 95 % interval")
    for b in bins:
        low, _ = _wilson(b["hits"], b["of"])
        place = {"textcoords": "offset points", "xytext": (0, -9), "ha": "center", "fontsize": 7}
        axes.annotate(str(b["of"]), (b["stated"], low), **place)
    axes.set(xlabel="stated probability of the verdict", ylabel="share of verdicts that are right")
    axes.set(xlim=(0, 1.02), ylim=(-0.07, 1.05), title="Stated and true certainty (numbers: verdicts)")
    axes.legend(loc="upper left", frameon=False, fontsize=8)
    figure.tight_layout()
    figure.savefig(path)
    plt.close(figure)


def _wilson(hits: int, of: int, z: float = 1.96) -> tuple[float, float]:
    p, n = hits / of, float(of)
    middle, spread = p + z * z / (2 * n), z * (p * (1 - p) / n + z * z / (4 * n * n)) ** 0.5
    return (middle - spread) / (1 + z * z / n), (middle + spread) / (1 + z * z / n)
