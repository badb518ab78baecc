"""d_hat against u and the motion: scale, nominal inertia, time constant."""

from dataclasses import replace

import numpy as np
import pytest

from dsd_cli.identify.checks import check_log
from tests.identify.checks.rig import checked, log_of, observer_of, only_error, recordings, servo


def with_d_hat():
    return [r for r in recordings("motion") if "d_hat" in r.channels]


def test_a_right_d_hat_is_left_alone():
    assert len(with_d_hat()) > 10
    for recording in with_d_hat():
        assert [one.what for one in checked(recording).findings if one.severity != "note"] == []


@pytest.mark.parametrize("factor", [0.3, 2.0])
def test_a_wrong_nominal_inertia_is_named_with_the_right_one(factor):
    for recording in with_d_hat()[::4]:
        true = observer_of(recording)
        wrong = replace(true, nominal_inertia=factor * true.nominal_inertia)
        error = only_error(check_log(log_of(recording), None, wrong))
        key, _, value = error.remedy.partition(" = ")
        assert key == "observer.nominal_inertia"
        assert float(value) == pytest.approx(true.nominal_inertia, rel=0.03)


def test_a_d_hat_in_another_unit_than_u():
    error = only_error(checked(servo(), d_hat=2.5 * servo().channels["d_hat"]))
    assert error.what.startswith("d_hat is 2.5 times as large as u says")
    assert error.remedy.startswith('signals.d_hat = ""')


@pytest.mark.parametrize("factor", [0.2, 5.0])
def test_a_time_constant_that_is_far_off(factor):
    true = observer_of(servo())
    wrong = replace(true, time_constant=factor * true.time_constant)
    (one,) = [f for f in check_log(log_of(servo()), None, wrong).findings if f.severity != "note"]
    key, _, value = one.remedy.partition(" = ")
    assert (one.severity, key) == ("warning", "observer.time_constant")
    assert 0.5 < float(value) / true.time_constant < 2.0


def test_without_an_observer_or_a_motion_d_hat_is_not_judged():
    assert check_log(log_of(servo())).errors == ()
    noise = np.random.default_rng(0).normal(size=len(servo().channels["u"]))
    assert checked(servo(), d_hat=noise, velocity=None, position=None).errors == ()
