"""`python -m bench paired`: one or more checkouts of `dsd` on the same logs, tier by tier.

Each log is drawn once and asked of every engine: `--engine old=../main --engine new=.`. Rows go to a JSONL file as
they come and are not asked again. The table on stdout has for every engine the share right and wrong-and-sure, for two
engines the discordant pairs as well. Tiers: tests/oracle/tiers_rig.py, tiers_axes.py, tiers_logs.py, and `--tiers-from
FILE.py`, which has `tiers() -> list[Tier]` (tests/oracle/questions.py).
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import multiprocessing
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bench.engines import ROOT, Asked, Engine
from bench.paired_ask import Row, ask
from tests.oracle import tiers_axes, tiers_logs, tiers_rig
from tests.oracle.questions import Tier

RESULTS = Path(__file__).parent / "results" / "paired.jsonl"
#: First seed; no lower one has been asked in any study.
FROM = 80000
QUICK, FULL = 200, 1500


@dataclass(frozen=True)
class Job:
    """One log of one tier, and the engines that have not answered it."""

    tier: str
    seed: int
    engines: tuple[Engine, ...]
    more: Path | None


def main(arguments: Sequence[str] | None = None) -> None:
    options = _options(arguments)
    engines = tuple(Engine.of(text) for text in options.engine or [f"here={ROOT}"])
    known = read(options.output)
    tiers = chosen(all_tiers(options.tiers_from), options.only)
    if not (options.page or options.table):
        jobs = _open(known, tiers, engines, options)
        print(f"{len(jobs)} logs to ask, {options.output}", file=sys.stderr, flush=True)
        with options.output.open("a", encoding="utf-8") as file:
            for rows in answers(jobs, options.workers):
                file.writelines(json.dumps(row) + "\n" for row in rows)
                file.flush()
                known += rows
    for path in options.beside:
        known += read(path)
    from bench import paired_page

    shown = [r for r in known if r["tier"] in {t.name for t in tiers}]
    names = list(dict.fromkeys(r["engine"] for r in shown))
    if not (options.page or options.table or options.beside):
        names = [engine.name for engine in engines]
    print("\n".join(paired_page.text(shown, names)))
    if options.page:
        paired_page.write(shown, names)


def _options(arguments: Sequence[str] | None) -> Any:
    parser = argparse.ArgumentParser(
        prog="python -m bench paired", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--engine", action="append", metavar="NAME=PATH", help="a checkout; this one if none is given")
    parser.add_argument("--logs", type=int, default=QUICK, help=f"about, over all tiers ({QUICK}; in full {FULL})")
    parser.add_argument("--seed", type=int, default=FROM, help="the first")
    parser.add_argument("--only", nargs="*", default=[], help="tiers whose name contains one of these")
    parser.add_argument("--tiers-from", type=Path, help="a file with tiers of its own, besides")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--output", type=Path, default=RESULTS, help="JSONL, one row a log and engine")
    parser.add_argument(
        "--beside", type=Path, action="append", default=[], help="rows of an earlier run to compare with"
    )
    parser.add_argument("--table", action="store_true", help="print what is there and ask nothing")
    parser.add_argument("--page", action="store_true", help="write the page and its picture of what is there")
    options = parser.parse_args(arguments)
    options.output.parent.mkdir(parents=True, exist_ok=True)
    return options


def read(path: Path) -> list[Row]:
    """Rows of a file; none if it is not there."""
    return [json.loads(line) for line in path.read_text().splitlines() if line.strip()] if path.exists() else []


def all_tiers(more: Path | None) -> list[Tier]:
    """Those of the project, and of one more file.

    Raises
    ------
    SystemExit : that file has no `tiers()`.
    """
    own = [*tiers_rig.tiers(), *tiers_axes.tiers(), *tiers_logs.tiers()]
    if more is None:
        return own
    spec = importlib.util.spec_from_file_location("tiers_from", more)
    if spec is None or spec.loader is None or not more.is_file():
        sys.exit(f"--tiers-from {more}: no such Python file")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    if not hasattr(module, "tiers"):
        sys.exit(f"--tiers-from {more}: it has no tiers() that returns a list of Tier")
    return [*own, *module.tiers()]


def chosen(tiers: Sequence[Tier], names: Sequence[str]) -> list[Tier]:
    """Tiers whose name contains one of these; all of them without names."""
    return [t for t in tiers if not names or any(name in t.name for name in names)]


def counts(tiers: Sequence[Tier], logs: int) -> dict[str, int]:
    """Logs of each tier by its weight, at least one."""
    whole = sum(t.weight for t in tiers)
    return {t.name: max(1, round(logs * t.weight / whole)) for t in tiers}


def _open(known: Sequence[Row], tiers: Sequence[Tier], engines: Sequence[Engine], options: Any) -> list[Job]:
    """What has not been answered, a log of every tier first, then the next of each."""
    done = {(r["engine"], r["tier"], r["seed"]) for r in known}
    wanted, jobs = counts(tiers, options.logs), []
    for i in range(max(wanted.values(), default=0)):
        for tier in tiers:
            seed = options.seed + i
            open_ = tuple(e for e in engines if (e.name, tier.name, seed) not in done)
            if i < wanted[tier.name] and open_:
                jobs.append(Job(tier.name, seed, open_, options.tiers_from))
    return jobs


def answers(jobs: Sequence[Job], workers: int) -> Iterator[list[Row]]:
    """The rows of each job as they come."""
    if workers == 1:
        yield from map(_answer, jobs)
        return
    with multiprocessing.get_context("spawn").Pool(workers) as pool:
        yield from pool.imap_unordered(_answer, jobs)


_RUNNING: dict[Path, Asked] = {}  # of this process


def _answer(job: Job) -> list[Row]:
    """A tier that fails to draw gives no rows, an engine that fails a wrong one."""
    tier = next(t for t in all_tiers(job.more) if t.name == job.tier)
    try:
        question = tier.draw(job.seed)
    except RuntimeError as error:
        print(f"{job.tier}, seed {job.seed}: {error}", file=sys.stderr, flush=True)
        return []
    for engine in job.engines:
        if engine.root not in _RUNNING:
            _RUNNING[engine.root] = Asked(engine)
    rows = ask(question, {e.name: _RUNNING[e.root] for e in job.engines})
    head = {"tier": job.tier, "seed": job.seed}
    return [{"engine": e.name, "commit": e.commit} | head | rows[e.name] for e in job.engines]
