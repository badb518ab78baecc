"""Property tests draw the same examples in every run, so that red means a change; profile `random` draws new ones.

`python -m bench random` does so for many seeds, and prints the one that repeats a failure. How fast the machine is, is
no property of the code: no deadlines.

Linear algebra has one thread, as `dsd` asks for: the tests of each core have a worker of their own, and threads beside
them only wait for each other.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before anything loads NumPy

from hypothesis import HealthCheck, settings

settings.register_profile(
    "repeatable", derandomize=True, database=None, deadline=None, suppress_health_check=[HealthCheck.too_slow]
)
settings.register_profile("random", settings.get_profile("repeatable"), derandomize=False)
settings.load_profile("repeatable")
