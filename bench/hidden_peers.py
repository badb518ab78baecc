"""What others name on the same logs: PySINDy in several settings, and an expert's one-at-a-time least squares with BIC.

All get the believed model's residual and the columns of bench/hidden_columns.py; the tool gets the log alone.
"""

from __future__ import annotations

import importlib.util
import multiprocessing
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.hidden_cases import AMPLITUDES, PEER_SENSINGS, Job, with_speed
from bench.hidden_columns import Problem, motion_laws, problem
from bench.hidden_score import OWN_VALUES
from tests.oracle import machines
from tests.oracle.machine_cases import EFFECT_IDS, pairs

Array = NDArray[np.float64]
Row = dict[str, Any]
FOLDS = 5
CLEAN, LEVELS = 20, 3  # logs with nothing missing; amplitudes, from plain
MOST_TERMS = 10
THRESHOLDS = tuple(np.geomspace(0.003, 0.4, 10).tolist())
#: A named effect must take this share off the held-out error where a tolerance is set by hand.
TOLERANCE = 0.015
#: method -> what it is, as the table says.
METHODS = {
    "shelf": "PySINDy off the shelf: STLSQ, default threshold, its own differentiation, linear columns",
    "linear": "PySINDy tuned: STLSQ, threshold by held-out error, linear columns, aligned and filtered",
    "stlsq": "the same with every searched shape laid out by hand",
    "frols": "PySINDy FROLS with every shape, sparsest within one standard error",
    "ssr": "PySINDy SSR with every shape, sparsest within one standard error",
    "expert": "expert: one at a time, least squares, BIC, with every shape",
}


