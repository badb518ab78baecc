"""`dsd init` on a position in counts of an encoder, of which the user says how many there are to a turn."""

from pathlib import Path

import numpy as np
import pytest

from dsd_cli.files.config import load_config
from tests.cli.rig import done, dsd, refused
from tests.files import strangers

AXIS = strangers.axis()


def write(folder: Path, names: str, *columns: object) -> None:
    strangers.text(folder, "a.csv", [names, *strangers.rows(AXIS, *columns)])


@pytest.mark.parametrize("name", ["counts", "encoder_counts", "pos"])
def test_counts_per_turn_say_that_the_position_is_in_counts(name: str, tmp_path: Path) -> None:
    write(tmp_path, f"t,torque,{name}", AXIS["t"], AXIS["u"], np.round(AXIS["q"] / (2.0 * np.pi) * 20000.0))
    said = done("init", "a.csv", "--set", "signals.counts_per_turn=20000", cwd=tmp_path).stderr
    config = load_config(tmp_path / "dsd.toml")
    assert (config.signals.position, config.signals.position_unit) == (name, "counts")
    assert config.signals.factors()["position"] == pytest.approx(2.0 * np.pi / 20000.0)
    assert config.model.inertia == pytest.approx(2.0, rel=0.05)
    assert "it is taken as" not in said


def test_a_column_called_counts_is_asked_how_many_there_are(tmp_path: Path) -> None:
    write(tmp_path, "t,torque,counts", AXIS["t"], AXIS["u"], np.round(AXIS["q"] / (2.0 * np.pi) * 20000.0))
    said = done("init", "a.csv", cwd=tmp_path).stderr
    assert 'the unit of "counts" is counts' in said
    assert "counts_per_turn" in said


def test_counts_per_turn_of_a_column_in_degrees_are_a_contradiction(tmp_path: Path) -> None:
    write(tmp_path, "t,torque,angle_deg", AXIS["t"], AXIS["u"], AXIS["q"])
    result = dsd("init", "a.csv", "--set", "signals.counts_per_turn=2000", cwd=tmp_path)
    refused(result, 2, "counts_per_turn", "deg")
