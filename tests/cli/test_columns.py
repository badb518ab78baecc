"""`dsd columns LOG`: every channel of a file of another tool, what it does and what it may be."""

import json
from pathlib import Path

import numpy as np
import pytest
import scipy.io

from tests.cli.rig import done, dsd, refused
from tests.files import strangers

AXIS = strangers.axis()


@pytest.mark.parametrize("name", ["short_names", "twincat", "wide", "records"])
def test_every_channel_is_listed_with_what_it_may_be(name: str, tmp_path: Path) -> None:
    make, u, motion = strangers.MADE[name]
    path = make(tmp_path, AXIS)
    found = json.loads(done("columns", path.name, "--format", "json", cwd=tmp_path).stdout)["columns"]
    roles = {one["name"]: one["role"] for one in found if one["role"]}
    assert (roles[u], roles[motion] in ("position", "velocity")) == ("u", True)
    one = next(one for one in found if one["name"] == u)
    assert (one["low"], one["high"]) == pytest.approx((AXIS["u"].min(), AXIS["u"].max()), abs=1e-5)
    assert one["first"] == pytest.approx(AXIS["u"][:3], abs=1e-5)
    assert (min(one["shape"]) >= 0.0, max(one["shape"]) <= 1.0, len(one["shape"])) == (True, True, 24)


def test_constants_and_booleans_are_no_channels_of_the_axis(tmp_path: Path) -> None:
    path = strangers.degrees(tmp_path, AXIS)
    shown = done("columns", path.name, cwd=tmp_path).stdout
    assert "(constant)" in shown or "(boolean)" in shown
    assert "velocity: vel_deg_per_s, by its name" in shown
    refused(dsd("columns", "none.csv", cwd=tmp_path), 1, "none.csv: no such file")


def test_a_log_from_a_pipe_has_its_name(tmp_path: Path) -> None:
    content = strangers.short_names(tmp_path, AXIS).read_text(encoding="utf-8")
    assert done("columns", "-", stdin=content, cwd=tmp_path).stdout.startswith("<stdin>: ")
    found = json.loads(done("columns", "-", "--format", "json", stdin=content, cwd=tmp_path).stdout)
    assert found["logs"] == ["<stdin>"]


def test_what_moves_with_a_clock_comes_first_and_constants_are_counted(tmp_path: Path) -> None:
    """A robot's parameters stand first in its file; the channel's number stays that of the file."""
    machine = {f"arm/inertia_{i}": np.eye(3)[0] * (i + 1.0) for i in range(9)}
    log = {f"rec/{name}": AXIS[key] for name, key in (("time", "t"), ("pos_deg", "q"), ("torque_nm", "u"))}
    scipy.io.savemat(tmp_path / "a.mat", _nested({**machine, **log}))
    listed = json.loads(done("columns", "a.mat", "--format", "json", cwd=tmp_path).stdout)["columns"]
    shown = done("columns", "a.mat", cwd=tmp_path).stdout.splitlines()
    names = [line.split()[1] for line in shown[2:] if line.split()[0].isdigit()]
    assert set(names[:3]) == set(log)
    assert len(names) == 8
    assert "and 4 more constants: --format json lists all of them" in shown
    number = next(int(line.split()[0]) for line in shown[2:] if "rec/torque_nm" in line)
    assert listed[number - 1]["name"] == "rec/torque_nm"


def _nested(channels: dict[str, np.ndarray]) -> dict[str, dict[str, np.ndarray]]:
    """MAT structs by the names before the slash."""
    found: dict[str, dict[str, np.ndarray]] = {}
    for name, x in channels.items():
        group, _, last = name.partition("/")
        found.setdefault(group, {})[last] = x
    return found
