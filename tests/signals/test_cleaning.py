"""What the cleaner does with logs as they really are, and that the cut into batches never matters."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dsd_cli.errors import DataError
from dsd_cli.signals.cleaning import Cleaner

T = 0.001


def clean(t, values, cuts=(), **options):
    """All pieces of a log cut at `cuts`, and the cleaner."""
    cleaner = Cleaner(options.pop("sample_time", None), **options)
    rows = next(iter(values.values())).size
    edges = sorted({0, rows, *(cut % (rows + 1) for cut in cuts)})
    pieces = []
    for a, b in pairwise(edges):
        pieces += cleaner.feed(None if t is None else t[a:b], {name: v[a:b] for name, v in values.items()})
    return pieces + cleaner.finish(), cleaner


def flat(pieces):
    """What must not depend on the batches: samples, their rows, and where restarts are."""
    samples, rows, restarts, row_t = [], [], [], []
    names = sorted(pieces[0].values) if pieces else []
    expected_start = 0
    for piece in pieces:
        assert piece.start == expected_start
        expected_start += piece.rows
        assert piece.row_t.size == piece.rows
        if piece.restart:
            restarts.append(len(samples))
        keep = range(piece.rows) if piece.keep is None else piece.keep.tolist()
        assert len(keep) == piece.t.size
        rows += [-1 if k < 0 else k + piece.start for k in keep]
        samples += zip(piece.t.tolist(), *(piece.values[name].tolist() for name in names), strict=True)
        row_t.append(piece.row_t)
        for name in names:
            assert piece.values[name].flags.c_contiguous
            assert np.isfinite(piece.values[name]).all()
    return samples, rows, restarts, np.concatenate(row_t).tobytes() if row_t else b""


def ramp(n=50):
    return T * np.arange(n), {"u": np.arange(n, dtype=float), "d_hat": np.arange(n) * 2.0}


def test_a_clean_log_is_passed_on_without_copies():
    t, values = ramp()
    cleaner = Cleaner(T)
    [piece] = cleaner.feed(t, values)
    assert piece.keep is None
    assert not piece.restart
    assert np.shares_memory(piece.t, t)
    assert np.shares_memory(piece.values["u"], values["u"])
    assert cleaner.dropped == {}
    assert cleaner.warnings == []


def test_the_clock_is_settled_from_sixteen_rows():
    t, values = ramp()
    cleaner = Cleaner(None)
    for row in range(15):
        assert cleaner.feed(t[row : row + 1], {n: v[row : row + 1] for n, v in values.items()}) == []
        assert cleaner.held == row + 1
    [piece] = cleaner.feed(t[15:16], {n: v[15:16] for n, v in values.items()})
    assert piece.rows == 16
    assert cleaner.held == 0
    assert cleaner.sample_time == T
    assert cleaner.regular
    assert piece.stamps is None


@pytest.mark.parametrize("every", [3, 7])
def test_the_clock_is_that_of_the_rows_with_all_values(every):
    """Rows of another channel stand between them, as merged topics have them."""
    t, values = ramp(60)
    between = t[::every] + 0.4 * T
    at = np.argsort(np.concatenate([t, between]))
    merged = {name: np.concatenate([x, np.full(between.size, np.nan)])[at] for name, x in values.items()}
    pieces, cleaner = clean(np.concatenate([t, between])[at], merged)
    assert (cleaner.sample_time, cleaner.regular) == (T, True)
    assert cleaner.dropped == {"not finite: u": between.size}
    np.testing.assert_allclose(np.concatenate([p.t for p in pieces]), t)


def test_no_time_column():
    _, values = ramp()
    [piece], cleaner = clean(None, values, sample_time=T)
    np.testing.assert_array_equal(piece.t, T * np.arange(50))
    assert cleaner.regular


def test_time_in_milliseconds_with_its_unit():
    t, values = ramp()
    [piece], cleaner = clean(t * 1000, values, time_scale=1e-3)
    assert cleaner.sample_time == T
    np.testing.assert_allclose(piece.t, t)
    assert cleaner.warnings == []


@pytest.mark.parametrize(("scale", "unit"), [(1e3, "ms"), (1e6, "us"), (1e9, "ns")])
def test_time_in_another_unit_is_said(scale, unit):
    t, values = ramp()
    _, cleaner = clean(t * scale, values)
    assert f'set signals.time_unit = "{unit}"' in cleaner.warnings[0]


def test_a_given_sample_time_that_the_stamps_contradict_is_said():
    t, values = ramp()
    assert "farther apart" in clean(t * 1e3, values, sample_time=T)[1].warnings[0]
    assert "closer together" in clean(t / 1e3, values, sample_time=T)[1].warnings[0]


def test_constant_u_is_said():
    t, values = ramp()
    _, cleaner = clean(t, {**values, "u": np.full(50, 0.5)})
    assert "u is constant (0.5)" in cleaner.warnings[0]


def test_jitter_is_counted_and_kept():
    t, values = ramp()
    t[[20, 30]] += 0.2 * T
    [piece], cleaner = clean(t, values)
    assert piece.keep is None
    assert cleaner.dropped == {"jittered stamp": 4}


def test_a_log_that_is_even_in_its_first_rows_only_is_said():
    t, values = ramp(200)
    t[20:] += 0.2 * T * np.random.default_rng(0).uniform(-1, 1, 180)
    assert "most stamps are off the sample time" in clean(t, values)[1].warnings[0]


def test_a_short_hole_is_bridged_by_a_straight_line():
    t, values = ramp()
    rows = np.r_[0:20, 30:50]
    [piece], cleaner = clean(t[rows], {n: v[rows] for n, v in values.items()})
    np.testing.assert_allclose(piece.t, t, atol=1e-15)
    np.testing.assert_allclose(piece.values["u"], values["u"])
    assert (piece.keep == -1).sum() == 10
    np.testing.assert_array_equal(piece.keep[piece.keep >= 0], np.arange(40))
    assert cleaner.dropped == {"bridged": 10}


def test_a_long_hole_is_a_gap():
    t, values = ramp()
    rows = np.r_[0:20, 31:50]
    first, second = clean(t[rows], {n: v[rows] for n, v in values.items()})[0]
    assert (first.rows, second.rows) == (20, 19)
    assert second.restart
    assert not first.restart
    assert clean(t[rows], {n: v[rows] for n, v in values.items()})[1].dropped == {"gap": 1}


def test_a_duplicate_stamp_is_dropped():
    t, values = ramp()
    rows = np.r_[0:20, 19, 19, 20:50]
    [piece], cleaner = clean(t[rows], {n: v[rows] for n, v in values.items()})
    np.testing.assert_array_equal(piece.t, t)
    assert piece.rows == 52
    assert cleaner.dropped == {"duplicate stamp": 2}


def test_time_running_backwards_is_another_recording():
    t, values = ramp()
    pieces, cleaner = clean(np.r_[t, t], {n: np.r_[v, v] for n, v in values.items()})
    assert [(p.rows, p.restart) for p in pieces] == [(50, False), (50, True)]
    assert cleaner.dropped == {"restart": 1}


def test_rows_that_are_not_finite_become_holes():
    t, values = ramp()
    values["u"][20] = np.nan
    values["d_hat"][21] = np.inf
    values["u"][21] = np.nan
    t[40] = np.nan
    [piece], cleaner = clean(t, values)
    assert cleaner.dropped == {"not finite: t": 1, "not finite: u": 2, "bridged": 3}
    np.testing.assert_allclose(piece.values["u"], np.arange(50))
    np.testing.assert_allclose(piece.values["d_hat"], 2.0 * np.arange(50))


def test_not_finite_at_both_ends():
    t, values = ramp()
    values["u"][:3] = np.nan
    values["u"][-3:] = np.nan
    samples, rows, restarts, _ = flat(clean(t, values)[0])
    assert rows == list(range(3, 47))
    assert restarts == []
    assert len(samples) == 44


def test_irregular_stamps_are_used_as_they_are():
    rng = np.random.default_rng(0)
    t = np.cumsum(rng.uniform(3e-3, 5e-3, 100))
    t[60:] += 1.0
    pieces, cleaner = clean(t, {"u": rng.normal(size=100)})
    assert not cleaner.regular
    assert [p.rows for p in pieces] == [60, 40]
    np.testing.assert_array_equal(np.concatenate([p.stamps for p in pieces]), t)
    assert cleaner.dropped == {"gap": 1}


@pytest.mark.parametrize("t", [[0.0], [1.0] * 20, [np.nan] * 5, [0.0, 1e-320], [k * 1e-30 for k in range(20)]])
def test_stamps_that_do_not_advance_are_refused(t):
    with pytest.raises(DataError, match="no sample time can be found"):
        clean(np.array(t), {"u": np.zeros(len(t))})


def test_one_row_is_enough_when_the_sample_time_is_given():
    [piece], _ = clean(None, {"u": np.ones(1)}, sample_time=T)
    assert piece.t.size == 1


def test_no_rows():
    assert clean(np.empty(0), {"u": np.empty(0)})[0] == []


def test_an_asked_restart():
    t, values = ramp()
    cleaner = Cleaner(None)
    pieces = cleaner.feed(t[:10], {n: v[:10] for n, v in values.items()})
    pieces += cleaner.restart()
    pieces += cleaner.feed(t[10:], {n: v[10:] for n, v in values.items()})
    assert [(p.rows, p.restart) for p in pieces] == [(10, False), (40, True)]
    assert cleaner.dropped == {"restart": 1}


NAN, INF = float("nan"), float("inf")
steps = st.sampled_from(
    [1.0] * 12 + [1.004, 0.9, 1.3, 0.0, 0.0, 0.3, 0.45, 2.0, 1.5, 5.2, 11.4, 11.6, 50.0, -0.2, -7.0, NAN]
)
numbers = st.sampled_from([0.0, 1.0, -2.5, 3.25, 1e300, NAN, INF]) | st.floats(-10, 10)


def log_of(rows):
    step, u, d = (np.array(column) for column in zip(*rows, strict=True))
    t = T * np.cumsum(np.where(np.isnan(step), 1.0, step))
    return np.where(np.isnan(step), np.nan, t), {"u": u, "d_hat": d}


@settings(max_examples=400, deadline=None)
@given(
    rows=st.lists(st.tuples(steps, numbers, numbers), min_size=1, max_size=80),
    clean_head=st.integers(0, 20),
    cuts=st.lists(st.integers(0, 200), max_size=12),
    sample_time=st.sampled_from([None, T]),
    with_time=st.booleans(),
)
def test_the_cut_into_batches_never_matters(rows, clean_head, cuts, sample_time, with_time):
    t, values = log_of([(1.0, float(k), 0.0) for k in range(clean_head)] + rows)
    if not with_time:
        t, sample_time = None, T
    results = []
    for chosen in ((), cuts, range(len(values["u"]))):
        try:
            pieces, cleaner = clean(t, values, chosen, sample_time=sample_time)
        except DataError as error:
            results.append(str(error))
            continue
        state = (list(cleaner.dropped.items()), cleaner.warnings, cleaner.sample_time, cleaner.regular)
        results.append((flat(pieces), state))
        assert sum(piece.rows for piece in pieces) == len(values["u"])
    assert results[0] == results[1] == results[2]


@settings(max_examples=200, deadline=None)
@given(rows=st.lists(st.tuples(steps, numbers, numbers), min_size=1, max_size=80))
def test_every_sample_of_a_regular_log_follows_the_one_before(rows):
    t, values = log_of(rows)
    pieces, _ = clean(t, values, sample_time=T)
    samples, _, restarts, _ = flat(pieces)
    stamps = np.array([sample[0] for sample in samples])
    jumps = set((np.flatnonzero((np.diff(stamps) <= 0.5 * T) | (np.diff(stamps) >= 1.5 * T)) + 1).tolist())
    assert jumps <= set(restarts)
