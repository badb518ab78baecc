"""A log that is written faster than its sensors are read, made here by writing old values again."""

import numpy as np
import pytest

from dsd_cli.signals.log import Log
from dsd_cli.signals.updates import SUMMED, rows_of_u, summed, updated

ROWS, STEP = 4000, 0.001


def motion(seed: int = 3) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """t, position and speed of moves to and fro, exact, with rests between."""
    rng = np.random.default_rng(seed)
    t = STEP * np.arange(ROWS)
    speed = np.sin(2.0 * np.pi * t * rng.uniform(0.6, 0.9)) * 3.0
    speed = np.where(np.abs(speed) < 0.6, 0.0, speed)
    return t, np.cumsum(speed) * STEP, speed


def counted(x: np.ndarray, counts: int) -> np.ndarray:
    return np.round(x * counts / (2.0 * np.pi)) * 2.0 * np.pi / counts


def written_again(x: np.ndarray, at: np.ndarray) -> np.ndarray:
    """The value of the last of the rows `at`, in every row."""
    return np.array([x[at[at <= k][-1]] for k in range(x.size)])


def log_of(**channels: np.ndarray) -> Log:
    return Log(channels, STEP)


def test_only_rows_with_news_are_taken_and_u_is_its_mean_between_them():
    t, q, v = motion()
    at = np.arange(0, ROWS, 5)
    u = np.random.default_rng(1).normal(size=ROWS)
    noisy = v + np.random.default_rng(2).normal(scale=0.01, size=ROWS)
    found = updated(log_of(t=t, u=u, position=written_again(q, at), velocity=written_again(noisy, at)))
    assert "repeat each value for 5 rows" in found.said
    assert found.log.sample_time == pytest.approx(0.005)
    np.testing.assert_allclose(found.log["t"], t[at], atol=1e-12)
    np.testing.assert_allclose(found.log["velocity"], noisy[at], atol=1e-12)
    np.testing.assert_allclose(found.log["u"], u.reshape(-1, 5).mean(axis=1), atol=1e-12)


def test_a_pace_that_varies_and_rests_in_which_nothing_is_new():
    t, q, _ = motion()
    at = np.cumsum(np.random.default_rng(5).integers(2, 6, size=ROWS))
    at = np.concatenate([[0], at[at < ROWS]])
    position = written_again(counted(q, 400_000), at)
    found = updated(log_of(t=t, u=np.ones(ROWS), position=position))
    moves = np.flatnonzero(np.diff(position)) + 1
    assert set(moves) <= set(np.rint(found.log["t"] / STEP).astype(int))  # every new value is there
    assert np.diff(found.log["t"]).max() < 0.008  # rests are not holes
    assert 2.0 <= ROWS / len(found.log) <= 5.0  # no faster than the sensor, no slower


@pytest.mark.parametrize("counts", [1000, 4096, 40_000])
def test_an_encoder_that_stands_still_between_counts_is_left_as_it_is(counts):
    t, q, v = motion()
    log = log_of(t=t, u=v, position=counted(q, counts))
    assert updated(log).said == ""
    assert updated(log).log is log


@pytest.mark.parametrize("steps", [0.5, 1.0, 3.0, 10.0])
def test_noise_that_happens_to_repeat_is_left_as_it_is(steps):
    """A speed in whole rpm with noise of so many of them."""
    t, _, v = motion()
    rpm = 2.0 * np.pi / 60.0
    noisy = np.round(v / rpm + np.random.default_rng(8).normal(scale=steps, size=ROWS)) * rpm
    assert updated(log_of(t=t, u=v, velocity=noisy)).said == ""


def test_a_slow_speed_is_left_out_beside_a_position_that_is_read_in_every_row():
    t, q, v = motion()
    slow = written_again(v + np.random.default_rng(2).normal(scale=0.01, size=ROWS), np.arange(0, ROWS, 20))
    found = updated(log_of(t=t, u=v, position=counted(q, 400_000), velocity=slow))
    assert "velocity repeats each value for 20 rows" in found.said
    assert "velocity" not in found.log
    assert len(found.log) == ROWS


