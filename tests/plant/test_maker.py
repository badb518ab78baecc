"""d_hat of other makers (tests/oracle/d_hat_makers.py) becomes that of the package's observer."""

from itertools import pairwise

import numpy as np
import pytest

from dsd_cli.plant.maker import FILTERS, PAIRINGS, Maker, remade
from tests.oracle.d_hat_makers import made
from tests.oracle.rig_sensors import observe

MAKERS = [Maker(how, pairing) for how in FILTERS for pairing in PAIRINGS]
NOMINAL, TAU = 0.4, 0.012


def log(jitter: float, n: int = 900):
    """t, u with jumps, v; stamps that jitter by that share of 1 ms."""
    rng = np.random.default_rng(3)
    t = np.concatenate([[0.0], np.cumsum(0.001 * (1.0 + jitter * rng.uniform(-1.0, 1.0, n - 1)))])
    u = np.repeat(rng.uniform(-2.0, 2.0, n // 30), 30) + 0.1 * rng.standard_normal(n)
    return t, u, np.cumsum(rng.standard_normal(n)) * 1e-3


def as_on_position(t, u, v):
    """Of acceleration and u, both as means over two intervals, by scalar loops."""
    steps, d, out = np.diff(t), 0.0, np.zeros(len(t))
    a = np.diff(v) / steps
    for k in range(2, len(t)):
        mean_u = (steps[k - 1] * u[k - 1] + steps[k - 2] * u[k - 2]) / (steps[k - 1] + steps[k - 2])
        p = np.exp(-steps[k - 1] / TAU)
        d = p * d + (1.0 - p) * (0.5 * NOMINAL * (a[k - 1] + a[k - 2]) - mean_u)
        out[k] = d
    return out


@pytest.mark.parametrize("jitter", [0.0, 0.4], ids=["regular", "irregular"])
@pytest.mark.parametrize("maker", MAKERS, ids=str)
def test_every_maker_becomes_the_observer_of_the_package(maker, jitter):
    t, u, v = log(jitter)
    found, _ = remade(t, u, made(t, u, v, NOMINAL, TAU, maker.filter, maker.u), maker, TAU)
    wanted = as_on_position(t, u, v) if maker.filter == "bilinear" else observe(t, u, v, NOMINAL, TAU)
    settled = t > 12.0 * TAU  # both begin at rest, and with "bilinear" before the first interval
    assert found[settled] == pytest.approx(wanted[settled], abs=2e-5 * np.abs(wanted).max())


@pytest.mark.parametrize("maker", MAKERS, ids=str)
def test_chunks_of_any_size_give_the_same_bits(maker):
    t, u, v = log(0.3, 420)
    d_hat = made(t, u, v, NOMINAL, TAU, maker.filter, maker.u)
    whole, _ = remade(t, u, d_hat, maker, TAU)
    state, parts, edges = None, [], [0, 1, 2, 3, 10, 10, 11, 200, 420]
    for a, b in pairwise(edges):
        part, state = remade(t[a:b], u[a:b], d_hat[a:b], maker, TAU, state)
        parts.append(part)
    assert np.array_equal(np.concatenate(parts), whole)


def test_what_is_as_here_stays():
    t, u, v = log(0.3)
    d_hat = observe(t, u, v, NOMINAL, TAU)
    assert remade(t, u, d_hat, Maker(), TAU)[0] == pytest.approx(d_hat, abs=1e-9)


def test_without_a_filter_only_the_pairing_is_changed():
    t, u, v = log(0.0)
    found, _ = remade(t, u, made(t, u, v, NOMINAL, 1e-12, "exact", "newest"), Maker("exact", "newest"), 0.0)
    assert found[1:] == pytest.approx(observe(t, u, v, NOMINAL, 0.0)[1:], abs=1e-6)


def test_behind_a_hole_it_begins_anew():
    """What u did in the hole is not in the log: the sample behind it is taken as it is, and nothing before counts."""
    t, u, v = log(0.0)
    d_hat = made(t, u, v, NOMINAL, TAU, "euler", "newest")
    t = np.where(np.arange(len(t)) >= 500, t + 0.7, t)
    whole, _ = remade(t, u, d_hat, Maker("euler", "newest"), TAU)
    alone, _ = remade(t[500:], u[500:], d_hat[500:], Maker("euler", "newest"), TAU)
    assert whole[500] == d_hat[500]
    assert np.array_equal(whole[500:], alone)
