"""Timing helpers: pairs are run in turn, so that a noisy machine disturbs both sides alike."""

from __future__ import annotations

import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True)
class Line:
    """One line of the result: what was measured, the ratio (or value), and what it should be."""

    what: str
    value: float
    target: float
    unit: str
    detail: str = ""
    at_least: bool = False

    @property
    def met(self) -> bool:
        return self.value >= self.target if self.at_least else self.value <= self.target

    def as_json(self) -> dict[str, Any]:
        return {**asdict(self), "met": self.met}


def seconds(action: Callable[[], Any]) -> float:
    begin = time.perf_counter()
    action()
    return time.perf_counter() - begin


def ratio(ours: Callable[[], Any], theirs: Callable[[], Any], repeats: int = 5) -> tuple[float, float, float]:
    """(ratio of the medians, our median, their median) of runs taken in turn, after one of each to warm up."""
    seconds(ours), seconds(theirs)
    pairs = [(seconds(ours), seconds(theirs)) for _ in range(repeats)]
    a, b = (statistics.median(side) for side in zip(*pairs, strict=True))
    return a / b, a, b


def run(*arguments: str) -> None:
    """A Python process that must succeed."""
    subprocess.run([sys.executable, *arguments], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def peak_memory(*arguments: str) -> float:
    """Peak resident memory of a Python process, MB."""
    # measured from a small parent: Linux counts the memory of the parent at the fork as the child's
    script = (
        "import resource, subprocess, sys; subprocess.run(sys.argv[1:], check=True, stdout=subprocess.DEVNULL);"
        "print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)"
    )
    command = [sys.executable, "-c", script, sys.executable, *arguments]
    return int(subprocess.run(command, check=True, capture_output=True, text=True).stdout) / 1024