def test_a_steady_position_comes_with_the_speed_that_a_bus_brings():
    """All its steps are alike, as of an encoder that stands for 14 rows between two counts."""
    t = STEP * np.arange(ROWS)
    at = np.arange(0, ROWS, 14)
    speed = 5.0 + np.random.default_rng(2).normal(scale=0.2, size=ROWS)
    found = updated(log_of(t=t, u=t, position=written_again(5.0 * t, at), velocity=written_again(speed, at)))
    np.testing.assert_allclose(found.log["t"], t[at], atol=1e-12)
    np.testing.assert_allclose(found.log["position"], 5.0 * t[at], atol=1e-9)
    np.testing.assert_allclose(found.log["velocity"], speed[at], atol=1e-12)


def test_pieces_begin_where_they_began():
    t, q, v = motion()
    at = np.concatenate([np.arange(0, 1502, 4), np.arange(1502, ROWS, 4)])
    noisy = v + np.random.default_rng(2).normal(scale=0.01, size=ROWS)
    found = updated(log_of(t=t, u=v, velocity=written_again(noisy, at), position=written_again(q, at)), [1502])
    (begins,) = found.restarts
    assert found.log["t"][begins] == pytest.approx(t[1502])


def test_stamps_that_begin_again_do_not_mix_the_pieces():
    t, q, _ = motion()
    half, at = ROWS // 2, np.arange(0, ROWS, 5)
    again = np.concatenate([t[:half], t[: ROWS - half]])
    u = np.random.default_rng(1).normal(size=ROWS)
    place = np.concatenate([q[:half], q[half:] + 3.0])
    found = updated(log_of(t=again, u=u, position=written_again(place, at)), [half])
    np.testing.assert_allclose(found.log["position"], place[at], atol=1e-12)
    np.testing.assert_allclose(found.log["u"], u.reshape(-1, 5).mean(axis=1), atol=1e-9)
    assert found.restarts == (half // 5,)


def test_of_many_short_pieces_the_sample_time_is_that_within_them():
    """Pairs of rows, each of a time that begins again."""
    t, q, v = motion()
    again = np.where(np.arange(ROWS) % 10 < 5, 0.0, 0.005) + (t % 0.005)
    noisy = v + np.random.default_rng(2).normal(scale=0.01, size=ROWS)
    channels = {"position": written_again(q, np.arange(0, ROWS, 5)), "velocity": noisy}
    channels["velocity"] = written_again(noisy, np.arange(0, ROWS, 5))
    found = updated(log_of(t=again, u=v, **channels), list(range(10, ROWS, 10)))
    assert found.log.sample_time == pytest.approx(0.005)


def test_a_slow_position_beside_a_live_speed_keeps_its_zero():
    t, q, v = motion()
    noisy = v + np.random.default_rng(2).normal(scale=1e-4, size=ROWS)
    position = written_again(q + 2.0, np.arange(0, ROWS, 20))
    found = updated(log_of(t=t, u=v, velocity=noisy, position=position))
    assert "position goes as the speed between its values" in found.said
    np.testing.assert_allclose(found.log["position"], q + 2.0, atol=2e-3)  # held it lags by up to 0.06
    assert len(found.log) == ROWS


def test_of_a_few_values_that_stay_no_number_of_rows_is_said():
    t, _, v = motion()
    noisy = v + np.random.default_rng(2).normal(scale=0.01, size=ROWS)
    comes = np.flatnonzero(np.random.default_rng(3).random(ROWS) > 0.25)
    found = updated(log_of(t=t, u=v, velocity=written_again(noisy, np.union1d([0], comes))))
    assert found.said.startswith("velocity repeats some of the values while the axis moves: only rows with new ones")
    beside = updated(log_of(t=t, u=v, velocity=written_again(noisy, np.union1d([0], comes)), position=counted(v, 4000)))
    assert beside.said.endswith("while the axis moves: they are put between their neighbours")
    assert len(beside.log) == ROWS


def test_a_drives_own_d_hat_in_every_row_stays_beside_a_slow_position():
    t, q, v = motion()
    d_hat = np.random.default_rng(4).normal(size=ROWS)
    log = log_of(t=t, u=v, d_hat=d_hat, position=written_again(q, np.arange(0, ROWS, 5)))
    assert updated(log).log is log


def test_an_axis_that_never_moves_says_nothing():
    log = log_of(t=STEP * np.arange(ROWS), u=np.ones(ROWS), position=np.zeros(ROWS))
    assert updated(log).said == ""


@pytest.mark.parametrize("counts", [1000, 4096, 40_000])
def test_a_speed_that_is_the_difference_of_counts_is_summed(counts):
    t = STEP * np.arange(ROWS)
    v = 3.0 * np.sin(2.0 * np.pi * np.random.default_rng(3).uniform(0.6, 0.9) * t)  # as smooth as an axis moves
    position = counted(np.cumsum(v) * STEP, counts)
    speed = np.diff(position, prepend=position[:1]) / STEP
    found = summed(log_of(t=t, u=v, velocity=speed))
    np.testing.assert_allclose(found.log["position"], position - position[0], atol=1e-9)
    assert "velocity" not in found.log
    assert found.log.metadata[SUMMED] == "velocity"
    assert "noise of a difference" in found.said


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("noise", [0.0, 1e-3, 0.05])
def test_a_speed_of_its_own_sensor_stays(seed, noise):
    t, _, v = motion(seed)
    white = noise * np.random.default_rng(seed).normal(size=ROWS)
    log = log_of(t=t, u=v, velocity=v + white)
    assert summed(log).log is log


@pytest.mark.parametrize("hz", [300.0, 437.0])
def test_ripple_and_resonances_of_a_speed_are_no_difference_of_counts(hz):
    t, _, v = motion()
    ripple = 0.02 * np.sin(2.0 * np.pi * hz * t) * (1.0 + np.abs(v))
    log = log_of(t=t, u=v, velocity=v + ripple + np.random.default_rng(6).normal(scale=1e-4, size=ROWS))
    assert summed(log).log is log


@pytest.mark.parametrize("noise", [0.0, 0.7])
def test_a_speed_in_whole_steps_of_its_own_is_no_difference_of_counts(noise):
    """In whole rpm, exact or with noise of so many: what it is rounded by does not come back in the next row."""
    t, _, v = motion()
    rpm = 2.0 * np.pi / 60.0
    whole = np.round(v / rpm + np.random.default_rng(3).normal(scale=noise, size=ROWS)) * rpm
    log = log_of(t=t, u=v, velocity=whole)
    assert summed(log).log is log


def test_over_uneven_stamps_nothing_is_summed():
    _, q, v = motion()
    t = np.cumsum(STEP * (1.0 + 0.2 * np.random.default_rng(4).standard_normal(ROWS)))
    log = log_of(t=t, u=v, velocity=np.diff(counted(q, 4096), prepend=0.0) / STEP)
    assert summed(log).log is log


def test_beside_a_position_or_a_drives_d_hat_nothing_is_summed():
    t, q, v = motion()
    speed = np.diff(counted(q, 4096), prepend=0.0) / STEP
    for other in ({"position": q}, {"d_hat": v}):
        log = log_of(t=t, u=v, velocity=speed, **other)
        assert summed(log).log is log


def test_u_of_a_piece_that_begins_between_two_values_is_of_none_before_it():
    """Its first rows repeat what was read before it began: their u is in no mean, of the piece before neither."""
    t, q, v = motion()
    at, begins = np.arange(0, ROWS, 5), 2003
    u = np.where(np.arange(ROWS) < begins, 1.0, 7.0)
    u[begins : begins + 2] = 100.0
    found = updated(log_of(t=t, u=u, position=written_again(q, at), velocity=written_again(v, at)), (begins,))
    assert found.restarts == (401,)
    np.testing.assert_allclose(found.log["t"][401], t[2005], atol=1e-12)
    assert set(np.round(found.log["u"], 9)) == {1.0, 7.0}


@pytest.mark.parametrize("each", [1, 2, 4])
@pytest.mark.parametrize("late", [0, 1])
def test_a_slower_clock_of_u_is_seen(each: int, late: int) -> None:
    u = np.sin(0.013 * np.arange(ROWS)) + 0.3 * np.sin(0.11 * np.arange(ROWS))
    slower = np.repeat(u[::each], each)[late:]
    assert rows_of_u(slower) == each
    assert rows_of_u(np.delete(slower, 7)) == each
    slower[[8, 9]] = np.nan
    assert rows_of_u(slower) == each


def test_steps_of_a_test_and_what_is_rounded_are_no_clock_of_u() -> None:
    rng = np.random.default_rng(11)
    square = np.where(np.arange(ROWS) // 50 % 2, 1.0, -1.0)
    steps = np.repeat(rng.normal(size=80), rng.integers(20, 80, 80))
    rounded = np.round(np.sin(0.013 * np.arange(ROWS)), 2)
    assert [rows_of_u(u) for u in (square, steps, rounded, np.zeros(ROWS))] == [1, 1, 1, 1]
