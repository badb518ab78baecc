"""Property tests draw the same examples in every run, so that red means a change; profile `random` draws new ones.

`python -m bench random` does so for many seeds, and prints the one that repeats a failure. How fast the machine is, is
no property of the code: no deadlines.

Linear algebra has one thread, as `dsd` asks for: the tests of each core have a worker of their own, and threads beside
them only wait for each other.
"""

import os
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before anything loads NumPy

import pytest
from hypothesis import HealthCheck, settings

settings.register_profile(
    "repeatable", derandomize=True, database=None, deadline=None, suppress_health_check=[HealthCheck.too_slow]
)
settings.register_profile("random", settings.get_profile("repeatable"), derandomize=False)
settings.load_profile("repeatable")


#: Tests that `make bench` runs alone.
STUDY = Path(__file__).with_name("study.txt")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config, items):
    """Marks what STUDY lists; a line that fits no test of a file that was collected whole is an error."""
    listed = [line for line in STUDY.read_text().splitlines() if not line.startswith("#")]
    found = {line: [item for item in items if item.nodeid.startswith(line)] for line in listed}
    whole = set() if any("::" in a for a in config.args) else {item.nodeid.partition("::")[0] for item in items}
    if lost := [line for line, its in found.items() if not its and line.partition("::")[0] in whole]:
        raise pytest.UsageError(f"{STUDY.name} lists what no test is called: {lost}")
    for its in found.values():
        for item in its:
            item.add_marker(pytest.mark.study)
