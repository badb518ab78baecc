"""`dsd init --set` of what is known of the rig: keys of any depth."""

from pathlib import Path

import pytest

from dsd_cli.files.config import load_config
from tests.cli.rig import done, dsd, refused
from tests.files import strangers

AXIS = strangers.axis()


def log(folder: Path) -> None:
    strangers.text(folder, "a.csv", ["t,torque,position", *strangers.rows(AXIS, AXIS["t"], AXIS["u"], AXIS["q"])])


def test_a_force_that_is_known_is_written_into_the_model(tmp_path: Path) -> None:
    log(tmp_path)
    known = ("viscous_friction.coefficient=3", "stribeck_friction.excess=0.2", "stribeck_friction.velocity=0.1")
    said = [part for one in known for part in ("--set", f"model.effects.{one}")]
    done("init", "a.csv", *said, "--set", "model.inertia=2.5", "--set", "detector.transition.stay=0.95", cwd=tmp_path)
    config = load_config(tmp_path / "dsd.toml")
    assert config.model.inertia == 2.5
    assert {name: dict(one) for name, one in config.model.effects.items()} == {
        "viscous_friction": {"coefficient": 3.0},
        "stribeck_friction": {"excess": 0.2, "velocity": 0.1},
    }
    assert config.detector.transition.stay == 0.95
    assert config.signals.position == "position"
    assert "# nats: the last well-founded label" in (tmp_path / "dsd.toml").read_text("utf-8")


@pytest.mark.parametrize(
    ("key", "word"),
    [
        ("model.effects.viscous_friktion.coefficient=3", "viscous_friktion"),
        ("model.effects.viscous_friction.level=3", "level"),
        ("model.inertiae=3", "inertiae"),
        ("modell.inertia=3", "modell"),
        ("model=3", "SECTION.KEY=VALUE"),
    ],
)
def test_a_key_that_does_not_exist_is_refused_and_nothing_is_written(key: str, word: str, tmp_path: Path) -> None:
    log(tmp_path)
    refused(dsd("init", "a.csv", "--set", key, cwd=tmp_path), 2, word)
    assert not (tmp_path / "dsd.toml").exists()
