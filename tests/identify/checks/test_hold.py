"""u held or sampled: told where a fast drive and a fine sensor show it, else not."""

from dataclasses import replace

import numpy as np
import pytest

from dsd_cli.identify.checks import check_log, to_mend_first
from dsd_cli.signals.log import Log
from tests.identify.checks.rig import recordings, said
from tests.oracle import resonator

T, J, ROWS, FINE = 0.001, 0.2, 8000, 20


def fast(held, source, delay=0.0023):
    """A bare inertia driven by noise up to 0.4 of the sample rate, integrated in steps of T/20."""
    rng = np.random.default_rng(3)
    t = np.arange(ROWS) * T
    fine = (np.arange(ROWS * FINE) + 0.5) * T / FINE - delay
    tones, phases = rng.uniform(2.0, 0.4 / T, 120), rng.uniform(0.0, 2.0 * np.pi, 120)

    def drive(at):
        return sum(np.sin(2.0 * np.pi * f * at + p) for f, p in zip(tones, phases, strict=True)) / 8.0

    acting = drive(np.floor(fine / T) * T) if held else drive(fine)
    velocity = np.concatenate([[0.0], np.cumsum(acting) * (T / FINE) / J])
    position = np.concatenate([[0.0], np.cumsum(0.5 * (velocity[1:] + velocity[:-1])) * (T / FINE)])
    measured = {"velocity": velocity, "position": position}[source][:-1:FINE]
    noise = 1e-3 * np.std(np.diff(measured, 1 + (source == "position"))) * rng.normal(size=ROWS)
    return Log({"t": t, "u": drive(t), source: measured + noise}, T)


@pytest.mark.parametrize("source", ["velocity", "position"])
@pytest.mark.parametrize("held", [True, False])
def test_each_kind_is_told_from_the_other(source, held):
    right, wrong = ("held", "sampled") if held else ("sampled", "held")
    log = fast(held, source)
    (one,) = said(check_log(replace(log, u_hold=wrong)), "u looks like")
    assert (one.severity, one.remedy) == ("warning", f'signals.u_hold = "{right}"')
    assert said(check_log(replace(log, u_hold=right)), "u looks like") == []


def test_where_it_cannot_be_told_nothing_is_said():
    for recording in recordings("motion")[::3]:
        log = Log(recording.channels, recording.truth.sample_time)
        assert said(check_log(log), "u looks like") == []
        assert said(check_log(replace(log, u_hold="sampled")), "u looks like") == []


def test_a_u_that_no_held_one_is_early_enough_for_was_sampled():
    """A spring takes most of u, and at a tenth of the sample rate the two kinds differ by half a sample alone."""
    sampled, held = (Log(resonator.swung(4, kind), resonator.T) for kind in (False, True))
    (one,) = to_mend_first(check_log(sampled))
    assert one.remedy == 'signals.u_hold = "sampled"'
    for log in (replace(sampled, u_hold="sampled"), held):
        assert said(check_log(log), "u looks like") == []
