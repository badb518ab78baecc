"""Runs commands of one checkout of `dsd`, each in a process forked from one that has loaded the libraries.

Started by bench/engines.py with the interpreter of that checkout: `python engine_server.py ROOT`. Nothing but the
standard library and `dsd_cli` of ROOT is needed, so any version of the tool can be asked. Standard input has one JSON
line per command, {"argv", "cwd", "limit"}; standard output one per answer, {"code", "seconds", "out", "err"}: seconds
are CPU of that command alone, code is negative if it was ended (limit : s of CPU).
"""

import json
import os
import resource
import sys
import tempfile
from importlib import import_module

#: What `diagnose` and `improve` load when they need it.
LATE = ("pyarrow.parquet", "scipy.linalg", "scipy.signal", "scipy.special", "scipy.optimize", "rich.table")


def answer(job: dict) -> dict:
    """One command, in a child."""
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
        child = os.fork()
        if not child:
            _run(job, out.fileno(), err.fileno())
        _, status, used = os.wait4(child, 0)
        texts = []
        for stream in (out, err):
            stream.seek(0)
            texts.append(stream.read().decode("utf-8", "replace"))
    code = os.waitstatus_to_exitcode(status)
    return {"code": code, "seconds": used.ru_utime + used.ru_stime, "out": texts[0], "err": texts[1]}


def _run(job: dict, out: int, err: int) -> None:
    resource.setrlimit(resource.RLIMIT_CPU, (int(job["limit"]), int(job["limit"]) + 5))
    os.chdir(job["cwd"])
    os.dup2(out, 1), os.dup2(err, 2)
    sys.argv = ["dsd", *job["argv"]]
    code = 1
    try:
        import_module("dsd_cli.__main__").main()
    except SystemExit as leaving:
        code = leaving.code if isinstance(leaving.code, int) else 1
    except BaseException as error:
        os.write(2, f"{type(error).__name__}: {error}\n".encode())
    os._exit(code)


def main() -> None:
    root = os.path.realpath(sys.argv[1])
    sys.path[0] = root
    package = import_module("dsd_cli")
    if not os.path.realpath(str(package.__file__)).startswith(root + os.sep):
        sys.exit(f"dsd_cli is loaded from {package.__file__}, not from {root}")
    for name in ("dsd_cli.cli.improve", "dsd_cli.cli.diagnose", "dsd_cli.cli.main", *LATE):
        try:
            import_module(name)
        except ImportError:  # another version may have it elsewhere
            continue
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    for line in sys.stdin:
        answers.write(json.dumps(answer(json.loads(line))) + "\n")
        answers.flush()


if __name__ == "__main__":
    main()
