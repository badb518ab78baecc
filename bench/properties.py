"""`python -m bench random [--rounds N] [--seed N]`: the property tests on examples that no run has seen.

`make test` draws the same examples every time, so that red means a change. This is where others are looked for. Every
round is one seed for all property tests; a failure is printed with the command that repeats it.
"""

from __future__ import annotations

import argparse
import random
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).parents[1]
SEEDS = 2**32
#: pytest's exit code for "a test failed"; others say that it could not run.
FAILED = 1


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the rounds, go on after a failure, and exit with 1 if there was one."""
    options = _options(arguments)
    first = random.SystemRandom().randrange(SEEDS) if options.seed is None else options.seed
    failed = [seed for seed in range(first, first + options.rounds) if not _holds(seed, options.tests)]
    if failed:
        raise SystemExit(f"property tests failed in {len(failed)} of {options.rounds} rounds")


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m bench random", description=__doc__)
    parser.add_argument("--rounds", type=int, default=5, help="seeds, one after the other")
    parser.add_argument("--seed", type=int, help="the first of them, to repeat a failure; otherwise drawn")
    parser.add_argument("tests", nargs="*", default=["tests"], help="files or folders of tests")
    return parser.parse_args(arguments)


def _holds(seed: int, tests: Sequence[str]) -> bool:
    """Whether all property tests hold for the examples of `seed`.

    Raises
    ------
    SystemExit : the tests could not be run.
    """
    # the mark is set by hypothesis itself, on every test that draws
    choice = ["-m", "hypothesis", "-n", "2", "--hypothesis-profile=random", f"--hypothesis-seed={seed}"]
    command = [sys.executable, "-m", "pytest", *choice, *tests]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    if done.returncode not in (0, FAILED):
        raise SystemExit(done.stdout + done.stderr)
    print(f"property tests, seed {seed}: {done.stdout.strip().splitlines()[-1]}", flush=True)
    if done.returncode == FAILED:
        print(f"{done.stdout}repeat it: python -m bench random --rounds 1 --seed {seed}", flush=True)
    return done.returncode == 0
