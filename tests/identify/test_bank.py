"""Columns of the bank: made once, by the law of the effect, at the delay that reaches the plant."""

from dataclasses import replace

import numpy as np
import pytest

from dsd_cli.identify.fit.bank import Bank, Term, drive, inputs_of, ranges, raw_columns
from dsd_cli.identify.fit.rows import Equations
from dsd_cli.identify.recordings.recording import prepare
from dsd_cli.signals.log import Log
from tests.identify.comparison_rig import MOVES, OBSERVER, T, recorded

STARTUP = 40


@pytest.fixture(scope="module")
def equations():
    return Equations([recorded(duration=4.0), recorded(reference=MOVES, duration=3.0)], OBSERVER, STARTUP)


def test_the_drive_is_the_command_so_many_samples_earlier(equations):
    for stretch, found in zip(equations.stretches, drive(equations, (), 3), strict=True):
        u = stretch.log["u"]
        np.testing.assert_array_equal(found, [u[max(k - 1 - 3, 0)] for k in range(len(u))])


def test_a_dead_zone_changes_the_drive_before_its_delay(equations):
    term = Term.of("dead_zone", {"width": 0.1})
    for stretch, found in zip(equations.stretches, drive(equations, (term,), 2), strict=True):
        u = stretch.log["u"]
        wanted = [0.0 if abs(x) <= 0.1 else x - 0.1 * np.sign(x) for x in u]
        np.testing.assert_allclose(found[4:], wanted[1:-3], atol=1e-12)


def test_columns_follow_their_laws_row_by_row(equations):
    laws = {
        "viscous_friction": lambda v, q, s: -v,
        "viscous_asymmetry": lambda v, q, s: -abs(v),
        "quadratic_drag": lambda v, q, s: -abs(v) * v,
        "coulomb_friction": lambda v, q, s: -s,
        "stiffness": lambda v, q, s: -q,
        "cubic_stiffness": lambda v, q, s: -(q**3),
        "constant_load": lambda v, q, s: 1.0,
    }
    for name, law in laws.items():
        (column,) = raw_columns(equations, Term(name), 0)
        for stretch, found in zip(equations.stretches, column, strict=True):
            v, q = stretch.log["velocity"], stretch.log["position"]
            for k in np.flatnonzero(stretch.keep)[::37]:
                mean_v, mean_q = 0.5 * (v[k] + v[k - 1]), 0.5 * (q[k] + q[k - 1])
                assert found[k] == pytest.approx(law(mean_v, mean_q, np.sign(mean_v)), abs=1e-9), name


def test_every_column_is_made_once_and_the_delay_counts_only_where_u_is_looked_at(equations, monkeypatch):
    bank, made = Bank(equations), []
    rows = Equations.rows
    monkeypatch.setattr(Equations, "rows", lambda self, raw: made.append(1) or rows(self, raw))
    first = bank.columns(Term("viscous_friction"), 0)
    assert bank.columns(Term("viscous_friction"), 5) is first
    assert len(made) == 1
    bank.columns(Term("load_friction"), 0)
    bank.columns(Term("load_friction"), 5)
    bank.columns(Term("load_friction"), 5)
    assert len(made) == 3
    bank.drive((), 1)
    bank.drive((), 1)
    bank.drive((), 2, keep=False)
    bank.drive((), 2, keep=False)
    assert len(made) == 6


def test_equal_shapes_are_equal_terms_whatever_their_order():
    one, other = Term.of("x", {"a": 1.0, "b": 2.0}), Term.of("x", {"b": 2.0, "a": 1.0})
    assert one == other
    assert hash(one) == hash(other)
    assert one.shape == {"a": 1.0, "b": 2.0}
    assert Term.of("x", {"a": 1.5, "b": 2.0}) != one


def test_effects_on_the_command_are_told_apart():
    terms = (Term("coulomb_friction"), Term.of("dead_zone", {"width": 1.0}), Term("gravity"))
    assert inputs_of(terms) == terms[1:2]


def test_ranges_are_those_of_the_rows_that_move(equations):
    found = ranges(equations)
    logs = [s.log for s in equations.stretches]
    assert found.top_drive == max(float(np.abs(log["u"]).max()) for log in logs)
    assert found.travel == max(float(np.ptp(log["position"])) for log in logs)
    assert found.duration == pytest.approx(7.0)
    assert found.sample_time == T
    assert 0.0 < found.speed < found.top_speed <= max(float(np.abs(log["velocity"]).max()) for log in logs)


def test_a_load_is_an_acceleration_times_the_nominal_inertia():
    """A load that follows stiffly has the acceleration of the motor."""
    recording = recorded(duration=4.0, noise=0.0)
    equations = Equations([recording], OBSERVER, STARTUP)
    (column,) = raw_columns(equations, Term.of("flexible_coupling", {"frequency": 60.0, "damping": 1.0}), 0)
    (stretch,) = equations.stretches
    motor = np.gradient(stretch.log["velocity"], T)
    load = -column[0] / OBSERVER.nominal_inertia
    assert np.corrcoef(load[60:], motor[60:])[0, 1] > 0.95
    assert np.std(load[60:]) == pytest.approx(np.std(motor[60:]), rel=0.15)


def test_a_log_without_position_has_no_columns_of_nan():
    log = recorded(duration=3.0).pieces[0]
    without = Log({n: x for n, x in log.channels.items() if n not in ("position", "turning")}, T, "x")
    recording = prepare(without, OBSERVER)
    blind = replace(
        recording,
        pieces=tuple(
            replace(p, channels={n: x for n, x in p.channels.items() if n != "position"}) for p in recording.pieces
        ),
    )
    (column,) = raw_columns(Equations([blind], OBSERVER, STARTUP), Term("viscous_friction"), 0)
    assert np.isfinite(column[0]).all()
