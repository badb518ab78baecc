"""`external_force.events`: a list of tables in the config, each entry checked; not on one line of `--effect`."""

import pytest

from dsd_cli.errors import UsageError
from dsd_cli.files.config.effect_values import effect_values
from dsd_cli.files.config.overrides import with_effects, with_values
from dsd_cli.files.config.rules import Place

AT = Place("dsd.toml", "model.effects")
GOOD = {"start": 1, "end": 1.5, "force": -0.4}


def read(events, axes=False):
    return effect_values(axes).read({"external_force": {"events": events}}, AT)["external_force"]["events"]


def test_events_are_read():
    assert [dict(event) for event in read([GOOD, GOOD])] == [GOOD, GOOD]
    assert read([]) == ()


@pytest.mark.parametrize(
    ("events", "said"),
    [
        (3, r"events = 3: must be a list of tables such as"),
        ([3], r"events\[0\] = 3: must be a table such as"),
        ([GOOD, {"start": 1, "end": 2}], r"events\[1\]\] force is missing"),
        ([GOOD | {"froce": 1}], r"unknown key .*events\[0\]\.froce: did you mean force"),
        ([GOOD | {"force": "x"}], r"events\[0\]\.force = \"x\""),
        ([GOOD | {"end": float("inf")}], r"events\[0\]\.end = inf"),
        ([GOOD | {"end": 1}], r"events\[0\]\.end = 1: must be after start = 1"),
    ],
)
def test_mistakes_name_the_entry(events, said):
    with pytest.raises(UsageError, match=said):
        read(events)


def test_events_are_no_axis():
    with pytest.raises(UsageError, match="cannot be an axis"):
        read([GOOD], axes=True)


def test_effect_option_points_to_set():
    with pytest.raises(UsageError, match=r"--set 'model\.effects\.external_force\.events=\[\.\.\.\]'"):
        with_effects({}, ["external_force:events=[{start=0,end=1,force=2}]"])
    tables = with_values({}, ["model.effects.external_force.events=[{start=0,end=1,force=2}]"])
    assert tables["model"]["effects"]["external_force"]["events"] == [{"start": 0, "end": 1, "force": 2}]
