"""A quick scan promises the gain that least squares of the explicit rows give."""

import numpy as np
import pytest
from scipy.optimize import nnls

from dsd_cli.identify.fit.bank import Term
from dsd_cli.identify.search.scan import Scan
from tests.identify.search_rig import posed

HIDDEN = {"coulomb_friction": {"level": 0.08}, "gravity": {"amplitude": 0.1, "phase": 0.4}}
BESIDE = (Term("coulomb_friction"), Term("constant_load"))


@pytest.fixture(scope="module")
def search():
    return posed(HIDDEN, ())


def _squares(search, terms, tap):
    """Of the forward form: the acceleration on the drive and all columns, by `lstsq`."""
    drive, acceleration, *others = search.solver.bank.design(terms, tap).rows
    target = search.solver.inertia * acceleration
    x = np.stack([drive, *others])
    x = x / np.linalg.norm(x, axis=1)[:, None]
    theta, *_ = np.linalg.lstsq(x.T, target, rcond=None)
    return float(np.sum((target - theta @ x) ** 2))


def _scan(search, terms, tap, taps=None):
    return Scan(search.solver, terms, tap, lambda term, near: taps or [near])


@pytest.mark.parametrize("terms", [(), BESIDE], ids=["bare", "beside two"])
@pytest.mark.parametrize(
    "term",
    [
        Term("viscous_friction"),
        Term("stiffness"),
        Term("gravity"),
        Term.of("cogging", {"periods": 9.0}),
        Term.of("periodic_disturbance", {"frequency": 3.3}),
    ],
    ids=lambda t: t.id,
)
def test_the_gain_of_columns_is_that_of_least_squares(search, terms, term):
    tap = search.refit.tap
    gain, found = _scan(search, terms, tap).gain(term)
    wanted = _squares(search, terms, tap) - _squares(search, (*terms, term), tap)
    signed = _coefficient(search, (*terms, term), tap)
    if signed is not None and signed < 0.0:
        wanted = 0.0  # a negative damping is none
    assert found == tap
    assert gain == pytest.approx(wanted, rel=1e-4, abs=1e-6 * _squares(search, terms, tap))


def _coefficient(search, terms, tap):
    """Of the last effect in the inverse sense, if it has one that must not be negative; else None."""
    design = search.solver.bank.design(terms, tap)
    if design.widths[-1] != 1 or not design.signed[-1]:
        return None
    drive, acceleration, *others = design.rows
    theta, *_ = np.linalg.lstsq(np.stack([drive, *others]).T, acceleration, rcond=None)
    return -theta[-1] * np.sign(theta[0])


def test_the_gain_of_a_lag_is_that_of_least_squares_at_the_best_of_the_delays(search):
    tap = search.refit.tap + 3  # too late, so that the lag asks for another delay
    taps = list(range(tap + 1))
    term = Term.of("actuator_lag", {"time_constant": 0.004})
    gain, found = _scan(search, (), tap, taps).gain(term)
    bank, before = search.solver.bank, _squares(search, (), tap)
    target, left = search.solver.inertia * bank.acceleration, {}
    for n in taps:  # u drives, and a share of a further step takes of it: both have their sign
        own, further = bank.drive((term,), n), bank.drive((term,), n + 1)
        _, rest = nnls(np.stack([own, further - own]).T, target)
        left[n] = rest**2
    best = min(left, key=left.get)
    assert found == best != tap
    assert gain == pytest.approx(before - left[best], rel=1e-4, abs=1e-6 * before)


def test_the_first_friction_is_judged_on_its_own_rows(search):
    """It takes the forces off where the axis rests, and the squares of the fit say what that is worth."""
    tap, term = search.refit.tap, Term("coulomb_friction")
    gain, _ = _scan(search, (), tap).gain(term)
    held = _squares(search, (term,), tap)
    assert gain == pytest.approx(_squares(search, (), tap) - held, rel=2e-2)


def test_what_is_there_already_gains_nothing(search):
    tap = search.refit.tap
    gain, _ = _scan(search, BESIDE, tap).gain(Term("constant_load"))
    assert gain == pytest.approx(0.0, abs=1e-6 * _squares(search, BESIDE, tap))


def test_the_true_effect_gains_most(search):
    """Beside friction, gravity is what is left; its rivals over the position gain less."""
    scan = _scan(search, (Term("coulomb_friction"),), search.refit.tap)
    gains = {name: scan.gain(Term(name))[0] for name in ("gravity", "stiffness", "constant_load", "viscous_friction")}
    assert max(gains, key=gains.get) == "gravity"


def test_a_gain_is_made_once_for_all_scans_beside_the_same_effects(search, monkeypatch):
    made, gain_of = [], Scan._gain_of_columns
    monkeypatch.setattr(Scan, "_gain_of_columns", lambda *arguments: made.append(1) or gain_of(*arguments))
    term, tap = Term.of("cogging", {"periods": 7.5}), search.refit.tap
    gains = [search.scan(terms, tap).gain(term) for terms in (BESIDE, BESIDE, BESIDE[:1])]
    assert gains[0] == gains[1] != gains[2]
    assert len(made) == 2


def test_in_place_of_a_member_only_other_laws_are_looked_at(monkeypatch):
    """Itself, and lines in time, are no answer there: their columns need not be made."""
    hidden = {"coulomb_friction": {"level": 0.08}, "viscous_friction": {"coefficient": 0.03}}
    search = posed(hidden, ("viscous_friction", "quadratic_drag", "coulomb_friction", "periodic_disturbance"))
    asked, gain = [], Scan.gain
    monkeypatch.setattr(Scan, "gain", lambda scan, term, keep=False: asked.append(term.id) or gain(scan, term, keep))
    rest = search.fit((Term("coulomb_friction"),), search.refit.tap)
    assert search.challenger(rest, "viscous_friction", 0.0).effect == "quadratic_drag"
    assert set(asked) == {"quadratic_drag"}
    search.options(rest)
    assert set(asked) == {"quadratic_drag", "viscous_friction", "periodic_disturbance"}
