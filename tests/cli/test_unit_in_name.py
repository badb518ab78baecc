"""A column whose name says a unit that the config leaves out: `dsd detect` says so, once."""

from pathlib import Path

import pytest

from tests.cli.rig import CONFIG, done, make_log, write

SAID = (
    'signals.velocity = "speed_rpm" reads like rpm, and is taken as rad/s: set signals.velocity_unit = "rpm", '
    'or "rad/s" if it is'
)


@pytest.fixture
def rig(tmp_path: Path) -> Path:
    log = make_log(400)
    write(tmp_path, "log.csv", {"t": log["t"], "u": log["u"], "speed_rpm": log["u"]})
    named = '[signals]\ntime = "t"\nu = "u"\nd_hat = ""\nvelocity = "speed_rpm"\n'
    (tmp_path / "dsd.toml").write_text(named + CONFIG)
    return tmp_path


def test_detect_says_which_unit_a_name_has_that_the_config_leaves_out(rig: Path) -> None:
    warnings = done("detect", "log.csv", "-o", "labels.csv", cwd=rig).stderr
    assert " ".join(warnings.split()).count(SAID) == 1


@pytest.mark.parametrize("said", ["velocity_unit=rpm", "velocity_unit=rad/s", "velocity_scale=0.5"])
def test_who_says_it_is_not_asked(rig: Path, said: str) -> None:
    assert "reads like" not in done("detect", "log.csv", "-o", "labels.csv", "--set", f"signals.{said}", cwd=rig).stderr
