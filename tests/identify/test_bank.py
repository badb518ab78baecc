"""Columns of the bank: made once, by the law of the effect, at the delay that reaches the plant."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from dsd_cli.identify.fit import bank as bank_module
from dsd_cli.identify.fit.band import band_of
from dsd_cli.identify.fit.bank import FIXED, INERTIA, Bank, Term, commands, drive, has_friction, inputs_of, raw_columns
from dsd_cli.identify.fit.equations import Equations, equations_of
from dsd_cli.identify.fit.testability import ranges
from dsd_cli.identify.recordings.recording import prepare
from dsd_cli.plant.prediction import Frame
from dsd_cli.signals.log import Log
from tests.identify.comparison_rig import MOVES, OBSERVER, T, recorded

STARTUP = 40
LOAD = Term.of("flexible_coupling", {"frequency": 30.0, "damping": 0.05})


@pytest.fixture(scope="module")
def equations():
    return equations_of([recorded(duration=4.0), recorded(reference=MOVES, duration=3.0)], STARTUP)


def test_the_drive_is_the_command_so_many_samples_earlier(equations):
    for stretch, found in zip(equations.stretches, drive(equations, (), 3 * T), strict=True):
        u = stretch.log["u"]
        np.testing.assert_array_equal(found, [u[max(k - 1 - 3, 0)] for k in range(len(u))])


def test_what_lies_between_two_steps_of_delay_is_a_mix_of_both():
    """A sine at the end of the band, a delay of two and a half steps: the mean of both rows, to a thousandth of it."""
    for hz in (2.0, 25.0):
        recording = recorded(duration=6.0)
        bank = Bank(equations_of([recording], STARTUP, band_of(hz, T)))
        (stretch,) = bank.equations.stretches
        sine = np.sin(2.0 * np.pi * hz * stretch.log["t"])
        stretch = replace(stretch, log=replace(stretch.log, channels={**stretch.log.channels, "u": sine}))
        stretch = replace(stretch, frame=Frame(stretch.log))
        bank = Bank(replace(bank.equations, stretches=(stretch,)))
        exact = bank.equations.acting(drive(bank.equations, (), 2.5 * bank.tap_time), smooth=False, held=False)
        mixed = 0.5 * (bank.drive((), 2) + bank.drive((), 3))
        assert np.abs(mixed - exact).max() < 1e-3 * np.abs(exact).max()
        late = bank.drive((), 12)
        assert np.abs(late - exact).max() > 0.05 * np.abs(exact).max(), "else delays do not matter here"


def test_what_looks_at_u_does_so_at_the_very_delay_of_the_drive(equations):
    """Load friction at a whole step, beside a drive between two, leant the delay by its own share of the rest."""
    term, bank = Term("load_friction"), Bank(equations)
    for around in (0.4, 0.0):
        *_, column = bank.between(around).design((term,), 3).rows
        raw = raw_columns(equations, term, (3 + around) * bank.tap_time)[0]
        np.testing.assert_allclose(column, equations.acting(raw, smooth=False, held=True), atol=1e-12)
    *_, column = bank.design((term,), 3).rows
    raw = raw_columns(equations, term, 3 * bank.tap_time)[0]
    np.testing.assert_allclose(column, equations.acting(raw, smooth=False, held=True), atol=1e-12)


def test_a_dead_zone_changes_the_drive_before_its_delay(equations):
    term = Term.of("dead_zone", {"width": 0.1})
    for stretch, found in zip(equations.stretches, drive(equations, (term,), 2 * T), strict=True):
        u = stretch.log["u"]
        wanted = [0.0 if abs(x) <= 0.1 else x - 0.1 * np.sign(x) for x in u]
        np.testing.assert_allclose(found[4:], wanted[1:-3], atol=1e-12)


def test_columns_follow_their_laws_interval_by_interval():
    """What a coefficient takes of the drive: its mean over each interval of a motion that is known at any time."""
    tones = ((1.3, 1.1, 0.2), (3.7, 0.5, 1.4), (7.9, 0.2, 2.9))  # Hz, rad/s, rad

    def speed(t):
        return sum(a * np.cos(2 * np.pi * f * t + p) for f, a, p in tones)

    def place(t):
        return sum(a / (2 * np.pi * f) * np.sin(2 * np.pi * f * t + p) for f, a, p in tones)

    t = T * np.arange(2000)
    log = Log({"t": t, "u": np.sin(9.0 * t), "velocity": speed(t), "position": place(t)}, T, "x")
    equations = equations_of([prepare(log, OBSERVER)], STARTUP)
    between = t[:, None] - T * (np.arange(40) + 0.5) / 40  # of the interval that ends at each sample
    v, q = speed(between), place(between)
    laws = {
        "viscous_friction": v,
        "viscous_asymmetry": np.abs(v),
        "quadratic_drag": np.abs(v) * v,
        "stiffness": q,
        "cubic_stiffness": q**3,
        "constant_load": -1.0 + 0.0 * v,
        "coulomb_friction": np.sign(v),
    }
    for name, law in laws.items():
        ((found,),) = raw_columns(equations, Term(name), 0.0)
        wanted = law.mean(axis=1)
        clear = (np.abs(v) > 0.05).all(axis=1)  # where it turns an interval has both signs
        clear[:40] = clear[-40:] = False
        assert clear.sum() > 1500
        np.testing.assert_allclose(found[clear], wanted[clear], atol=1e-4 * np.abs(wanted).max(), err_msg=name)


def _counted(method, made):
    return lambda *a, **k: made.append(1) or method(*a, **k)


def test_every_column_is_made_once_and_the_delay_counts_only_where_u_is_looked_at(equations, monkeypatch):
    bank, made = Bank(equations), []
    for name in ("acting", "commanded"):
        monkeypatch.setattr(Equations, name, _counted(getattr(Equations, name), made))
    first = bank.columns(Term("viscous_friction"), 0)
    assert bank.columns(Term("viscous_friction"), 5) is first
    assert len(made) == 1
    bank.columns(Term("load_friction"), 0)
    bank.columns(Term("load_friction"), 5)
    bank.columns(Term("load_friction"), 5)
    assert len(made) == 3
    bank.drive((), 1)
    bank.drive((), 1)
    for tap in (2, 3, 3, 2):
        bank.drive((), tap, keep=False)
    assert len(made) == 7, "of those that are not kept the last one is there"
    bank.columns(Term("viscous_friction"), 0, held=True)
    assert len(made) == 8, "beside friction the rests count as nothing: another column"


def test_a_design_is_the_drive_the_acceleration_a_further_step_and_the_columns(equations):
    bank, terms = Bank(equations), (Term("gravity"), Term("viscous_friction"), Term.of("dead_zone", {"width": 0.1}))
    design = bank.design(terms, 2)
    inputs = terms[2:]
    now, later = bank.drive(inputs, 2), bank.drive(inputs, 3)
    wanted = [now, equations.acceleration(), now - later, *bank.columns(terms[0], 2), *bank.columns(terms[1], 2)]
    assert len(design.rows) == len(wanted)
    for found, row in zip(design.rows, wanted, strict=True):
        np.testing.assert_array_equal(found, row)
    assert design.widths == (2, 1, 0)
    assert design.signed == [True, True, False, False, True]


def test_columns_beside_friction_count_as_nothing_at_rest():
    equations = equations_of([recorded(reference=MOVES, duration=3.0, noise=0.0)], STARTUP)
    (stretch,) = equations.stretches
    assert 0.03 < np.mean(stretch.free == 0.0) < 0.9
    bank, gravity, friction = Bank(equations), Term("gravity"), Term("coulomb_friction")
    assert has_friction((gravity, friction))
    assert not has_friction((gravity,))
    for at, raw in enumerate(raw_columns(equations, gravity, 0.0)):
        with_friction = bank.design((friction, gravity), 0).rows[1 + FIXED + 1 + at]
        alone = bank.design((gravity,), 0).rows[1 + FIXED + at]
        np.testing.assert_array_equal(with_friction, equations.acting([raw[0] * stretch.free], True, False))
        np.testing.assert_array_equal(alone, equations.acting(raw, True, False))


def test_a_whitened_bank_has_the_rows_of_the_plain_one_whitened(equations):
    taps = np.array([-0.2, 0.1, 1.0, 0.1, -0.2])
    taps = np.pad(taps, 10)
    plain = Bank(equations)
    white = Bank(equations.with_whitening(taps, 2.0 * taps), plain, 0.5)
    terms = (Term("viscous_friction"), Term.of("dead_zone", {"width": 0.1}))
    for row, found in zip(plain.design(terms, 1).rows, white.design(terms, 1).rows, strict=True):
        np.testing.assert_allclose(found, white.equations.whitened(row), atol=1e-12)
    noise = white.design(terms, 1).noise
    assert noise[INERTIA, INERTIA] == 0.5
    assert np.count_nonzero(noise) == 1


@pytest.mark.parametrize("around", [None, 0.0, 0.37])
def test_weighed_rows_are_the_white_ones_times_their_weights(equations, around):
    """Whether they are made of the white rows or anew, and so are those of the drive between steps of delay."""
    plain, taps = Bank(equations), np.pad([-0.2, 0.1, 1.0, 0.1, -0.2], 10)
    white = Bank(equations.with_whitening(taps, 2.0 * taps), plain, 0.5)
    weight = np.linspace(0.0, 1.0, sum(equations.lengths))
    banks = white.weighing(weight, 0.3), Bank(replace(white.equations, row_weight=weight), plain, 0.3)
    terms = (Term("coulomb_friction"), LOAD, Term.of("dead_zone", {"width": 0.1}))
    found, direct = (one if around is None else one.between(around) for one in banks)
    for row, expected in zip(found.design(terms, 1).rows, direct.design(terms, 1).rows, strict=True):
        np.testing.assert_allclose(row, expected, atol=1e-12)
    np.testing.assert_allclose(found.design(terms, 1).noise, direct.design(terms, 1).noise, rtol=1e-9)


def test_a_drive_between_samples_is_that_of_the_command_so_late(equations):
    """Delays between the same samples are put together from parts that are kept, of one command after the other."""
    plain = Bank(equations)
    taps = np.pad([-0.3, 1.0, -0.3], 11)
    coloured = equations.with_whitening(taps, taps)
    white = Bank(coloured, plain)
    late, dead = (), (Term.of("dead_zone", {"width": 0.1}),)
    for tap, inputs, held in ((2.3, late, False), (2.6, late, False), (2.6, dead, True), (2.3, late, True)):
        expected = equations.commanded(commands(equations, inputs), tap * plain.tap_time, held)
        np.testing.assert_allclose(plain.drive(inputs, tap, held=held), expected, atol=1e-12)
        np.testing.assert_allclose(white.drive(inputs, tap, held=held), coloured.whitened(expected), atol=1e-12)


def test_the_noise_that_a_load_takes_over_is_what_its_filter_makes_of_it():
    """Noise of the sensor is in the load's column, too; by how much, and how alike, is tried with 40 draws."""
    recording = recorded(duration=4.0, noise=0.0)
    band = band_of(40.0, T)
    base = equations_of([recording], STARTUP, band)
    variance, rng = 1.0, np.random.default_rng(3)
    design = Bank(base, variance=variance).design((LOAD,), 0)
    (plain,) = Bank(base).columns(LOAD, 0)
    found = []
    for _ in range(40):
        (stretch,) = base.stretches
        noise = recording.sensor.noise.made(len(stretch.log), rng)
        speeds = np.cumsum(noise) * T
        mean = np.concatenate([[0.0], speeds[:-1]]) if stretch.two_intervals else speeds - 0.5 * noise * T
        velocity, position = stretch.sensed.motion
        ends = np.cumsum(mean) * T - 0.5 * mean * T
        moved = SimpleNamespace(motion=(velocity + mean, position + ends))
        (noisy,) = Bank(replace(base, stretches=(replace(stretch, sensed=moved),))).columns(LOAD, 0)
        own, a = noisy - plain, base.plain([noise])
        found.append([own @ own / (a @ a), own @ a / (a @ a)])
    mean, error = np.mean(found, axis=0), np.std(found, axis=0)
    assert abs(design.noise[FIXED, FIXED] - mean[0]) < 4.0 * error[0]
    assert abs(design.noise[INERTIA, FIXED] - mean[1]) < 4.0 * error[1]
    assert design.noise[INERTIA, INERTIA] == variance
    assert error[1] < 0.5 * abs(mean[1]), "else nothing was tested"


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
    u = np.sort(np.abs(np.concatenate([log["u"] for log in logs])))
    assert u[int(0.985 * len(u))] <= found.top_drive <= u[int(0.995 * len(u))], "one spike does not count"
    assert found.drive == pytest.approx(float(np.sqrt(np.mean(u**2))))
    assert found.travel == max(float(np.ptp(log["position"])) for log in logs)
    assert found.duration == pytest.approx(7.0)
    assert found.sample_time == T
    assert 0.0 < found.speed < found.top_speed <= 1.01 * max(float(np.abs(log["velocity"]).max()) for log in logs)


