"""`python -m bench fuzz --seconds 600`: malformed logs and extreme configs; a finding says how to repeat it.

Every run is a forked copy of this process, which has the package imported already, with limits on memory and CPU, and
is decided by its number alone: `--only N` repeats it. A finding is a traceback, "unexpected", a signal, an exit code
that the contract does not have, a control character on a terminal, a file left behind, labels that are not finite
where they may not be, a config that was written and cannot be read, or a run beyond its limits.
"""

from __future__ import annotations

import argparse
import contextlib
import importlib
import multiprocessing
import os
import re
import resource
import shutil
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

from bench import fuzz_cases

#: Limits of one run: bytes beyond what the process has, s of CPU, s in which it may do nothing.
MEMORY, CPU, PATIENCE = 2 << 30, 20, 60
#: What the runs would import one by one, each again.
WARM = (
    *("pyarrow.csv", "pyarrow.parquet", "pyarrow.compute", "rich.table", "rich.console", "scipy.signal", "scipy.stats"),
    *("dsd_cli.cli.main", "dsd_cli.cli.detect_job"),
    *("dsd_cli.identify.compare.comparison", "dsd_cli.identify.compare.forward", "dsd_cli.identify.improve"),
    *("dsd_cli.detect.tune.tuning", "dsd_cli.cli.init_log", "dsd_cli.cli.report_story", "dsd_cli.report.page.page"),
    *("dsd_cli.report.figure", "matplotlib.figure", "matplotlib.backends.backend_agg"),
    *("dsd_cli.report.comparison_table", "dsd_cli.files.logs", "dsd_cli.effects", "dsd_cli.plant.simulation"),
)
#: What a run may leave.
OUTPUTS = ("out.csv", "out.csv.meta.json", "out.parquet", "out.toml", "out.png", "out.html")
#: A fault of the package, as it reports one; a library may say of a file that its end was unexpected.
BAD = re.compile(rb"Traceback|unexpected \w*(?:Error|Exception|Iteration)|Warning:")
RAW = re.compile(rb"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f]|\xc2[\x80-\x9f]")


#: Number of a run, its folder -> its arguments.
Case = Callable[[int, Path], list[str]]


class Outcome(NamedTuple):
    """What a run did; `finding` is empty where all is as promised."""

    code: int
    finding: str
    command: str


def main(arguments: Sequence[str] | None = None) -> None:
    """Run until the time is over; exit code 1 if there was a finding."""
    parser = argparse.ArgumentParser(prog="python -m bench fuzz", description=__doc__)
    parser.add_argument("--seconds", type=float, default=600.0)
    parser.add_argument("--seed", type=int, default=0, help="number of the first run")
    parser.add_argument("--only", type=int, help="repeat this run and show what it says")
    parser.add_argument("--files", action="store_true", help="spoil files of every kind that libraries and tools write")
    options = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory(prefix="dsd-fuzz-") as name:
        folder = Path(name)
        case = _of_files(folder) if options.files else fuzz_cases.case
        if options.only is not None:
            print(_run(options.only, folder, case, show=True))
            return
        found = fuzz(folder, options.seed, options.seconds, case)
    sys.exit(1 if found else 0)


def _of_files(folder: Path) -> Case:
    from bench import fuzz_files

    (folder / "made").mkdir()
    return partial(fuzz_files.case, files=fuzz_files.made(folder / "made"))


def fuzz(folder: Path, seed: int, seconds: float, case: Case = fuzz_cases.case) -> int:
    """The number of findings."""
    warm_up()
    again = "" if case is fuzz_cases.case else " --files"
    begin, number, codes, findings = time.monotonic(), seed, Counter[int](), 0
    commands, done = Counter[str](), Counter[str]()
    while time.monotonic() - begin < seconds:
        outcome = _run(number, folder, case)
        codes[outcome.code] += 1
        commands[outcome.command] += 1
        done[outcome.command] += outcome.code == 0
        if outcome.finding:
            findings += 1
            print(f"{outcome.finding}\n  repeat: python -m bench fuzz --only {number}{again}", flush=True)
        number += 1
    listed = ", ".join(f"{count} x {code}" for code, count in sorted(codes.items()))
    print("runs (with exit code 0): " + ", ".join(f"{c} {n} ({done[c]})" for c, n in commands.most_common()))
    print(f"{number - seed} runs, exit codes {listed}: {findings} finding(s)")
    return findings


def warm_up() -> None:
    """Import once what every run needs; nothing may begin threads yet, which a fork does not take along."""
    from dsd_cli.cli.lazy import COMMANDS, load_command

    for command in COMMANDS:
        load_command(command)
    for module in WARM:
        importlib.import_module(module)


