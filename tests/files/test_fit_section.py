"""[fit] and the units and the window of [signals]: what is taken, and what is refused in one line."""

import math

import numpy as np
import pytest

from dsd_cli.errors import DataError, UsageError
from dsd_cli.files.config import parse_config
from dsd_cli.files.table_source import Batch
from dsd_cli.files.windowed import Window, windowed
from dsd_cli.plant.model import PlantModel

MODEL = PlantModel(0.4, 0.01, {"viscous_friction": {"coefficient": 0.3}})


def _known(text="", **told):
    return parse_config(text).knowing(**told).fit.known(MODEL, "dsd.toml")


def test_file_and_command_line_say_the_same():
    nested = "[fit]\nfix = { inertia = 0.35 }\nbounds = { viscous_friction = { coefficient = [0, 5] } }\n"
    nested += 'prior = { "coulomb_friction.level" = "0.15 +- 0.02" }\n'
    told = {
        "fix": ["inertia=0.35"],
        "bounds": ["viscous_friction.coefficient=:5"],
        "prior": ["coulomb_friction.level=0.15±0.02"],
    }
    for known in (_known(nested), _known(**told)):
        assert known.fixed == {"inertia": 0.35}
        assert known.bounds == {"viscous_friction.coefficient": (0.0, 5.0)}
        assert known.priors == {"coulomb_friction.level": (0.15, 0.02)}


def test_without_a_value_the_model_s_own_is_held():
    text = "[model.effects.viscous_friction]\ncoefficient = 0.3\n"
    assert _known(text, fix=["viscous_friction.coefficient"]).fixed == {"viscous_friction.coefficient": 0.3}
    with pytest.raises(UsageError, match=r"has no coulomb_friction\.level"):
        _known(fix=["coulomb_friction.level"])


def test_the_command_line_wins_over_the_file():
    known = _known('[fit]\nprior = { inertia = "0.3+-0.1" }\n', fix=["inertia=0.35"])
    assert (known.fixed, known.priors) == ({"inertia": 0.35}, {})


def test_hold_fixes_all_that_the_model_has():
    known = _known("[fit]\nhold = true\n")
    assert known.fixed == {"inertia": 0.4, "delay": 0.01, "viscous_friction.coefficient": 0.3}


@pytest.mark.parametrize(
    ("told", "word"),
    [
        ({"fix": ["inertai=1"]}, "did you mean inertia"),
        ({"fix": ["viscous_friction=1"]}, "viscous_friction.coefficient"),
        ({"fix": ["inertia=-1"]}, "above 0"),
        ({"fix": ["inertia=x"]}, "no number"),
        ({"bounds": ["inertia=1"]}, "LOW:HIGH"),
        ({"bounds": ["inertia=3:1"]}, "smaller number comes first"),
        ({"prior": ["inertia=1"]}, r"VALUE\+-SPREAD"),
        ({"prior": ["inertia=1+-0"]}, "standard deviation"),
        ({"fix": ["external_force.events=1"]}, "list"),
    ],
)
def test_what_cannot_be_is_refused(told, word):
    with pytest.raises(UsageError) as refused:
        parse_config("").knowing(**told)
    assert refused.match(word) or word in refused.value.hint or __import__("re").search(word, refused.value.hint)


def test_units_bring_their_factors_and_their_names():
    signals = parse_config('[signals]\nu_unit = "N m"\nposition_unit = "deg"\nvelocity_unit = "rpm"\n').signals
    assert signals.factors()["position"] == pytest.approx(math.pi / 180.0)
    assert signals.factors()["velocity"] == pytest.approx(2.0 * math.pi / 60.0)
    assert (signals.units.force, signals.units.of_position, signals.units.legend) == ("N m", "rad", "")
    assert signals.units.words("{u}/({v}/s)") == "kg m^2"
    counts = parse_config('[signals]\nposition_unit = "counts"\ncounts_per_turn = 4096\n').signals
    assert counts.factors()["position"] == pytest.approx(2.0 * math.pi / 4096)


@pytest.mark.parametrize(
    ("text", "channel"),
    [
        ("", "position"),
        ('position_unit = "unknown"\nvelocity_unit = "unknown"', "position"),
        ('velocity_unit = "unknown"', "velocity"),
        ('position_unit = "unknown"\nvelocity_unit = "counts/s"', "position"),
        ('position = ""', "velocity"),
    ],
)
def test_counts_to_a_turn_say_that_what_has_no_unit_is_in_counts(text: str, channel: str) -> None:
    signals = parse_config(f"[signals]\ncounts_per_turn = 4096\n{text}\n").signals
    assert signals.factors()[channel] == pytest.approx(2.0 * math.pi / 4096)
    assert not signals.units.assumed


@pytest.mark.parametrize(
    "text",
    [
        'position_unit = "deg"\nposition_scale = 2.0',
        'position_unit = "deg"\ncounts_per_turn = 2000',
        'position_unit = "rad"\nvelocity_unit = "rad/s"\ncounts_per_turn = 2000',
        'velocity_unit = "rpm"\nposition = ""\ncounts_per_turn = 2000',
        'position_unit = "counts"',
        'position_unit = "m"\nvelocity_unit = "rpm"',
        'position_unit = "furlong"',
        "start = 3.0\nend = 2.0",
    ],
)
def test_units_and_times_that_contradict_each_other_are_refused(text):
    with pytest.raises(UsageError):
        parse_config(f"[signals]\n{text}\n")


class _Table:
    name, metadata, warnings, unreadable = "log.csv", {}, [], 0
    columns = column_names = ("t", "u")

    def batches(self):
        for start in (0, 4):
            t = np.arange(start, start + 4, dtype=float)
            yield Batch(4, {"t": 1000.0 * t, "u": t})


def _read(window):
    return np.concatenate([b.columns["u"] for b in windowed(_Table(), window, 1e-3, None).batches()]).tolist()


def test_a_window_has_the_rows_within_and_its_rest_the_others():
    assert _read(Window(2.0, 5.0)) == [2.0, 3.0, 4.0, 5.0]
    assert _read(Window(2.0, 5.0).rest) == [0.0, 1.0, 6.0, 7.0]
    assert _read(Window(end=4.5)) == [0.0, 1.0, 2.0, 3.0, 4.0]
    assert _read(Window()) == list(range(8))
    with pytest.raises(DataError, match="no row from 9 s on"):
        _read(Window(9.0))
