"""Lines of names with values: units right behind these or behind a blank, and names that are called as units are."""

from pathlib import Path

import numpy as np
import pytest

from dsd_cli.files.sample import sample


@pytest.mark.parametrize(
    ("line", "units"),
    [
        ("(17.{k:03d}) can0 Drive(Torque: {u:.3f} Nm, Speed: {v:.2f} rpm, Angle: {q:.2f} deg)", ["Nm", "rpm", "deg"]),
        ("tau={u:.3f}Nm w={v:.2f} q={q:.2f} rad", ["Nm", "", "rad"]),
        ("tau: {u:.3f} A: {v:.2f} m = {q:.2f}", ["", "", ""]),
    ],
)
def test_a_unit_may_stand_behind_a_blank(line: str, units: list[str], tmp_path: Path) -> None:
    rows = [line.format(k=k, u=np.sin(k), v=2.0 * k, q=k**2) for k in range(60)]
    (tmp_path / "log.txt").write_text("\n".join(rows) + "\n", encoding="utf-8")
    (table,) = sample(str(tmp_path / "log.txt")).tables
    channels = [one for one in table.channels if one.name != "time"]
    assert [one.unit for one in channels] == units
    np.testing.assert_allclose(channels[1].values, 2.0 * np.arange(60))


@pytest.mark.parametrize("stamp", ["[{t:10.3f}] INFO ctrl:", "[{t:.3f}]", "[I][{t:.3f}]"])
def test_a_line_may_begin_with_its_stamp_in_brackets(stamp: str, tmp_path: Path) -> None:
    """As kernels and firmware print it; "is not JSON" was said of it."""
    t = 0.01 * np.arange(60)
    rows = [f"{stamp.format(t=at)} pos={np.sin(at):.6f} pwm={np.cos(at):.6f}" for at in t]
    (tmp_path / "firmware.log").write_text("\n".join(rows) + "\n", encoding="utf-8")
    (table,) = sample(str(tmp_path / "firmware.log")).tables
    values = {one.name: one.values for one in table.channels}
    assert list(values) == ["time", "pos", "pwm"]
    np.testing.assert_allclose(values["time"], t, atol=1e-9)
