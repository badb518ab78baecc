"""Stamps: true, noisy, in another unit; rows that were not taken as they are."""

import re

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from dsd_cli.identify.checks import check_log
from dsd_cli.identify.checks.clock import check_rows, evened, jitter, seconds_of
from dsd_cli.signals.log import Log
from tests.identify.checks.rig import log_of, recordings, said, servo

T = 0.001


def jittered(t, share=0.2, seed=0):
    return t + np.random.default_rng(seed).uniform(-share, share, t.size) * T


@pytest.mark.parametrize("sensing", ["velocity", "position"])
def test_noisy_stamps_of_an_even_clock_are_told_from_uneven_samples(sensing):
    c = servo(sensing).channels
    t = jittered(c["t"])
    (noisy,) = said(check_log(log_of(servo(sensing), t=t)), "the stamps are noise")
    assert noisy.severity == "warning"
    assert noisy.remedy == 'signals.time = "" and signals.sample_time = 0.001'
    taken = {name: CubicSpline(c["t"], x)(t) for name, x in c.items() if name not in ("t", "u")}
    if "position" in taken:
        step = servo(sensing).truth.encoder_step
        taken["position"] = np.rint(taken["position"] / step) * step
    (true,) = said(check_log(log_of(servo(sensing), t=t, **taken)), "samples were taken at them")
    assert (true.severity, true.remedy) == ("note", "")


@pytest.mark.parametrize("share", [0.05, 0.3])
def test_a_log_that_was_stamped_late_is_put_on_its_even_clock(share):
    c = servo("velocity").channels
    found = evened(log_of(servo("velocity"), t=jittered(c["t"], share)), ())
    np.testing.assert_allclose(found["t"], c["t"], atol=share * T)
    assert np.ptp(np.diff(found["t"])) < 1e-9


def test_steps_that_add_up_are_no_noise_of_stamps():
    """However smooth the motion is over the rows: a clock whose steps wander leads away from an even one."""
    c = servo("velocity").channels
    steps = T * (1.0 + 0.2 * np.random.default_rng(7).standard_normal(c["t"].size))
    log = log_of(servo("velocity"), t=np.cumsum(steps))
    assert evened(log, ()) is log
    assert said(check_log(log), "the stamps are noise") == []


@pytest.mark.parametrize("lost", [0.01, 0.05])
def test_of_samples_that_are_missing_beside_noisy_stamps_no_even_clock_is_made(lost):
    c = servo("velocity").channels
    kept = np.random.default_rng(3).random(c["t"].size) >= lost
    log = Log({name: x[kept] for name, x in c.items()} | {"t": jittered(c["t"])[kept]}, T)
    (found,) = said(check_log(log), "the stamps are noise")
    assert int(found.what.split("and ")[-1].split(" ")[0]) == np.ptp(np.flatnonzero(kept)) + 1 - kept.sum()
    first, apart = map(float, re.findall(r"([-0-9.e]+) s\b", found.remedy))
    number = np.rint((log["t"] - first) / apart)
    assert np.array_equal(number - number[0], np.flatnonzero(kept) - np.flatnonzero(kept)[0])
    holed = evened(log, ())  # each hole where it was
    np.testing.assert_allclose(holed["t"], c["t"][kept], atol=0.2 * T)
    assert np.abs(np.diff(holed["t"]) / T - np.diff(np.flatnonzero(kept))).max() < 0.01


@pytest.mark.parametrize(("lost", "share"), [(4, 0.002), (4, 0.03), (60, 0.002)])
def test_few_samples_that_an_even_clock_lacks_are_counted_and_are_no_jitter(lost, share):
    """A stamp is good to 2 us, and four steps of two samples among thousands were "irregular, give or take 3 %"."""
    c = servo("velocity").channels
    kept = np.ones(c["t"].size, dtype=bool)
    kept[np.random.default_rng(11).choice(np.arange(50, kept.size - 50), lost, replace=False)] = False
    log = Log({name: x[kept] for name, x in c.items()} | {"t": jittered(c["t"], share)[kept]}, T)
    (found,) = [one for one in check_log(log).findings if one.channel == "t"]
    assert re.search(r"\b(\d+) sample", found.what)[1] == str(lost)
    assert ("irregular" in found.what) == (share > 0.02)
    assert "%" not in found.what or float(re.search(r"give or take (\d+) %", found.what)[1]) < 100.0 * 2.0 * share
    first, apart = map(float, re.findall(r"([-0-9.e]+) s\b", found.remedy))
    assert np.array_equal(np.diff(np.rint((log["t"] - first) / apart)), np.diff(np.flatnonzero(kept)))


