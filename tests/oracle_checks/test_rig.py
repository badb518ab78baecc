"""The logs of the outside rig against what it promises about them."""

import ast
import math
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from tests.oracle import rig
from tests.oracle.rig_cases import LOOPS, PAIRS, SENSINGS, SINGLES, STRANGERS_SEEN, STRANGERS_UNSEEN, STRENGTHS, RigCase

T, L = 1e-3, 0.0123
FILES = sorted(Path(rig.__file__).parent.glob("rig*.py"))
COUNTS = {"speed40k": 40_000, "speedloud": 40_000, "enc40k": 40_000, "enc4096": 4096, "enc1024": 1024}
COUNTS |= {"enc8192jitter500": 8192}


@pytest.mark.parametrize("path", FILES, ids=lambda p: p.name)
def test_rig_is_independent_and_readable(path):
    names = set()
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            names.add(str(node.module).split(".")[0])
            assert not str(node.module).startswith("tests.oracle.machine")
    standard = {"bisect", "collections", "dataclasses", "itertools", "math", "typing", "zlib"}
    assert names <= standard | {"numpy", "scipy", "tests"}
    assert len(path.read_text("utf-8").splitlines()) <= 300


def means(x):
    """Over each interval between stamps, trapezoidal."""
    return 0.5 * (x[1:] + x[:-1])


def arriving(u, delay):
    """Mean over each interval of a command that is held and comes `delay` later."""
    whole, part = divmod(delay / T, 1.0)
    late = np.concatenate([np.zeros(int(whole) + 1), u])
    return ((1.0 - part) * late[1:] + part * late[:-1])[: len(u) - 1]


@cache
def made(what=("viscous_friction",), seed=1, sensing="speed40k", **options):
    return rig.make_exact(RigCase(what, seed, sensing, **({"duration": 3.0} | options)))


def in_log(exact, x):
    return x[exact.motion.t >= 0.0]


@pytest.mark.parametrize("sensing", SENSINGS)
def test_each_sensing_logs_what_it_has(sensing):
    log, exact = made(sensing=sensing)
    own = {"u", "d_hat"} if sensing == "udhat" else {"u", "position"}
    own |= {"velocity"} if sensing.startswith("speed") else set()
    assert set(log.channels) - ({"reference"} if "position" in own else set()) == {"t", *own}
    rows = {len(x) for x in log.channels.values()}
    assert len(rows) == 1
    np.testing.assert_array_equal(log.channels["u"], in_log(exact, exact.motion.u))
    assert log.channels["t"][0] == 0.0
    if sensing in COUNTS:
        step = 2.0 * np.pi / COUNTS[sensing]
        counts = log.channels["position"] / step
        np.testing.assert_allclose(counts, np.round(counts), atol=1e-6)
        assert np.max(np.abs(log.channels["position"] - in_log(exact, exact.motion.q))) <= 0.5 * step * (1.0 + 1e-9)
    if "velocity" in own:
        noise = log.channels["velocity"] - in_log(exact, exact.motion.v)
        share = np.std(noise) / np.sqrt(np.mean(in_log(exact, exact.motion.v) ** 2))
        low, high = (3e-4, 2.5e-3) if sensing == "speed40k" else (4e-3, 4e-2)
        assert low < share < high
        assert abs(np.corrcoef(noise[1:], noise[:-1])[0, 1]) < 0.1


def test_stamps_are_regular_or_jitter_as_asked():
    for sensing in SENSINGS:
        log, _ = made(sensing=sensing)
        intervals = np.diff(log.channels["t"])
        if sensing == "enc8192jitter500":
            assert np.mean(intervals) == pytest.approx(2e-3, rel=0.02)
            assert 0.08 < np.std(intervals) / 2e-3 < 0.32
            assert np.min(intervals) > 0.0
        else:
            np.testing.assert_allclose(intervals, T, rtol=1e-9)


