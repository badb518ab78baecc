"""A session gives one label per row, the same for any cut into batches, live or not, however dirty the rows."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dsd_cli.detect import DetectorSettings, Grid
from dsd_cli.detect.plan import Plan
from dsd_cli.detect.session import Rows, Session
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.cleaning import Cleaner

T, N = 0.001, 120
EFFECTS = {"viscous_friction": {"coefficient": 0.2}}
PLANS = {
    "bare": {},
    "average": {"settings": {"method": "average"}},
    "imm": {"settings": {"method": "imm"}},
    "viterbi": {"settings": {"method": "viterbi"}},
    "smooth": {"settings": {"method": "smooth"}},
    "profile": {"settings": {"method": "profile"}},
    "velocity": {"d_hat_source": "velocity"},
    "position": {"d_hat_source": "position"},
    "effects": {"model": PlantModel(1.0, 0.0, EFFECTS), "channels": ("velocity",)},
    "effects from position": {
        "model": PlantModel(1.0, 0.0, EFFECTS), "channels": ("position",), "d_hat_source": "position"
    },
}  # fmt: skip


def make_plan(name: str) -> Plan:
    more = dict(PLANS[name])
    tuning = DetectorSettings(window=10, initial=5, **more.pop("settings", {}))
    more.setdefault("model", PlantModel())
    return Plan(Grid((0.0, 0.003), (0.5, 1.0, 2.0)), tuning, observer=ObserverSettings(), **more)


def dirty_log(seed: int, irregular: bool) -> dict[str, np.ndarray]:
    """Holes, gaps, duplicates, a restart, missing values and stamps; from the first rows on."""
    rng = np.random.default_rng(seed)
    steps = rng.choice([1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 2, 4, 0, 30, -50], N) * T
    if irregular:
        steps = steps * rng.uniform(0.6, 1.4, N)
    t = np.cumsum(steps)
    log = {"t": t, "u": np.cumsum(rng.normal(size=N)), "d_hat": rng.normal(size=N)}
    log |= {"velocity": np.cumsum(rng.normal(size=N)) * 0.01, "position": np.cumsum(rng.normal(size=N)) * 1e-5}
    for name in ("t", "u", "d_hat", "velocity"):
        log[name] = np.where(rng.uniform(size=N) < 0.03, rng.choice([np.nan, np.inf]), log[name])
    return log


def run(plan: Plan, log: dict[str, np.ndarray], edges: list[int], live: bool = False, clock=None) -> Rows:
    session = Session(plan, Cleaner(clock))
    parts = []
    for begin, end in itertools.pairwise(edges):
        columns = {name: column[begin:end] for name, column in log.items()}
        before = sum(part.state.size for part in parts)
        parts += session.feed(columns["t"], columns)
        if live and (early := session.held(columns["t"])) is not None:
            parts.append(early)
        if live:
            assert sum(part.state.size for part in parts) - before == end - begin
    parts += session.finish()
    assert session.label == parts[-1].state[-1]
    estimates = [np.concatenate(columns) for columns in zip(*(part.estimates for part in parts), strict=True)]
    return Rows(*(np.concatenate(columns) for columns in zip(*(part[:6] for part in parts), strict=True)), estimates)


def same(a: Rows, b: Rows) -> None:
    assert len(a.estimates) == len(b.estimates)
    for one, other in zip(a.estimates, b.estimates, strict=True):
        np.testing.assert_array_equal(one, other, err_msg="estimates")
    for name in Rows._fields[:6]:
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name), err_msg=name)


@pytest.mark.parametrize("name", PLANS)
@settings(deadline=None, max_examples=15)
@given(
    seed=st.integers(0, 10_000),
    irregular=st.booleans(),
    cuts=st.lists(st.integers(1, N - 1), max_size=5, unique=True),
    clock=st.sampled_from([None, None, T]),
)
def test_any_cut_gives_the_same_labels(name, seed, irregular, cuts, clock):
    log, plan = dirty_log(seed, irregular), make_plan(name)
    whole = run(plan, log, [0, N], clock=clock)
    np.testing.assert_array_equal(whole.t, log["t"])
    assert np.isin(whole.state, range(6)).all()
    bad = ~np.all([np.isfinite(log[column]) for column in ("t", *plan.columns)], axis=0)
    assert not whole.confident[bad].any()
    assert np.isnan(whole.log_likelihood[bad]).all()
    same(run(plan, log, [0, *sorted(cuts), N], clock=clock), whole)


@pytest.mark.parametrize("name", ["bare", "average", "imm", "position", "effects"])
@settings(deadline=None, max_examples=8)
@given(seed=st.integers(0, 10_000), irregular=st.booleans())
def test_live_every_row_is_answered_at_once_with_the_same_label(name, seed, irregular):
    log, plan = dirty_log(seed, irregular), make_plan(name)
    same(run(plan, log, list(range(N + 1)), live=True), run(plan, log, [0, N]))


def test_a_dropped_row_carries_the_last_label():
    rng = np.random.default_rng(0)
    log = {"t": np.arange(N) * T, "u": np.cumsum(rng.normal(size=N)), "d_hat": np.zeros(N)}
    log["u"][60] = np.nan
    got = run(make_plan("bare"), log, [0, N])
    assert got.state[60] == got.state[59]
    assert np.isnan(got.log_likelihood[60])
    assert not got.confident[60]
    assert np.isfinite(got.log_likelihood[[59, 61]]).all()


def test_a_restart_that_is_said_begins_the_warm_up_anew():
    rng = np.random.default_rng(0)
    log = {"t": np.arange(N) * T, "u": np.cumsum(rng.normal(size=N)), "d_hat": np.zeros(N)}
    session = Session(make_plan("bare"), Cleaner(None))
    first = list(session.feed(log["t"], log))
    second = list(session.feed(log["t"], log, restart=True))
    last = first[-1].state[-1]
    assert (second[0].state[:16] == last).all()
    assert np.isnan(second[0].log_likelihood[:16]).all()
    again = np.concatenate([part.log_likelihood for part in second])
    np.testing.assert_array_equal(again, np.concatenate([part.log_likelihood for part in first]))