def test_a_load_is_an_acceleration():
    """A load that follows stiffly has the acceleration of the motor, in its sense: the sum of both inertias is J."""
    equations = equations_of([recorded(duration=4.0, noise=0.0)], STARTUP)
    bank = Bank(equations)
    (load,) = bank.columns(Term.of("flexible_coupling", {"frequency": 60.0, "damping": 1.0}), 0)
    motor = equations.acceleration()
    assert np.corrcoef(load[5:], motor[5:])[0, 1] > 0.95
    assert np.std(load[5:]) == pytest.approx(np.std(motor[5:]), rel=0.15)


def test_a_log_without_position_has_no_columns_of_nan():
    log = recorded(duration=3.0).pieces[0]
    kept = {n: x for n, x in log.channels.items() if n not in ("position", "turning", "acceleration")}
    recording = prepare(Log(kept, T, "x"), OBSERVER)
    pieces = tuple(
        replace(p, channels={n: x for n, x in p.channels.items() if n != "position"}) for p in recording.pieces
    )
    equations = equations_of([replace(recording, pieces=pieces)], STARTUP)
    (column,) = raw_columns(equations, Term("viscous_friction"), 0.0)
    assert np.isfinite(column[0]).all()
    assert all(np.isfinite(row).all() for row in Bank(equations).design((Term("viscous_friction"),), 1).rows)