def test_d_hat_is_the_observer_of_the_exact_speed_and_some_noise():
    log, exact = made(sensing="udhat", tau=0.02)
    motion, keep, d = exact.motion, math.exp(-T / 0.02), 0.0
    plain = [d]
    for k in range(1, len(motion.t)):
        raw = log.observer["nominal_inertia"] * (motion.v[k] - motion.v[k - 1]) / T - motion.u[k - 1]
        d = keep * d + (1.0 - keep) * raw
        plain.append(d)
    noise = log.channels["d_hat"] - in_log(exact, np.array(plain))
    assert log.observer["time_constant"] == 0.02
    assert 0.004 < np.std(noise) / log.floor["drive_rms"] < 0.022
    assert abs(np.mean(noise)) < 0.1 * np.std(noise)


def test_a_log_balances_with_its_truth_and_not_with_what_is_believed():
    log, exact = made(("gravity",), 3, "speed40k", delay=L)
    motion, gravity = exact.motion, log.truth["effects"]["gravity"]
    rest = balance_of(log, motion)
    bare = np.sqrt(np.mean(rest**2))
    rest = rest + gravity["amplitude"] * means(np.sin(motion.q + gravity["phase"]))
    for effect, values in log.believed["effects"].items():
        known = -values["coefficient"] * means(motion.v) if effect == "viscous_friction" else None
        known = -values["level"] * means(np.sign(motion.v)) if effect == "coulomb_friction" else known
        known = values["force"] if effect == "constant_load" else known
        rest = rest - known
    turning = (np.sign(motion.v[1:]) != np.sign(motion.v[:-1])) | (motion.v[1:] == 0.0)
    calm = (motion.t[1:] > 0.0) & ~turning
    assert calm.mean() > 0.4
    assert np.max(np.abs(rest[calm])) < 0.01 * log.floor["drive_rms"]
    assert bare > 0.1 * log.floor["drive_rms"]


def balance_of(log, motion):
    return log.truth["inertia"] * np.diff(motion.v) / T - arriving(motion.u, log.truth["delay"])


def test_equal_cases_give_equal_logs_and_seeds_differ():
    cases = [RigCase(("constant_load",), s, "enc4096", duration=2.0) for s in (4, 5, 4)]
    one, other, again = rig.make(cases)
    for name, values in one.channels.items():
        np.testing.assert_array_equal(values, again.channels[name])
    assert one.truth == again.truth
    assert one.truth["inertia"] != other.truth["inertia"]


def test_the_sign_of_u_is_flipped_in_the_log_alone():
    plain, _ = made(("viscous_friction",), 6)
    flipped, _ = made(("viscous_friction",), 6, u_sign=-1)
    np.testing.assert_array_equal(flipped.channels["u"], -plain.channels["u"])
    np.testing.assert_array_equal(flipped.channels["velocity"], plain.channels["velocity"])
    assert flipped.truth == plain.truth


def test_beliefs_are_wrong_where_they_are_meant_to_be():
    log, _ = made(("inertia",), 2)
    wrong = log.believed["inertia"] / log.truth["inertia"] - 1.0
    assert 0.1 < abs(wrong) < 1.6
    assert abs(wrong) == pytest.approx(log.floor["shares"]["inertia"], rel=0.6)  # J a is most of the drive
    assert log.believed["delay"] == log.truth["delay"] == 0.02
    log, _ = made(("delay",), 2)
    assert abs(log.believed["delay"] - log.truth["delay"]) > 0.004
    log, _ = made(("gravity",), 2, believed_inertia_factor=1.3, believed_delay_error=-0.01)
    assert log.believed["inertia"] == pytest.approx(1.3 * log.truth["inertia"])
    assert log.believed["delay"] == pytest.approx(0.01)
    assert set(log.believed["effects"]) <= set(log.truth["effects"]) - {"gravity"}
    delays = [made((), s, delay=None, duration=0.5)[0].truth["delay"] for s in range(3)]
    assert len(set(delays)) == 3
    assert all(0.0 <= d <= 0.025 for d in delays)


def test_a_case_that_is_not_known_is_refused():
    two = {"what": ("dead_zone", "actuator_lag")}
    for wrong in (two, {"what": ("friction",)}, {"sensing": "eyes"}, {"loop": "shut"}, {"strength": "huge"}):
        with pytest.raises(ValueError, match=r"none of|cannot hide"):
            rig.make([replace(RigCase((), 1, "enc4096"), **wrong)])


