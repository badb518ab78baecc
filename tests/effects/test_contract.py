"""The contract that every effect of the catalogue keeps; new files are found by themselves."""

import numpy as np
import pytest

from dsd_cli.effects import Channels, Role, catalogue, get_effect
from dsd_cli.errors import UsageError

EFFECTS = list(catalogue().values())


def values_of(effect):
    return {p.name: float(np.clip(0.7, p.lower, p.upper)) for p in effect.parameters}


def log_channels(n=50):
    rng = np.random.default_rng(0)
    return Channels(np.arange(n) * 1e-3, *rng.standard_normal((3, n)))


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

    def test_has_a_column_per_linear_parameter(self, effect):
        columns = effect.columns(log_channels(), values_of(effect))
        assert len(columns) == sum(p.linear for p in effect.parameters)
        for column in columns:
            assert np.shape(column) == (50,)
            assert np.all(np.isfinite(column))

    def test_one_instant_and_a_whole_log_are_the_same_function(self, effect):
        channels, values = log_channels(), values_of(effect)
        force = effect.force(channels, values)
        for k in range(50):
            at = Channels(*(float(channel[k]) for channel in channels))
            assert float(effect.force(at, values)) == pytest.approx(force[k], rel=1e-12, abs=1e-12)

    def test_a_friction_is_a_budget(self, effect):
        if effect.role is Role.FRICTION:
            assert np.all(effect.force(log_channels(), values_of(effect)) >= 0.0)

    def test_looks_only_at_the_channels_that_it_needs(self, effect):
        """A channel that is not in the log is NaN and must not leak; t and u are always there."""
        channels = log_channels()
        missing = {c: np.full(50, np.nan) for c in ("velocity", "position") if c not in effect.needs}
        values = values_of(effect)
        np.testing.assert_array_equal(
            effect.force(channels._replace(**missing), values), effect.force(channels, values)
        )


def test_unknown_effects_are_refused_with_the_known_ones():
    with pytest.raises(UsageError, match="viscous_friction"):
        get_effect("glue")