def jobs(seeds: Sequence[int]) -> Iterator[Job]:
    """Logs with a speed, of the same kinds as in the study (same seeds, so the tool's rows can be matched)."""
    for seed in seeds:
        for k, amplitude in enumerate(AMPLITUDES[:LEVELS]):
            yield from (Job("singles", (name,), seed, amplitude, with_speed(seed, k)) for name in EFFECT_IDS)
        yield from (Job("pairs", pair, seed, sensing=PEER_SENSINGS[seed % 2]) for pair in pairs())
    yield from (Job("none", (), 4 * (k // 2) + k % 2, sensing=PEER_SENSINGS[k % 2]) for k in range(CLEAN))


def study(seeds: Sequence[int], workers: int) -> dict[str, Any]:
    """Rows of every log and method, or why not."""
    if importlib.util.find_spec("pysindy") is None:
        return {"rows": [], "missing": "pysindy is not installed: pip install -e '.[bench]'"}
    from importlib.metadata import version

    work, begin = list(jobs(seeds)), time.perf_counter()
    count = max(1, -(-len(work) // 12))
    with multiprocessing.get_context("spawn").Pool(workers) as pool:
        rows = [row for found in pool.imap_unordered(_batch, [work[i::count] for i in range(count)]) for row in found]
    rows.sort(key=lambda r: (r["part"], r["truth"], r["amplitude"], r["seed"]))
    return {"rows": rows, "pysindy": version("pysindy"), "seconds": round(time.perf_counter() - begin, 1)}


def _batch(batch: Sequence[Job]) -> list[Row]:
    recordings = machines.run([job.case() for job in batch])
    return [_row(job, found) for job, found in zip(batch, recordings, strict=True)]


def _row(job: Job, found: machines.Recording) -> Row:
    whole = problem(found)
    linear = whole.linear()
    answers = {
        "shelf": lambda: _shelf(found),
        "linear": lambda: _answer(linear, _tuned(linear, _stlsq, one_error=False)),
        "stlsq": lambda: _answer(whole, _tuned(whole, _stlsq, one_error=False)),
        "frols": lambda: _answer(whole, _tuned(whole, _frols, one_error=True)),
        "ssr": lambda: _answer(whole, _tuned(whole, _ssr, one_error=True)),
        "expert": lambda: _answer(whole, _expert(whole), first=True),
    }
    return job.as_json() | {"ratio": found.ratio, "methods": {name: _timed(ask) for name, ask in answers.items()}}


def _timed(ask: Callable[[], Row]) -> Row:
    begin = time.perf_counter()
    return ask() | {"seconds": round(time.perf_counter() - begin, 3)}


class Grams:
    """Normal equations of interleaved blocks: training sets, held-out errors, and small matrices with the same fits."""

    def __init__(self, given: Problem) -> None:
        rows = np.column_stack([given.matrix, given.y / np.std(given.y)])
        owner = (np.arange(len(rows)) * 4 * FOLDS // len(rows)) % FOLDS
        self.parts = [rows[owner == k].T @ rows[owner == k] for k in range(FOLDS)]
        self.counts = [int(np.sum(owner == k)) for k in range(FOLDS)]
        self.total, self.rows = sum(self.parts), len(rows)

    def training(self, fold: int | None) -> Array:
        return self.total if fold is None else self.total - self.parts[fold]

    def compressed(self, fold: int | None) -> tuple[Array, Array]:
        """(columns, target) with few rows and the same inner products, scaled to the mean of one row."""
        gram = self.training(fold)
        values, vectors = np.linalg.eigh(gram)
        root = (vectors * np.sqrt(np.maximum(values, values[-1] * 1e-13))).T
        return root[:, :-1], root[:, -1:]

    def solved(self, support: Sequence[int], fold: int | None) -> Array:
        gram = self.training(fold)
        chosen = list(support)
        out = np.zeros(len(gram) - 1)
        if chosen:
            out[chosen] = np.linalg.lstsq(gram[np.ix_(chosen, chosen)], gram[chosen, -1], rcond=1e-11)[0]
        return out

    def squares(self, coefficients: Array, part: Array) -> float:
        x = np.append(-coefficients, 1.0)
        return float(x @ part @ x)

    def held_out(self, support: Sequence[int]) -> Array:
        """Mean square per fold, of a fit to the other folds."""
        return np.array([self.squares(self.solved(support, k), self.parts[k]) / self.counts[k] for k in range(FOLDS)])


Path = list[tuple[int, ...]]  # supports, sparse to full


def _tuned(given: Problem, path: Callable[[Array, Array], Path], one_error: bool) -> tuple[Grams, Array]:
    """The rung of the path that predicts held-out blocks best, or the sparsest within one standard error of it."""
    grams = Grams(given)
    folds = [path(*grams.compressed(k)) for k in range(FOLDS)]
    length = min(map(len, folds))
    losses = np.array(
        [
            [grams.squares(grams.solved(f[n], k), grams.parts[k]) / grams.counts[k] for n in range(length)]
            for k, f in enumerate(folds)
        ]
    )
    mean = losses.mean(axis=0)
    best = int(np.argmin(mean))
    if one_error:
        limit = mean[best] + losses[:, best].std(ddof=1) / np.sqrt(FOLDS)
        best = int(np.flatnonzero(mean <= limit)[0])
    full = path(*grams.compressed(None))
    return grams, grams.solved(full[min(best, len(full) - 1)], None)


def _support(coefficients: Array) -> tuple[int, ...]:
    return tuple(int(i) for i in np.flatnonzero(np.abs(np.ravel(coefficients)) > 1e-10))


def _stlsq(x: Array, y: Array) -> Path:
    from pysindy.optimizers import STLSQ

    found: Path = []
    size = np.sqrt(np.sum(x * x, axis=0).mean())  # thresholds are shares of the target: columns have one rms
    for threshold in reversed(THRESHOLDS):
        fit = _quiet(STLSQ(threshold=threshold, alpha=1e-6), x / size, y / size)
        found.append(_support(fit.coef_))
    return found


def _frols(x: Array, y: Array) -> Path:
    from pysindy.optimizers import FROLS

    fit = _quiet(FROLS(max_iter=MOST_TERMS, alpha=1e-9), x, y)
    return [_support(c) for c in fit.history_]


def _ssr(x: Array, y: Array) -> Path:
    from pysindy.optimizers import SSR

    fit = _quiet(SSR(max_iter=x.shape[1], alpha=1e-9), x, y)
    return [(), *sorted((_support(c) for c in fit.history_[1:]), key=len)]


def _quiet(optimizer: Any, x: Array, y: Array) -> Any:
    import warnings

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return optimizer.fit(x, y)


def _expert(given: Problem) -> tuple[Grams, Array]:
    """Adds the group of columns that lowers BIC most until none does; the believed effects are fitted along."""
    grams = Grams(given)
    groups: dict[str, list[int]] = {}
    for i, column in enumerate(given.columns):
        groups.setdefault(column.group, []).append(i)
    chosen = [i for i, c in enumerate(given.columns) if c.effect in given.base]

    def bic(support: Sequence[int]) -> float:
        squares = max(grams.squares(grams.solved(support, None), grams.total), 1e-300)
        return grams.rows * np.log(squares / grams.rows) + len(support) * np.log(grams.rows)

    score, order = bic(chosen), list(chosen)
    while len(order) < len(chosen) + 2 * MOST_TERMS:
        tried = {g: bic([*order, *new]) for g, new in groups.items() if not set(new) & set(order)}
        group = min(tried, key=tried.__getitem__)
        if tried[group] >= score:
            break
        score, order = tried[group], [*order, *groups[group]]
    grams.first = [i for i in order if i not in chosen][:1]  # type: ignore[attr-defined]
    return grams, grams.solved(order, None)


def _answer(given: Problem, found: tuple[Grams, Array], first: bool = False) -> Row:
    """The effect with the largest contribution (`first`: that was taken first), and all that are named."""
    grams, coefficients = found
    sizes: dict[str, float] = {}
    for effect in {c.effect for c in given.columns} - set(given.base):
        part = np.array([k if c.effect == effect else 0.0 for k, c in zip(coefficients, given.columns, strict=True)])
        if np.any(part):
            sizes[effect] = float(part @ grams.total[:-1, :-1] @ part)
    named = sorted(sizes, key=sizes.__getitem__, reverse=True)
    if first and grams.first:  # type: ignore[attr-defined]
        lead = given.columns[grams.first[0]].effect  # type: ignore[attr-defined]
        named = [lead, *(n for n in named if n != lead)]
    return {"top": named[0] if named else "none", "named": named, "useful": _useful(given, grams, coefficients, named)}


def _useful(given: Problem, grams: Grams, coefficients: Array, named: Sequence[str]) -> list[str]:
    """Those without which the held-out error would be larger by more than a tolerance."""
    support = _support(coefficients)
    whole = np.sqrt(grams.held_out(support).mean())

    def without(effect: str) -> float:
        return float(np.sqrt(grams.held_out([i for i in support if given.columns[i].effect != effect]).mean()))

    return [effect for effect in named if whole < (1.0 - TOLERANCE) * without(effect)]


def _shelf(found: machines.Recording) -> Row:
    """As in PySINDy's own examples: differentiate the logged speed, hand over the functions, fit."""
    import pysindy

    case, x = found.truth, found.channels
    whole = round(case.believed_delay / case.sample_time)
    u = np.concatenate([np.zeros(whole), x["u"][: len(x["u"]) - whole]])
    way = np.sign(x["velocity"])
    laws = [*motion_laws(x["position"], x["velocity"], way), ("load_friction", "", np.abs(u) * way), ("inertia", "", u)]
    laws += [("delay", "", np.concatenate([np.zeros(late), u[:-late]]) - u) for late in (1, 4)]
    matrix = np.stack([force for _, _, force in laws], axis=1)
    slope = pysindy.SmoothedFiniteDifference()._differentiate(x["velocity"][:, None], case.sample_time)
    rest = np.asarray(slope)[:, 0] - (u + _believed(case, x["velocity"], way)) / case.believed_inertia
    model = pysindy.SINDy(feature_library=pysindy.IdentityLibrary())
    model.fit(x["velocity"][:, None], t=case.sample_time, x_dot=rest[:, None], u=matrix[:, 1:])
    coefficients = np.ravel(model.coefficients())
    sizes: dict[str, Array] = {}
    for k, (effect, _, _) in enumerate(laws):
        if coefficients[k] and effect not in dict(case.base):
            sizes[effect] = sizes.get(effect, np.zeros(len(u))) + coefficients[k] * matrix[:, k]
    named = sorted(sizes, key=lambda name: -float(np.mean(sizes[name] ** 2)))
    return {"top": named[0] if named else "none", "named": named, "useful": named}


def _believed(case: machines.Case, v: Array, way: Array) -> Array:
    laws = {"viscous_friction": ("coefficient", v), "coulomb_friction": ("level", way)}
    force = np.zeros_like(v)
    for name, values in case.base:
        key, shape = laws[name]
        force -= values[key] * shape
    return force


def summary(peers: dict[str, Any], tool: dict[str, list[Row]]) -> dict[str, dict[str, Any]]:
    """method -> counts, and the tool's on the same logs under "dsd"."""
    from bench import hidden_score as score

    rows = peers["rows"]
    calls = {r["call"] for r in rows}
    ours = {part: [r for r in found if r["call"] in calls] for part, found in tool.items()}
    alone = [r for r in rows if r["part"] == "singles" and r["ratio"] >= score.LEAST_RATIO]
    clean, two = ([r for r in rows if r["part"] == part] for part in ("none", "pairs"))
    table: dict[str, dict[str, Any]] = {}
    for name in METHODS if rows else ():

        def of(row: Row, key: str, method: str = name) -> Any:
            return row["methods"][method][key]

        table[name] = {
            "top1": score.share(alone, lambda r: of(r, "top") == r["truth"]),
            "alarms": score.share(clean, lambda r: bool(of(r, "named"))),
            "useful_alarms": score.share(clean, lambda r: bool(of(r, "useful"))),
            "both": score.share(two, lambda r: set(r["what"]) <= set(of(r, "named"))),
            "exactly": score.share(two, lambda r: _exact(r, of(r, "named"))),
            "useful_exactly": score.share(two, lambda r: _exact(r, of(r, "useful"))),
            "seconds": score.quantiles([of(r, "seconds") for r in rows]),
        }
    used = [r for r in ours.get("singles", ()) if r["ratio"] >= score.LEAST_RATIO]
    table["dsd"] = {
        "top1": score.share(used, score.right),
        "alarms": score.share(ours.get("none", []), lambda r: r["verdict"] != "none"),
        "both": score.share(ours.get("pairs", []), score.both),
        "exactly": score.share(ours.get("pairs", []), score.exactly),
        "seconds": score.seconds(ours.get("singles", ())),
    }
    return table


def _exact(row: Row, named: Sequence[str]) -> bool:
    what = set(row["what"])
    return what <= set(named) and set(named) - set(OWN_VALUES) == what - set(OWN_VALUES)