@pytest.mark.parametrize("held", [False, True])
def test_events_are_columns_of_their_own_wherever_their_edges_were_before(equations, held):
    """One after the other is moved, one twice the same: as if each list had been the first that was asked for."""
    bank, t = Bank(equations), equations.stretches[0].log["t"]
    edges = [(t[400] + 1e-4, t[450]), (t[600], t[700] + 3e-4), (t[800], t[900])]
    for moved in (edges, [edges[0], (t[605], t[700]), edges[2]], [edges[2], edges[0]], [edges[0], edges[0]]):
        found = bank.columns(Term.of("external_force", {"edges": tuple(moved)}), 0, keep=False, held=held)
        alone = [Term.of("external_force", {"edges": (edge,)}) for edge in moved]
        np.testing.assert_array_equal(found, [Bank(equations).columns(e, 0, held=held)[0] for e in alone])


def test_a_shape_of_late_is_not_made_anew_and_those_of_long_ago_are_gone(equations, monkeypatch):
    """Searches beside other effects ask for the same ones; all that were ever asked for would not fit into memory."""
    made, columns_of = [], bank_module.columns_of
    monkeypatch.setattr(bank_module, "columns_of", lambda *asked: made.append(asked[1]) or columns_of(*asked))
    plain = Bank(equations)
    monkeypatch.setattr(bank_module, "_RECENT", 3 * len(plain.acceleration))
    white = Bank(equations.with_whitening(*2 * [np.array([2.0])]), plain)
    shapes = [Term.of("cogging", {"periods": 3.0 + i}) for i in range(4)]
    first = white.columns(shapes[0], 2, keep=False)
    for term in shapes[:3]:
        wanted = [2.0 * x for x in columns_of(equations, term, 0.0, False)]
        np.testing.assert_array_equal(white.columns(term, 2, keep=False), wanted)
    assert made == shapes[:3]
    white.columns(shapes[3], 2, keep=False)
    np.testing.assert_array_equal(white.columns(shapes[0], 2, keep=False), first)
    assert made == [*shapes, shapes[0]]
