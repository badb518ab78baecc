"""`dsd columns LOG`: every channel of a file of another tool, what it does and what it may be."""

import json
from pathlib import Path

import pytest

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
