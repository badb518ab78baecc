"""How often the +- of a fit holds the truth, on logs of the outside rig; `python -m bench coverage` has many more."""

import numpy as np
import pytest

from bench.coverage import deviations, table
from bench.paired import all_tiers
from bench.values import asked, sigmas

SEEDS = range(40, 46)
SENSINGS = ("speed40k", "enc4096")


@pytest.fixture(scope="module")
def found():
    return [d for sensing in SENSINGS for seed in SEEDS for d in deviations(seed, sensing)]


@pytest.mark.parametrize("help_", ["nothing known", "J held", "J with a prior"])
def test_the_intervals_hold_the_truth(found, help_):
    """Of 12 logs fewer than 9 inside would happen once in 5000 times at 95 %; a bias of 2 sigma leaves about 6."""
    names = {d.name for d in found if (d.help == help_ and "friction" in d.name) or d.name in ("inertia", "delay")}
    for name in names:
        own = [d for d in found if (d.help, d.name) == (help_, name)]
        assert len(own) in (0, len(SEEDS) * len(SENSINGS)), name
        if own:
            assert sum(d.inside for d in own) >= 9, name
            assert abs(np.mean([d.sigma for d in own])) < 1.2, name


def test_a_held_value_has_no_deviation(found):
    assert not [d for d in found if d.help == "J held" and d.name == "inertia"]


def test_the_table_has_a_line_for_every_value(found):
    lines = list(table(found))
    assert len(lines) == len({(d.help, d.name) for d in found})
    assert all("%" in line for line in lines)


@pytest.mark.parametrize(
    ("tier", "seed", "was"),
    [
        (
            "crawl through cogging",
            300001,
            "a smoothed position leant on inertia and delay, 3.4 and 3.9 standard errors",
        ),
        ("crawl through cogging", 300006, "the same"),
        ("geared joint, friction believed", 300001, "rests pulled the delay to whole samples, noise of u: 9.6"),
        (
            "speed and 40,000 counts",
            300000,
            "the lag was known as well as its last bracket is wide, its error ten times",
        ),
    ],
)
def test_values_that_leant_are_within_their_errors(tier, seed, was):
    (drawn,) = (t for t in all_tiers(None) if t.name == tier)
    row = asked(tier, seed, drawn.draw(seed))
    assert max(abs(z) for _, z, _ in sigmas([row])) < 2.6, was
