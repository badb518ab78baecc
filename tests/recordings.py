"""Where the real recordings are: DSD_RECORDINGS, or ../shared/recordings beside the project."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
#: The linear axis: its columns, and a bare mass.
EMPS_SIGNALS = """
[signals]
time = "t_s"
u = "force_N"
position = "position_m"
"""
EMPS = (
    EMPS_SIGNALS
    + """[observer]
nominal_inertia = 95
time_constant = 0.02
[model]
inertia = 95
"""
)


def recording(name: str) -> Path:
    """The file, or a skip that names it; a failure where DSD_REQUIRE_RECORDINGS=1 says that it must be there."""
    folder = Path(os.environ.get("DSD_RECORDINGS", "../shared/recordings"))
    path = (ROOT / folder / name).resolve()
    if not path.exists():
        if os.environ.get("DSD_REQUIRE_RECORDINGS") == "1":
            pytest.fail(f"real recording {name} is required and is not at {path}")
        pytest.skip(f"real recording {name} is not here (set DSD_RECORDINGS)")
    return path
