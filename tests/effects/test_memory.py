"""Effects with memory against integrators of scipy, and the compiled recursions against the Python loops."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from dsd_cli.effects import Channels, get_effect
from dsd_cli.effects.driven import driven_load, forgotten
from dsd_cli.effects.memory import COMPILED, Coupling, Load, load_acceleration, one_pole

RNG = np.random.default_rng(5)
T = 1e-3
N = 400


def place(t):
    """Where the motor is, at rest at first."""
    return np.sin(np.minimum(t / 0.05, 1.0) * math.pi / 2) ** 2 * (0.1 * np.sin(9 * t) + 0.02 * np.sin(60 * t))


def speed(t):
    return (place(t + 1e-6) - place(t - 1e-6)) / 2e-6


def smooth_motion(n=N, scale=1.0):
    """Position at n + 1 instants."""
    return scale * place(T * np.arange(n + 1))


def rows_of(position):
    n = len(position) - 1
    mean_v, mean_q = np.diff(position) / T, 0.5 * (position[:-1] + position[1:])
    return Channels(T * np.arange(n), np.zeros(n), mean_v, mean_q, np.full(n, T))


def test_lag_against_scipy():
    u = RNG.standard_normal(50)
    channels = Channels(np.zeros(50), u, u, u, np.full(50, T))
    (column,), last = get_effect("actuator_lag").run(channels, {"time_constant": 0.004})
    x, means = u[0], []
    for value in u:
        run = solve_ivp(lambda _, y, w=value: [(w - y[0]) / 0.004, y[0]], (0, T), [x, 0.0], rtol=1e-11, atol=1e-13)
        x = run.y[0, -1]
        means.append(run.y[1, -1] / T)
    np.testing.assert_allclose(column, means, atol=1e-9)
    assert last == pytest.approx(x)


def test_no_lag_is_the_command():
    u = RNG.standard_normal(20)
    for time_constant in (0.0, 1e-12):
        (column,), _ = get_effect("actuator_lag").run(Channels(u, u, u, u, T), {"time_constant": time_constant})
        np.testing.assert_allclose(column, u, atol=1e-8)


def test_dahl_against_scipy():
    level, stiffness = 0.3, 30.0
    speeds = np.concatenate([np.full(30, 1.0), np.zeros(5), np.full(30, -0.7), RNG.standard_normal(30)])
    channels = Channels(speeds, speeds, speeds, speeds, np.full(speeds.size, T))
    force, _ = get_effect("presliding_friction").force(channels, {"level": level, "stiffness": stiffness})
    z, means = 0.0, []
    for v in speeds:
        run = solve_ivp(
            lambda _, y, v=v: [v * (1 - stiffness * y[0] / level * np.sign(v)), y[0]], (0, T), [z, 0.0],
            rtol=1e-11, atol=1e-15,
        )  # fmt: skip
        z = run.y[0, -1]
        means.append(-stiffness * run.y[1, -1] / T)
    np.testing.assert_allclose(force, means, atol=1e-8)
    assert np.abs(force).max() <= level


def test_dahl_is_a_spring_at_first_and_then_dry_friction():
    slow, fast = (Channels(0.0, 0.0, v, 0.0, T) for v in (1e-4, np.float64(1e3)))  # a step of a simulation, by either
    values = {"level": 0.3, "stiffness": 30.0}
    force, _ = get_effect("presliding_friction").force(slow, values)
    assert force == pytest.approx(-30.0 * 0.5e-7, rel=1e-4)  # half way into the interval
    assert get_effect("presliding_friction").force(fast, values)[0] == pytest.approx(-0.3, rel=0.02)


def followed(gap, rate, drag, motion, lighter, y, at):
    """(motor less load, its rate, of which contact took) at the instants `at`: scipy's, from each event to the next. A
    contact begins at the flank and ends where its force is 0.

    motion : acceleration of the motor by t. lighter : as `Coupling`.
    """
    at, rows = np.asarray(at), []

    def force(y, s):
        return rate**2 * (s * y[0] - 0.5 * gap) + drag * s * y[1]

    def waits(y):
        depth = abs(y[0]) - 0.5 * gap
        return depth if depth < 0.0 else force(y, np.sign(y[0]))

    t, side = 0.0, np.sign(y[0]) if gap > 0.0 and waits(y) > 0.0 else 0.0
    while True:

        def rates(t, y, s=side):
            pull = (rate**2 * y[0] + drag * y[1]) if gap == 0.0 else s * force(y, s) if s else 0.0
            return [y[1], motion(t) - lighter * pull, lighter * pull]

        def event(_, y, s=side):
            return 1.0 if gap == 0.0 else force(y, s) if s else waits(y)

        event.terminal, event.direction = True, -1.0 if side else 1.0
        run = solve_ivp(
            rates, (t, at[-1]), y, events=event, dense_output=True, max_step=T / 2, rtol=1e-9, atol=1e-13
        )  # fmt: skip
        rows += [run.sol(x) for x in at if t < x <= run.t[-1]]
        if run.status == 0:
            return np.array(rows)
        t, y = run.t[-1], run.y[:, -1]
        side = 0.0 if side else np.sign(y[0])


@pytest.mark.parametrize("gap", [0.0, 0.01, 0.05])
@pytest.mark.parametrize("hz", [12.0, 45.0])
def test_load_against_scipy(gap, hz):
    """The motor moves as prescribed; scipy integrates the load behind it, from contact to contact."""
    rate, damping = 2 * math.pi * hz, 0.3
    times = T * np.arange(1, N + 1)
    accelerated = lambda t: (place(t + 1e-4) - 2.0 * place(t) + place(t - 1e-4)) / 1e-8  # noqa: E731
    y = followed(gap, rate, 2 * damping * rate, accelerated, 1.0, [0.0, 0.0, 0.0], times)
    rows = rows_of(smooth_motion())
    coupling = Coupling.of(hz, damping, gap)
    column, _ = load_acceleration(rows.position, rows.velocity, rows.interval, coupling, Load(0.0, 0.0, 0.0, 0.0))
    expected = np.diff(y[:, 2], prepend=0.0) / T
    assert np.linalg.norm(column - expected) < 2e-3 * np.linalg.norm(expected)
    assert np.abs(expected).max() > 1.0


@pytest.mark.parametrize("damping", [0.0, 0.05, 0.3, 1.0])
def test_an_impact_is_found_at_its_instant(damping):
    """One interval, in which the load is met, bounces, and is off again: what the motor gave it is 1 + restitution of
    its speed, e = exp(-zeta wa t), wherever in the interval that was."""
    gap, closing = 0.05, 1.0
    angle = math.acos(damping)  # half of the contact, in its phase: there the force is 0
    left = math.exp(-2.0 * damping * (angle / math.sin(angle) if angle > 0.0 else 1.0))
    for late in (0.0, 1e-9, 1.3e-4, 1.1e-3, 2.9e-3):
        state = Load(0.0, 0.0, closing, 0.02)
        begin = 0.5 * gap - closing * late
        place = begin + 0.5 * 0.02 * closing
        mean, after = load_acceleration(place, closing, 0.02, Coupling.of(60.0, damping, gap), state)
        assert mean * 0.02 == pytest.approx(closing * (1.0 + left), rel=3e-5)
        assert after.velocity == pytest.approx(closing * (1.0 + left), rel=3e-5)


def test_load_within_the_gap_does_not_feel_the_motor():
    position = smooth_motion(scale=0.01)
    effect = get_effect("backlash")
    rows = rows_of(position)
    force, state = effect.force(rows, {"gap": 0.1, "load_share": 0.5, "stiffness": 1e4})
    np.testing.assert_array_equal(force, 0.0)
    assert state.velocity == rows.velocity[0]


def test_own_frequency_and_stiffness_of_the_coupling():
    """omega_r^2 = k (1/Jm + 1/Jl): a tuning fork of both masses has the resonance that was asked for."""
    inertia, share, resonance = 2.0, 0.3, 2 * math.pi * 15.0
    motor, load = inertia * (1 - share), inertia * share
    stiffness = resonance**2 / (1 / motor + 1 / load)
    _, shape = get_effect("flexible_coupling").to_columns({"frequency": 15.0, "load_share": share, "damping": 0.0})
    assert 2 * math.pi * shape["frequency"] == pytest.approx(math.sqrt(stiffness / load))
    values = {"gap": 0.1, "load_share": share, "stiffness": stiffness}
    _, shape = get_effect("backlash").to_columns(values, inertia)
    assert 2 * math.pi * shape["frequency"] == pytest.approx(math.sqrt(stiffness / load))


def test_an_instant_moves_no_load():
    state = Load(0.0, 0.0, 0.0, T)
    column, after = load_acceleration(0.2, 0.0, 0.0, Coupling(100.0, 0.0, 0.0, 10.0), state)
    assert (column, after) == (pytest.approx(20.0), state)


def test_a_stiff_load_stays_finite_and_follows():
    position = smooth_motion()
    rows = rows_of(position)
    coupling = Coupling.of(5e3, 0.1)
    column, state = load_acceleration(rows.position, rows.velocity, rows.interval, coupling, None)
    assert np.isfinite(column).all()
    assert state.position == pytest.approx(position[-1], abs=1e-3)


@pytest.mark.parametrize("gap", [0.0, 2e-4, 0.02])
def test_two_masses_under_a_force_against_scipy(gap):
    share, coupling = 0.4, Coupling.of(17.0, 0.3, gap)
    push = 40.0 * np.sin(2 * math.pi * 9.0 * T * np.arange(300)) + 5.0 * RNG.standard_normal(300)
    y, expected, lighter = np.zeros(3), [], 1.0 / (1.0 - share)
    for p in push:
        (after,) = followed(gap, coupling.rate, coupling.drag, lambda _, p=p: p, lighter, y, [T])
        expected.append((after[2] - y[2]) / (lighter * T))
        y = after
    found = driven_load(push, T, coupling, share)
    assert np.abs(found).max() > 5.0
    np.testing.assert_allclose(found, expected, atol=1e-4 * np.abs(expected).max())


@pytest.mark.parametrize("share", [0.3, 0.6])
def test_where_it_began_is_forgotten_once_every_bounce_is_over(share):
    """From the far flank the motor crosses the gap and then bounces with e = exp(-2 zeta phi / sin phi), cos phi =
    zeta: flights last 2 e, 2 e^2, ... of the first one. No force acts for 100 intervals."""
    damping, gap, pushed, step = 0.3, 0.01, 4.0, 1e-4
    phi = math.acos(damping)
    left = math.exp(-2.0 * damping * phi / math.sin(phi))
    crossed = math.sqrt(2.0 * gap / pushed) / step
    push = np.where(np.arange(8000) < 100, 0.0, pushed)
    found = forgotten(push, step, Coupling.of(400.0, damping, gap), share)
    assert crossed < found - 100 < 1.05 * crossed * (1.0 + 2.0 * left / (1.0 - left))


def test_a_load_that_is_met_at_the_end_alone_remembers_until_then():
    """One on a spring has no play to be anywhere in."""
    push = np.where(np.arange(1000) < 900, 0.0, 40.0)
    assert forgotten(push, 1e-3, Coupling.of(60.0, 0.3, 0.02), 0.4) > 900
    assert forgotten(push, 1e-3, Coupling.of(60.0, 0.3), 0.4) == 0


@pytest.mark.parametrize(("share", "damping"), [(0.95, 2.0), (0.999, 0.3), (0.9, 30.0)])
def test_a_small_motor_on_a_strong_damper_moves_with_its_load(share, damping):
    """Far below the resonance, f / 20 Hz, the two are one: a = F / J, but for (f / resonance)^2 of it."""
    push = np.sin(2.0 * math.pi * 0.5 * T * np.arange(2000))
    found = driven_load(push, T, Coupling.of(20.0, damping), share)
    np.testing.assert_allclose(found, (1.0 - share) * push, atol=0.02 * (1.0 - share))


def test_a_strong_damper_behind_a_motor_does_not_diverge():
    rows = rows_of(smooth_motion())
    found, _ = load_acceleration(rows.position, rows.velocity, rows.interval, Coupling.of(20.0, 30.0), None)
    assert np.abs(found).max() < 2.0 * np.abs(np.diff(rows.velocity) / T).max()


def test_what_is_no_number_never_forgets():
    push = np.where(np.arange(100) < 50, 1.0, math.nan)
    assert forgotten(push, T, Coupling.of(20.0, 0.3, 1e-3), 0.4) == 100


def test_a_free_motor_moves_no_load():
    assert not driven_load(np.full(50, 1e-6), T, Coupling.of(20.0, 0.3, 1.0), 0.5).any()


@pytest.mark.skipif(COMPILED is None, reason="the build had no compiler")
class TestCompiled:
    @pytest.mark.parametrize("gap", [0.0, 1e-4])
    def test_driven(self, gap):
        push, coupling = 30.0 * RNG.standard_normal(400), Coupling.of(23.0, 0.1, gap)
        found = [driven_load(push, T, coupling, 0.3, 0.0, compiled) for compiled in (COMPILED, None)]
        np.testing.assert_allclose(*found, rtol=1e-12, atol=1e-9)

    @pytest.mark.parametrize("seed", range(30))
    def test_driven_in_play_contact_and_between(self, seed):
        """Single steps and whole intervals under one law, and those in which laws change, short enough that rounding
        does not grow into other contacts."""
        rng = np.random.default_rng(seed)
        gap, share, damping = 10.0 ** rng.uniform(-5.0, -2.0), rng.uniform(0.05, 0.6), rng.choice([0.02, 0.3, 1.0])
        coupling = Coupling.of(10.0 ** rng.uniform(0.5, 2.0), damping, gap)
        steady = np.repeat(rng.normal(size=6), 40) * 10.0 ** rng.uniform(0.0, 2.0)
        push = steady + rng.normal(size=240) * 10.0 ** rng.uniform(-2.0, 1.5)
        found = [driven_load(push, T, coupling, share, 0.0, compiled) for compiled in (COMPILED, None)]
        np.testing.assert_allclose(*found, rtol=0.0, atol=1e-8 * np.abs(push).max())

    def test_one_pole(self):
        keep, add = RNG.uniform(0, 1, 500), RNG.standard_normal(500)
        np.testing.assert_array_equal(one_pole(keep, add, 0.3), one_pole(keep, add, 0.3, compiled=None))

    @pytest.mark.parametrize("gap", [0.0, 0.01, 0.05])
    @pytest.mark.parametrize("state", [None, Load(0.02, -0.1, 0.05, T)])
    @pytest.mark.parametrize("clock", ["even", "uneven", "with an instant"])
    def test_load(self, gap, state, clock):
        rows = rows_of(smooth_motion())
        interval = rows.interval * (RNG.uniform(0.5, 1.5, N) if clock == "uneven" else 1.0)
        interval[200] *= clock != "with an instant"
        coupling = Coupling.of(23.0, 0.1, gap)
        (a, end), (b, end_b) = (
            load_acceleration(rows.position, rows.velocity, interval, coupling, state, compiled)
            for compiled in (COMPILED, None)
        )
        np.testing.assert_allclose(a, b, rtol=1e-12, atol=1e-9)
        np.testing.assert_allclose(end, end_b, rtol=1e-12, atol=1e-12)
        state = state or Load(float(rows.position[0]), 0.0, 0.0, T)
        for row in zip(rows.position[:250].tolist(), rows.velocity.tolist(), interval.tolist(), strict=False):
            (mean, other), (mean_b, state) = (load_acceleration(*row, coupling, state, x) for x in (COMPILED, None))
            np.testing.assert_allclose((mean, *other), (mean_b, *state), rtol=1e-12, atol=1e-9)

    def test_wrong_lengths_are_refused(self):
        with pytest.raises(ValueError, match="one length"):
            COMPILED.one_pole(np.zeros(3), np.zeros(4), 0.0, np.zeros(3))
        fixed = np.zeros(3)
        fixed.setflags(write=False)
        with pytest.raises((BufferError, ValueError), match="read-only"):
            COMPILED.one_pole(np.zeros(3), np.zeros(3), 0.0, fixed)


def rubbing_load(motor, share, rate, drag, gap, slowing, steps):
    """Fine steps of a load behind a motor that moves as prescribed, pushed by a flank and stopped by friction: the
    speed that it has left, and the momentum that contact gave it in each of `steps` intervals."""
    h, q, v, given = T / 400, 0.0, 0.0, np.zeros(steps)
    for k in range(steps):
        for i in range(400):
            t = T * k + h * (i + 0.5)
            apart, closing = motor(t)[0] - q - 0.5 * h * v, motor(t)[1] - v
            depth = abs(apart) - 0.5 * gap
            push = rate**2 * np.sign(apart) * depth + drag * closing if depth > 0.0 else 0.0
            push = push if push * apart > 0.0 else 0.0
            free = v + h * push
            after = math.copysign(max(abs(free) - slowing * h, 0.0), free)
            q, v, given[k] = q + 0.5 * h * (v + after), after, given[k] + h * push
    return given


def test_a_load_that_rubs_stops_where_the_motor_leaves_it():
    """The motor swings in its play and beyond; against own steps of a four-hundredth of the interval."""
    rate, damping, gap, slowing = 2 * math.pi * 40.0, 0.3, 0.02, 4.0
    motor = lambda t: (0.03 * (1.0 - math.cos(12.0 * t)), 0.36 * math.sin(12.0 * t))  # noqa: E731
    expected = rubbing_load(motor, 0.5, rate, 2 * damping * rate, gap, slowing, 700) / T
    rows = rows_of(np.array([motor(T * k)[0] for k in range(701)]))
    start = Load(0.0, 0.0, 0.0, T)
    for compiled in (COMPILED, None):
        coupling = Coupling.of(40.0, damping, gap, slowing)
        found, _ = load_acceleration(rows.position, rows.velocity, rows.interval, coupling, start, compiled)
        assert np.linalg.norm(found - expected) < 0.03 * np.linalg.norm(expected)
    coasting, _ = load_acceleration(rows.position, rows.velocity, rows.interval, Coupling.of(40.0, damping, gap), start)
    assert np.linalg.norm(coasting - expected) > 0.3 * np.linalg.norm(expected)


def test_a_force_drives_a_load_that_rubs_as_its_motion_does():
    """The same load once behind the motion, once behind the force that made it."""
    share, coupling = 0.4, Coupling.of(30.0, 0.3, 0.01, 3.0)
    rows = rows_of(smooth_motion())
    pull, _ = load_acceleration(rows.position, rows.velocity, rows.interval, coupling, Load(0.0, 0.0, 0.0, T))
    speeds = np.array([speed(T * k) for k in range(N)])
    push = np.diff(speeds, append=speed(T * N)) / T + share / (1.0 - share) * pull
    found = driven_load(push, T, coupling, share, velocity=speeds)
    assert np.linalg.norm(found - pull) < 0.15 * np.linalg.norm(pull)
