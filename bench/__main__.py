"""`python -m bench [--rows N] [--repeats N]`: a table on stdout, and bench/results/latest.json.

`python -m bench hidden` is the study of hidden effects, see bench/hidden.py, `python -m bench outside` that on the
logs of another laboratory, see bench/outside.py; `python -m bench paired` asks several versions the same logs, see
bench/paired.py; `python -m bench random` runs the property
tests on new examples, see bench/properties.py; `python -m bench fuzz` looks for input that breaks the commands, see
bench/fuzz.py; `python -m bench kills` ends them by signals, see bench/fuzz_kills.py;
`python -m bench learn` asks what is learnt of laws that no catalogue has, see bench/learn.py, `python -m
bench learn-nothing` what is made of logs in which nothing is missing;
`python -m bench coverage` counts how often standard errors hold the truth, see bench/coverage.py, `python -m bench
values` the same on axes of many kinds, see bench/values.py;
`python -m bench longlog` labels a day at 10 kHz, see bench/longlog.py; `python -m bench fleet`
runs over many logs, see bench/fleet.py; `python -m bench.beyond` makes the tables of docs/how/beyond.md, its item
`cost` what method "profile" takes.
"""

from __future__ import annotations

import argparse
import json
import platform
import sys
import tempfile
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

from bench import files, kernel, start
from bench.measure import Line
from dsd_cli.detect.kernel import active_backend

RESULTS = Path(__file__).parent / "results" / "latest.json"


#: First argument -> module of the study, each with a `main(arguments)`.
STUDIES = {
    "hidden": "hidden",
    "learn": "learn",
    "learn-machines": "learn_machines",
    "learn-nothing": "learn_nothing",
    "outside": "outside",
    "plan": "plan",
    "paired": "paired",
    "machines": "machines",
    "random": "properties",
    "coverage": "coverage",
    "values": "values",
    "fleet": "fleet",
    "longlog": "longlog",
    "fuzz": "fuzz",
    "kills": "fuzz_kills",
}


def measured(folder: Path, rows: int, repeats: int) -> Iterator[Line]:
    """Every line of the benchmark, as it is measured."""
    yield from start.lines(folder, 4 * repeats)
    yield from kernel.lines(min(rows, 1_000_000), 2 * repeats)
    yield from kernel.peers(min(rows, 1_000_000))
    yield from files.lines(folder, rows, repeats)


def main() -> None:
    if sys.argv[1:2] and sys.argv[1] in STUDIES:
        import_module(f"bench.{STUDIES[sys.argv[1]]}").main(sys.argv[2:])
        return
    parser = argparse.ArgumentParser(prog="python -m bench")
    parser.add_argument("--rows", type=int, default=10_000_000)
    parser.add_argument("--repeats", type=int, default=5)
    options = parser.parse_args()
    print(f"kernel: {active_backend()}, Python {platform.python_version()}, {platform.machine()}")
    found = []
    with tempfile.TemporaryDirectory(prefix="dsd-bench-") as folder:
        for line in measured(Path(folder), options.rows, options.repeats):
            sign, verdict = (">=" if line.at_least else "<="), ("ok" if line.met else "MISSED")
            value = f"{line.value:,.2f} {line.unit}"
            print(f"{line.what:<72} {value:>16}  ({sign} {line.target:g}) {verdict:<7}{line.detail}", flush=True)
            found.append(line)
    RESULTS.parent.mkdir(exist_ok=True)
    RESULTS.write_text(json.dumps({"schema_version": 1, "lines": [line.as_json() for line in found]}, indent=1) + "\n")
    print(f"written: {RESULTS.relative_to(Path.cwd()) if RESULTS.is_relative_to(Path.cwd()) else RESULTS}")


if __name__ == "__main__":
    main()
