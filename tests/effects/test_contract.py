"""The contract that every effect of the catalogue keeps; new files are found by themselves."""

import importlib
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dsd_cli.effects import Channels, Ranges, Role, catalogue, get_effect
from dsd_cli.errors import UsageError

EFFECTS = list(catalogue().values())
PULSES = [{"start": 0.005, "end": 0.0123, "force": 0.4}, {"start": 0.02, "end": 0.03, "force": -1.0}]
N = 50
RANGES = Ranges(speed=1.0, top_speed=2.0, travel=3.0, drive=0.5, top_drive=1.0, sample_time=1e-3, duration=10.0)


def values_of(effect):
    return {p.name: PULSES if p.listed else float(np.clip(0.7, p.lower, p.upper)) for p in effect.parameters}


def log_channels(n=N):
    rng = np.random.default_rng(0)
    return Channels(np.arange(n) * 1e-3, *rng.standard_normal((3, n)), np.full(n, 1e-3))


def at(channels, k):
    return Channels(*(float(channel[k]) for channel in channels[:5]))


def run(effect, channels, state=None):
    return effect.run(channels, effect.to_columns(values_of(effect))[1], state)


def test_the_whole_table_is_there():
    assert sum(1 for effect in EFFECTS) >= 19


@pytest.mark.parametrize("effect", EFFECTS, ids=lambda e: e.id)
class TestEveryEffect:
    def test_says_what_it_is(self, effect):
        for text in (effect.id, effect.law, effect.summary, effect.pattern):
            assert text.strip()
        for p in effect.parameters:
            assert p.name.isidentifier()
            assert p.meaning.strip()
            assert p.lower < p.upper
        assert set(effect.needs) <= set(Channels._fields)
        assert len({p.name for p in effect.parameters}) == len(effect.parameters)

    def test_has_a_column_per_coefficient(self, effect):
        coefficients, _ = effect.to_columns(values_of(effect))
        columns, _ = run(effect, log_channels())
        if effect.role is Role.INPUT:
            assert coefficients == ()
        assert len(columns) == (1 if effect.role is Role.INPUT else len(coefficients))
        for column in columns:
            assert np.shape(column) == (N,)
            assert np.all(np.isfinite(column))

    def test_one_row_after_the_other_and_a_whole_log_are_the_same_function(self, effect):
        channels, state = log_channels(), None
        whole, last = run(effect, channels)
        for k in range(N):
            single, state = run(effect, at(channels, k), state)
            for a, b in zip(single, whole, strict=True):
                assert np.ndim(a) == 0
                assert float(a) == pytest.approx(b[k], rel=1e-11, abs=1e-11)
        if effect.memory:
            assert state == pytest.approx(last, rel=1e-11)

    def test_a_log_can_be_cut_anywhere(self, effect):
        channels = log_channels()
        whole, last = run(effect, channels)
        for cut in (0, 1, 17, N):
            first, state = run(effect, Channels(*(c[:cut] for c in channels[:5])))
            second, end = run(effect, Channels(*(c[cut:] for c in channels[:5])), state if cut else None)
            for a, b, c in zip(first, second, whole, strict=True):
                np.testing.assert_array_equal(np.concatenate([a, b]), c)
            assert end == last

    def test_a_friction_is_a_budget(self, effect):
        if effect.role is Role.FRICTION:
            assert np.all(effect.force(log_channels(), values_of(effect))[0] >= 0.0)

    def test_looks_only_at_the_channels_that_it_needs(self, effect):
        """A channel that is not in the log is NaN and must not leak; t and u are always there, and with the position
        the speed is."""
        channels = log_channels()
        known = {"velocity"} if "position" in effect.needs else set()
        missing = {c: np.full(N, np.nan) for c in ("velocity", "position") if c not in {*effect.needs, *known}}
        for a, b in zip(run(effect, channels._replace(**missing))[0], run(effect, channels)[0], strict=True):
            np.testing.assert_array_equal(a, b)

    def test_no_memory_means_no_memory(self, effect):
        if not effect.memory:
            order = np.random.default_rng(1).permutation(N)
            shuffled, state = run(effect, Channels(*(c[order] for c in log_channels()[:5])))
            assert state is None
            for a, b in zip(shuffled, run(effect, log_channels())[0], strict=True):
                np.testing.assert_array_equal(a, b[order])

    def test_starts_are_shapes_that_the_columns_take(self, effect):
        for shape in effect.starts(RANGES):
            (column, *_), _ = effect.run(log_channels(), shape)
            assert np.all(np.isfinite(column))
            searched = {p.name for p in effect.parameters if not p.linear and not p.listed}
            assert len(shape) == len(searched)

    def test_no_start_where_the_log_shows_nothing(self, effect):
        """Neither motion nor command: no shape of 0 or NaN."""
        for nothing in (0.0, float("nan")):
            for shape in effect.starts(Ranges(nothing, nothing, nothing, nothing, nothing, 1e-3, 10.0)):
                assert all(np.isfinite(value) and value > 0.0 for value in shape.values())

    @settings(max_examples=40, deadline=None)
    @given(data=st.data(), inertia=st.floats(0.1, 10.0))
    def test_join_undoes_split(self, effect, data, inertia):
        pulse = st.fixed_dictionaries({"start": st.floats(0, 1), "end": st.floats(2, 3), "force": st.floats(-5, 5)})
        given_values = {
            p.name: data.draw(
                st.lists(pulse, max_size=3)
                if p.listed
                else st.floats(
                    max(p.lower, 0.01 if p.lower >= 0 else -3.0), min(p.upper, 0.99 if p.upper == 1 else 3.0)
                )
            )
            for p in effect.parameters
        }
        given_values = {k: min(v, 0.99) if k == "load_share" else v for k, v in given_values.items()}
        coefficients, shape = effect.to_columns(given_values, inertia)
        back = effect.from_columns(coefficients, shape, inertia)
        assert list(back) == [p.name for p in effect.parameters]
        for name, value in given_values.items():
            if name == "phase":
                assert np.cos(back[name] - value) == pytest.approx(1.0)
            elif isinstance(value, list):
                assert back[name] == value
            else:
                assert back[name] == pytest.approx(value)


def test_unknown_effects_are_refused_with_the_known_ones():
    with pytest.raises(UsageError, match="viscous_friction"):
        get_effect("glue")


def test_a_compiled_part_that_does_not_load_takes_no_effect_away(monkeypatch):
    found = importlib.import_module("dsd_cli.effects.catalogue")
    monkeypatch.setitem(sys.modules, "dsd_cli.effects._memory", None)  # its import raises, as of another platform
    assert set(found._own.__wrapped__()) == set(found._own())
