"""What a difference of two fits explains by chance of coloured noise, against noise that is drawn."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from dsd_cli.effects import get_effect
from dsd_cli.identify.fit.bank import Term
from dsd_cli.identify.fit.errors import Noise
from dsd_cli.identify.fit.row_weights import shared_inflation, unpredicted_share
from dsd_cli.identify.search.evidence import Evidence
from dsd_cli.signals.log import Array
from tests.identify.search_rig import posed

ROWS = 4000


def _coloured(rng: np.random.Generator, memory: float, rows: int = ROWS) -> Array:
    """Noise of which the share `memory` of each row stays in the next, variance 1."""
    white, made = rng.normal(size=rows), np.zeros(rows)
    for k in range(1, rows):
        made[k] = memory * made[k - 1] + np.sqrt(1.0 - memory**2) * white[k]
    return made


@pytest.mark.parametrize("frequency", [0.0, 0.01, 0.05, 0.4])
def test_a_line_explains_by_chance_what_the_spectrum_holds_there(frequency: float) -> None:
    """The variance of a line's coefficient in coloured noise, drawn 400 times, over that in white noise (Bartlett)."""
    rng, memory = np.random.default_rng(5), 0.8
    line = np.cos(2.0 * np.pi * frequency * np.arange(ROWS))
    draws = [_coloured(rng, memory) for _ in range(400)]
    seen = float(np.var([line @ noise for noise in draws])) / float(line @ line)
    assert shared_inflation(draws[0], line) == pytest.approx(seen, rel=0.35)


def test_white_noise_inflates_nothing() -> None:
    rng = np.random.default_rng(6)
    line = np.cos(0.1 * np.arange(ROWS))
    assert shared_inflation(rng.normal(size=ROWS), line) == pytest.approx(1.0, abs=0.4)


@pytest.mark.parametrize("memory", [0.0, 0.5, 0.9])
def test_what_the_past_does_not_predict(memory: float) -> None:
    """Of noise with one row of memory that is 1 - memory^2."""
    noise = _coloured(np.random.default_rng(7), memory, 20000)
    assert unpredicted_share(noise) == pytest.approx(1.0 - memory**2, rel=0.05)


def test_a_push_is_no_news_but_its_edges_are() -> None:
    """A slow hump is predicted by its own past, a rectangle of the same size is not."""
    time, rng = np.linspace(-1.0, 1.0, 400), np.random.default_rng(8)
    noise = 0.1 * rng.normal(size=400)
    hump = np.exp(-((time / 0.25) ** 2)) + noise
    push = np.where(np.abs(time) < 0.25, 1.0, 0.0) + noise
    before, after = (float(x @ x) * unpredicted_share(x) for x in (hump, hump - push + noise))
    assert after > 0.7 * before
    before, after = (float(x @ x) * unpredicted_share(x) for x in (push, noise))
    assert after < 0.7 * before


def test_functions_of_time_are_known_as_such() -> None:
    names = ("periodic_disturbance", "external_force", "cogging", "constant_load", "saturation", "actuator_lag")
    assert [get_effect(name).of_time for name in names] == [True, True, False, False, False, False]


def test_no_law_is_replaced_by_a_line_in_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """However much it gains: of a motion that is a few sines every law is a few lines."""
    search = posed({"viscous_friction": {"coefficient": 0.05}}, ("viscous_friction", "periodic_disturbance"))
    for likely, named in (("periodic_disturbance", None), ("viscous_friction", "viscous_friction")):
        scan = SimpleNamespace(gain=lambda t, keep, likely=likely: (1e6 * (t.id == likely), search.refit.tap))
        monkeypatch.setattr(search, "scan", lambda *_, scan=scan: scan)
        found = search.challenger(search.refit, "coulomb_friction", 1.0)
        assert (found and found.effect) == named


def test_a_lead_is_less_where_what_is_left_has_the_colour_of_what_is_explained() -> None:
    """Of the same two fits, beside a residual that is white and beside one that moves as slowly as a load does."""
    search = posed({"viscous_friction": {"coefficient": 0.05}}, ("viscous_friction",))
    after = search.fit((Term("viscous_friction"),), search.refit.tap)
    assert search.by_chance(search.refit, after) < 1.1
    slow = posed({"viscous_friction": {"coefficient": 0.05}, "gravity": {"amplitude": 0.3, "phase": 0.0}})
    after = slow.fit((Term("viscous_friction"),), slow.refit.tap)
    assert slow.by_chance(slow.refit, after) > 1.3


@dataclass(frozen=True, eq=False)
class Left:
    """Stands for a fit: what it leaves of each row."""

    loss: float
    left: np.ndarray


@pytest.mark.parametrize("beyond", [0.01, 1.0, 100.0], ids=["noise", "near", "far beyond the noise"])
def test_a_column_gains_half_a_nat_by_chance_however_much_is_left_beyond_the_noise(beyond: float) -> None:
    """Of 300 draws of noise and of a column, of one colour; the noise of the rows is not white either (twice)."""
    rng, gained = np.random.default_rng(11), []
    noise = Noise(1.0 / (1.0 + beyond), 2.0, np.empty(0))
    rows = SimpleNamespace(counted=1500.0, kept=np.ones(1500, dtype=bool))
    for _ in range(300):
        was, column = (_coloured(rng, 0.6, 1500) for _ in range(2))
        left = was - (column @ was) / (column @ column) * column
        fits = [Left(float(x @ x), x) for x in (was, left)]
        judge: Any = SimpleNamespace(noise=noise, equations=rows, _left=lambda fit: fit.left)
        nats = [Evidence.nats(judge, fit.loss) for fit in fits]
        gained.append((nats[0] - nats[1]) / Evidence.by_chance(judge, *fits))
    assert np.mean(gained) == pytest.approx(0.5, rel=0.3)  # within 3.7 standard errors of the mean
