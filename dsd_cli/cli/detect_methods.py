"""`dsd detect --method a,b,c`: several methods on one log, side by side."""

from __future__ import annotations

import sys
from typing import get_args

from dsd_cli.cli.labelling import cleaner_for, open_log, run_log
from dsd_cli.cli.plan import as_logged, widening
from dsd_cli.cli.progress import Progress
from dsd_cli.detect.settings import Method
from dsd_cli.detect.side_by_side import MethodScore, TimedSession, score
from dsd_cli.errors import TooShort, UsageError
from dsd_cli.files.config import Config


def parse_methods(text: str) -> list[str]:
    """The methods of `--method`.

    Raises
    ------
    UsageError : one that does not exist, or one twice.
    """
    names, known = [name.strip() for name in text.split(",")], get_args(Method)
    for name in names:
        if name not in known:
            raise UsageError(f"--method {text}: there is no method '{name}'", "methods are " + ", ".join(known))
    if len(set(names)) < len(names):
        raise UsageError(f"--method {text}", "give each method once")
    return names


def side_by_side(log: str, config: Config, methods: list[str], form: str, quiet: bool) -> None:
    """Run every method on the log and print the comparison.

    Raises
    ------
    UsageError : a form that is no summary, or a log that can be read only once.
    """
    from dsd_cli.report.methods import print_table, to_json
    from dsd_cli.report.terminal import json_text

    if form not in ("table", "json"):
        raise UsageError(f"--format {form} with several methods", "only table and json compare them")
    if log == "-":
        raise UsageError("several methods need a log that can be read again", "give a file")
    with Progress(not quiet) as progress, widening(config.signals):
        scores = [_scored(log, config, method, progress) for method in methods]
    if form == "json":
        print(json_text(to_json(log, scores), indent=1))
    else:
        print_table(log, scores, sys.stdout)


def _scored(log: str, config: Config, method: str, progress: Progress) -> MethodScore:
    average = [] if method in ("average", "combination") else ["detector.average=1"]
    config = as_logged(config, log).override([f'detector.method="{method}"', *average])
    table, plan = open_log(log, config)
    session = TimedSession(plan, cleaner_for(config, plan))
    found = run_log(table, session, progress.watch, f"{method}: labelling")
    progress(f"{method}: judging")
    result = score(method, found.rows, found.truth, plan.grid, session)
    if not result.judged:
        raise TooShort(f"{table.name}: no sample could be judged", "`dsd detect` with one method says why")
    return result