def _run(number: int, parent: Path, case: Case, show: bool = False) -> Outcome:
    """One run in a folder of its own, in a process of its own."""
    folder = parent / f"run-{number}"
    folder.mkdir()
    try:
        arguments = case(number, folder)
        before = {path.name for path in folder.iterdir()}
        process = multiprocessing.get_context("fork").Process(target=_child, args=(arguments, folder))
        process.start()
        process.join(PATIENCE)
        leader = process.pid or 0
        while process.exitcode is None and _would_run(leader):
            process.join(1.0)  # CPU ends what has no end
        if process.exitcode is None:
            os.killpg(leader, signal.SIGKILL)
            process.join()
            return Outcome(-9, f"no end after {PATIENCE} s: {arguments}", arguments[0])
        said = (folder / ".stderr").read_bytes()
        if show:
            print(" ".join(["dsd", *arguments]))
            sys.stdout.write((folder / ".stdout").read_bytes().decode(errors="backslashreplace"))
            sys.stdout.write(said.decode(errors="backslashreplace"))
        finding = _finding(process.exitcode, said, folder, before, arguments)
        return Outcome(process.exitcode, finding, arguments[0])
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _would_run(leader: int) -> bool:
    """Whether a thread of its session waits for a processor or a disk: on a busy machine it only is not done yet."""
    states = set()
    for path in Path("/proc").glob("[0-9]*/task/*/stat"):
        with contextlib.suppress(OSError):  # the thread has ended
            state, _, _, session = path.read_text().rpartition(")")[2].split()[:4]
            states |= {state} if int(session) == leader else set()
    return bool({"R", "D"} & states)


def _child(arguments: list[str], folder: Path) -> None:
    os.setsid()  # what it starts is known by the session
    resource.setrlimit(resource.RLIMIT_CPU, (CPU, CPU + 5))
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + MEMORY, used + MEMORY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    os.chdir(folder)
    for number, name in ((0, os.devnull), (1, ".stdout"), (2, ".stderr")):
        fd = os.open(name, os.O_RDWR | os.O_CREAT, 0o600)
        os.dup2(fd, number)
    sys.stdin = os.fdopen(0, encoding="utf-8", closefd=False)
    sys.stdout = os.fdopen(1, "w", encoding="utf-8", closefd=False)
    sys.stderr = os.fdopen(2, "w", encoding="utf-8", closefd=False)
    sys.argv = ["dsd", *arguments]
    from dsd_cli.cli.main import main as dsd

    dsd()


def _finding(code: int, said: bytes, folder: Path, before: set[str], arguments: list[str]) -> str:
    last = said.decode(errors="replace")[-300:].strip()
    if code not in (0, 1, 2, 3):
        return f"exit code {code}: {arguments}: {last}"
    if bad := BAD.search(said):
        return f"{bad[0].decode()}: {arguments}: {last}"
    begun = said.startswith(b"dsd: ") or arguments[:1] == ["fleet"] or _asks(said)  # which say what they take first
    if code in (1, 2) and not (begun and b"dsd: error: " in said):
        return f"no message with exit code {code}: {arguments}: {last}"
    named = arguments[1].encode() if len(arguments) > 1 and arguments[0] in ("init", "columns") else b""
    if code == 1 and named not in said:
        return f"a message without the name of the file: {arguments}: {last}"
    if RAW.search(said) or RAW.search((folder / ".stdout").read_bytes()):
        return f"a control character: {arguments}: {last!r}"
    left = {path.name for path in folder.iterdir()} - before - {".stdout", ".stderr", *OUTPUTS}
    if b"goes on from there" in said:
        left -= {"out.csv.part", "out.parquet.part"}
    if left:
        return f"left behind {sorted(left)}: {arguments}"
    if wrong := _wrong_output(code, folder, arguments):
        return f"{wrong}: {arguments}: {last}"
    return ""


def _asks(said: bytes) -> bool:
    """Whether `init` ends in its question, without a u or a motion to ask for, or with rows that cannot be read: what
    it found stands before it."""
    ends = (b": say it: dsd init ", b": its rows could not be read: ", b": this log has no ", b" or a motion does: ")
    return b"\ndsd: error: " in said and any(one in said.splitlines()[-1] for one in ends)


def _wrong_output(code: int, folder: Path, arguments: list[str]) -> str:
    """What is wrong with the files that a run has written."""
    from dsd_cli.errors import DsdError
    from dsd_cli.files.config import load_config

    written = {name: (folder / name).read_bytes() for name in OUTPUTS if (folder / name).exists()}
    fleet = arguments[:1] == ["fleet"]  # whose table says why there is no result
    marked = b"<- MISSING" in written.get("out.toml", b"")
    if code in (1, 2) and written and not (fleet or marked):
        return f"an output in spite of exit code {code}"
    if fleet and any(BAD.search(content) for content in written.values()):
        return "an unexpected reason"
    page = written.get("out.html", b"")
    if RAW.search(page) or fuzz_cases.MARKUP.encode() in page:
        return "markup of the log on the page"
    to = arguments[arguments.index("-o") + 1] if "-o" in arguments else ""
    if code == 0 and to.endswith(".toml"):
        try:
            load_config(folder / to)
        except DsdError as error:
            return f"a config that cannot be read ({error})"
    return ""