def banded(x, t, band):
    """Below a frequency, by dropping lines of the spectrum; another way than the rig's."""
    spectrum = np.fft.rfft(x)
    spectrum[np.fft.rfftfreq(len(x), float(np.mean(np.diff(t)))) > band] = 0.0
    return np.fft.irfft(spectrum, len(x))


def size(x):
    return float(np.sqrt(np.mean(np.square(x))))


#: What a log must show, from its own channels and the exact motion: values, u, q, v.
SHOWS = {
    "saturation": lambda p, u, q, v: 0.015 <= np.mean(np.abs(u) > p["limit"]) <= 0.10,
    "dead_zone": lambda p, u, q, v: 0.05 < np.mean(np.abs(u) < p["width"]) < 0.8,
    "stribeck_friction": lambda p, u, q, v: (
        np.mean(np.abs(v) < 1.5 * p["velocity"]) > 0.05 and np.mean(np.abs(v) > 2.5 * p["velocity"]) > 0.15
    ),
    "cogging": lambda p, u, q, v: p["periods"] * np.ptp(q) / (2.0 * np.pi) >= 8.0,
    "gravity": lambda p, u, q, v: np.ptp(q) >= 1.0,
    "flexible_coupling": lambda p, u, q, v: 8.0 <= p["frequency"] <= 60.0,
    "actuator_lag": lambda p, u, q, v: p["time_constant"] >= 0.003,
}


@pytest.mark.parametrize("what", [*SINGLES, *STRANGERS_SEEN, *STRANGERS_UNSEEN])
def test_a_hidden_effect_has_the_size_asked_for_and_is_excited(what):
    log, exact = made((what,), 7, "enc40k", duration=5.0)
    assert log.floor["promised"] == 1.0
    t, u = log.channels["t"], log.channels["u"]
    q, v, force = (in_log(exact, x) for x in (exact.motion.q, exact.motion.v, exact.forces[what]))
    band = 100.0 if what in ("flexible_coupling", "backlash") else 25.0
    share = size(banded(force, t, band)) / size(banded(u, t, band))
    least, most = STRENGTHS["plain"]
    assert (0.05 if what == "saturation" else 0.85 * least) < share < 1.15 * most
    if what in SHOWS:
        assert SHOWS[what](log.truth["effects"][what], u, q, v)
    assert log.floor["hidden_rms_force"] == pytest.approx(size(force))
    assert log.floor["drive_rms"] == pytest.approx(size(u))


def test_strengths_are_ordered():
    shares = [made(("constant_load",), 2, strength=s)[0].floor["shares"]["constant_load"] for s in STRENGTHS]
    for share, (least, most) in zip(shares, STRENGTHS.values(), strict=True):
        assert least <= share <= most


def test_nothing_missing_leaves_nothing():
    for loop in LOOPS:
        log, _ = made((), 1, "enc40k", loop=loop)
        assert log.floor["hidden_rms_force"] == 0.0
        assert log.believed["inertia"] == log.truth["inertia"]
        assert log.believed["effects"] == log.truth["effects"]
        assert log.floor["travel"] > 0.3


def test_some_commands_have_spikes_and_some_logs_a_reference():
    logs = [made((), s, "enc40k", duration=2.0)[0] for s in range(12)]
    spikes = [log.floor["spike"] for log in logs]
    assert any(8.0 < s < 60.0 for s in spikes)
    assert sum(s < 4.0 for s in spikes) >= 5
    assert 2 < sum("reference" in log.channels for log in logs) < 11
    kinds = {log.floor["kind"] for log in logs}
    assert len(kinds) >= 4


def test_lists_name_what_can_be_hidden():
    assert len(SINGLES) == 21
    assert len(PAIRS) == 20
    assert {e for pair in PAIRS for e in pair} <= set(SINGLES)
    assert not set(STRANGERS_SEEN) & set(STRANGERS_UNSEEN)
    assert min(len(STRANGERS_SEEN), len(STRANGERS_UNSEEN)) >= 4