def test_a_u_that_is_held_over_uneven_intervals_gives_the_inertia():
    """Exact: each u acts until the next stamp, on a bare inertia with a little viscous friction."""
    rng, J, B = np.random.default_rng(5), 0.3, 0.4
    dt = rng.uniform(0.6, 1.4, 8000) * T
    t = np.concatenate([[0.0], np.cumsum(dt)[:-1]])
    u = np.convolve(rng.normal(size=8000), np.ones(40) / 6.0, "same")
    velocity = np.zeros(8000)
    for k in range(7999):
        left = np.exp(-B / J * dt[k])
        velocity[k + 1] = left * velocity[k] + (1.0 - left) * u[k] / B
    result = check_log(Log({"t": t, "u": u, "velocity": velocity}, T))
    assert said(result, "samples were taken at them")
    inertia, delay = result.parameters
    assert inertia.value == pytest.approx(J, rel=0.01)
    assert abs(delay.value) < 0.2 * T


def test_where_the_encoder_hides_it_nothing_is_claimed():
    for recording in recordings("coarse")[::4]:
        c = recording.channels
        t = jittered(c["t"], 0.02)
        taken = CubicSpline(c["t"], c["position"])(t)
        step = recording.truth.encoder_step
        result = check_log(log_of(recording, t=t, position=np.rint(taken / step) * step))
        assert said(result, "the stamps are noise") == []


def test_a_log_is_as_long_as_its_stamps_say_and_not_as_its_rows_times_the_usual_step():
    t = np.cumsum(np.where(np.random.default_rng(8).random(20_544) < 0.022, 2.0, 1.0) * T)
    log = Log({"t": t, "u": t}, T)
    assert jitter(log, ())[0] == pytest.approx(T)
    assert seconds_of(log, ()) == pytest.approx(t[-1] - t[0], rel=1e-4)


def test_even_stamps_are_not_mentioned():
    assert [one for one in check_log(log_of(servo())).findings if one.channel == "t"] == []


def test_a_sample_time_that_no_servo_has():
    c = servo("position").channels
    result = check_log(Log({**c, "t": 1e3 * c["t"]}, 1.0))
    (one,) = said(result, "sample time")
    assert one.severity == "warning"
    assert 'signals.time_unit = "ms"' in one.remedy


def test_rows_that_were_not_taken_as_they_are():
    found = check_rows({"gap": 2, "not finite: velocity": 500, "jittered stamp": 9, "bridged": 3}, 6000)
    assert [(one.what.split()[0], one.severity) for one in found] == [("2", "note"), ("500", "warning"), ("3", "note")]
    assert "3 pieces" in found[0].what
    assert found[1].channel == "velocity"
    (beyond,) = check_rows({"beyond the range of the channel: u": 2}, 6000)
    assert (beyond.what, beyond.channel, beyond.severity) == ("2 row(s) beyond the range of u", "u", "note")


def test_a_log_of_pieces_is_judged_as_they_are():
    """Two recordings in one file; without the restart their seam would be a jump of the position."""
    a, b = servo("position"), recordings("coarse")[0]
    channels = {name: np.concatenate([a.channels[name], a.channels[name][1000:4000]]) for name in ("u", "position")}
    channels["t"] = np.concatenate([a.channels["t"], a.channels["t"][1000:4000]])
    cut = check_log(Log(channels, T), restarts=(len(a.channels["u"]),))
    whole = check_log(log_of(a))
    assert cut.errors == ()
    assert cut.band_hz == pytest.approx(whole.band_hz, rel=0.3)
    assert b.truth.sample_time == T


def test_steps_that_are_longer_by_no_whole_sample_lack_none():
    """Of steps of 1.0 and 1.2 ms: "and 228 samples are missing"; a sample that is lost makes a step of two."""
    rng = np.random.default_rng(11)
    t = np.concatenate([[0.0], np.cumsum(np.where(rng.random(19_999) < 0.11, 0.0012, 0.001))])
    log = Log({"t": t, "u": np.sin(3.0 * t), "position": np.sin(3.0 * t)}, 0.001)
    assert said(check_log(log), "missing") == []
