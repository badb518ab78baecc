"""What the user knows of values: fits that hold it, against plain least squares on the same rows."""

import math

import numpy as np
import pytest

from dsd_cli.effects import get_effect
from dsd_cli.identify.fit.bank import INERTIA, SHARE, Term
from dsd_cli.identify.fit.priors import PriorKnowledge, is_shape
from dsd_cli.identify.fit.problem import Settings, pose
from dsd_cli.identify.fit.solve import Solver
from dsd_cli.identify.fit.values import flat, terms_of
from dsd_cli.identify.search.sets import Search
from dsd_cli.identify.verdict.contradictions import contradictions
from dsd_cli.plant.model import PlantModel
from tests.identify.search_rig import BELIEVED, posed, seen
from tests.identify.test_values import COVERED, DELAY, J, _log, _noisy, _solver

EFFECTS = {"viscous_friction": {"coefficient": 0.02}, "gravity": {"amplitude": 0.3, "phase": 0.4}}
MODEL = PlantModel(BELIEVED.inertia, BELIEVED.delay, EFFECTS)
TAP = 0  # behind the true delay: a share of a step of delay must not be negative, and is not


@pytest.fixture(scope="module")
def problem():
    return pose([seen(EFFECTS)], MODEL, Settings(effects=()))


def _with(problem, known, variance=0.0):
    old = problem.solver
    return Solver(old.bank, old.blocks, old.inertia, known, variance)


def _rows(problem, terms=None, tap=TAP):
    """(drive, columns) of the balance, rows in which the axis does not move left out by nothing: plain matrices."""
    design = problem.solver.bank.design(terms or problem.base, tap)
    assert not np.any(np.diag(design.noise)[1:])
    y, *columns = design.rows
    return y, np.array(columns), float(design.noise[INERTIA, INERTIA]) * len(y)


def _least_squares(y, x, noise, held, more=()):
    """Normal equations by hand: columns that are held go to the left, further equations below."""
    free = [i for i in range(len(x)) if i not in held]
    left = y - sum((value * x[i] for i, value in held.items()), np.zeros_like(y))
    a = x[free] @ x[free].T
    b = x[free] @ left
    if INERTIA in free:
        a[free.index(INERTIA), free.index(INERTIA)] -= noise
    for i, value, weight in more:
        a[free.index(i), free.index(i)] += weight
        b[free.index(i)] += weight * value
    theta = np.zeros(len(x))
    theta[free] = np.linalg.solve(a, b)
    for i, value in held.items():
        theta[i] = value
    return theta


def _kept(problem):
    return problem.solver.fit(problem.base, TAP)


def test_a_held_inertia_moves_the_others_as_plain_least_squares_does(problem):
    held = 1.07 * float(_kept(problem).total[INERTIA])
    fit = _with(problem, PriorKnowledge(fixed={"inertia": held})).fit(problem.base, TAP)
    y, x, noise = _rows(problem)
    assert fit.total == pytest.approx(_least_squares(y, x, noise, {INERTIA: held}), rel=1e-5, abs=1e-9)
    assert fit.folds[:, INERTIA] == pytest.approx(held)


def test_the_forward_form_of_a_held_inertia_is_the_same_balance(problem):
    held = 1.07 * float(_kept(problem).total[INERTIA])
    solver = _with(problem, PriorKnowledge(fixed={"inertia": held}))
    fit = solver.fit(problem.base, TAP)
    y, x, _ = _rows(problem)
    residual = y - fit.total @ x
    assert fit.squares == pytest.approx((solver.inertia / held) ** 2 * float(residual @ residual), rel=1e-6)
    assert solver.squares(problem.base, TAP) == pytest.approx(fit.squares, rel=1e-9)


def test_a_prior_is_one_more_equation(problem):
    free = _kept(problem).total
    value, spread, variance = 1.1 * float(free[INERTIA]), 0.02 * float(free[INERTIA]), 1e4
    fit = _with(problem, PriorKnowledge(priors={"inertia": (value, spread)}), variance).fit(problem.base, TAP)
    y, x, noise = _rows(problem)
    weight = fit.variance / spread**2
    assert fit.total == pytest.approx(_least_squares(y, x, noise, {}, [(INERTIA, value, weight)]), rel=1e-5, abs=1e-9)
    assert free[INERTIA] < fit.total[INERTIA] < value


def test_a_value_beyond_its_bound_is_put_on_it_and_the_others_follow(problem):
    free = _kept(problem).total
    column = 2
    low = 1.5 * float(free[column])
    fit = _with(problem, PriorKnowledge(bounds={"viscous_friction.coefficient": (low, 9.0)})).fit(problem.base, TAP)
    y, x, noise = _rows(problem)
    assert fit.total == pytest.approx(_least_squares(y, x, noise, {column: low}), rel=1e-5, abs=1e-9)


def test_a_bound_that_is_not_reached_changes_nothing(problem):
    free = _kept(problem)
    fit = _with(problem, PriorKnowledge(bounds={"viscous_friction.coefficient": (0.0, 9.0)})).fit(problem.base, TAP)
    assert fit.total == pytest.approx(free.total, rel=1e-6)
    assert fit.losses == pytest.approx(free.losses, rel=1e-5)


def test_an_amplitude_is_held_at_the_phase_that_leaves_least(problem):
    """A sine and a cosine are fitted; what is held is no linear function of them. Every phase is tried by hand."""
    fit = _with(problem, PriorKnowledge(fixed={"gravity.amplitude": 0.2})).fit(problem.base, TAP)
    y, x, noise = _rows(problem)
    assert math.hypot(*fit.total[3:5]) == pytest.approx(0.2, rel=1e-6)

    def left(phase):
        theta = _least_squares(y, x, noise, {3: 0.2 * math.cos(phase), 4: 0.2 * math.sin(phase)})
        return float(np.sum((y - theta @ x) ** 2))

    best = min(np.linspace(0.0, 1.0, 2001), key=left)
    assert math.atan2(fit.total[4], fit.total[3]) == pytest.approx(best, abs=2e-3)


def test_a_held_phase_stays(problem):
    fit = _with(problem, PriorKnowledge(fixed={"gravity.phase": 0.6})).fit(problem.base, TAP)
    assert math.atan2(fit.total[4], fit.total[3]) == pytest.approx(0.6, abs=1e-6)


def test_a_held_delay_is_not_walked_away_from(problem):
    search = Search(pose([seen(EFFECTS)], MODEL, Settings(effects=(), known=PriorKnowledge(fixed={"delay": 0.0093}))))
    assert search.problem.scale.model(search.refit).delay == 0.0093
    assert (search.refit.tap + search.refit.total[SHARE]) * search.solver.bank.tap_time == pytest.approx(0.0093)


def test_all_of_a_known_machine_stays_as_it_is(problem):
    known = PriorKnowledge().holding(MODEL)
    found = Search(pose([seen(EFFECTS)], MODEL, Settings(effects=(), known=known)))
    assert found.problem.scale.model(found.refit) == MODEL
    values = found.problem.values(found.refit).estimates
    assert {e.grade for e in values.values()} == {"held"}
    assert {e.std_error for e in values.values()} == {0.0}


@pytest.mark.parametrize("name", ["coulomb_friction", "flexible_coupling", "actuator_lag", "stiffness", "dead_zone"])
def test_what_is_fixed_stays_fixed_in_every_candidate(name):
    known = PriorKnowledge(fixed={"inertia": 1.05 * BELIEVED.inertia})
    base = posed({"coulomb_friction": {"level": 0.1}}, names=(name,))
    search = Search(pose(base.problem.recordings, BELIEVED, Settings(effects=(name,), known=known)))
    for option in search.options(search.refit):
        assert search.problem.scale.model(option.fit).inertia == 1.05 * BELIEVED.inertia
        theta, widths = option.fit.total, option.fit.widths
        loads = sum(theta[2] for _ in widths if name == "flexible_coupling")
        assert theta[INERTIA] + loads == pytest.approx(1.05 * BELIEVED.inertia, rel=1e-6)


def test_the_quick_scan_agrees_with_the_fit_where_the_inertia_is_held():
    known = PriorKnowledge(fixed={"inertia": 1.001 * BELIEVED.inertia})
    base = posed({"stiffness": {"coefficient": 0.005}}, names=("stiffness", "viscous_friction"))
    search = Search(pose(base.problem.recordings, BELIEVED, Settings(effects=("stiffness",), known=known)))
    scan = search.scan((), TAP)
    for name in ("stiffness", "viscous_friction"):
        gain, _ = scan.gain(Term.of(name, {}))
        exact = search.solver.squares((), TAP) - search.solver.squares((Term.of(name, {}),), TAP)
        assert search.solver.fit((), TAP).total[SHARE] > 0.0  # the scan does not press it
        assert gain == pytest.approx(exact, rel=1e-4)


def test_a_wrong_hold_and_a_wrong_prior_are_said():
    recording = seen(EFFECTS)
    for known, word in (
        (PriorKnowledge(fixed={"inertia": 1.3 * MODEL.inertia}), "is held at"),
        (PriorKnowledge(priors={"inertia": (1.3 * MODEL.inertia, 0.01 * MODEL.inertia)}), "pulls against its prior"),
        (PriorKnowledge(bounds={"inertia": (1.2 * MODEL.inertia, 9.0)}), "stands on its lower bound"),
    ):
        search = Search(pose([recording], MODEL, Settings(effects=(), known=known)))
        said = contradictions(search, search.refit, search.problem.values(search.refit).estimates)
        assert any("inertia" in line and word in line for line in said), (known, said)


def test_what_agrees_with_the_log_is_not_complained_of():
    recording = seen(EFFECTS)
    known = PriorKnowledge(priors={"inertia": (1.01 * MODEL.inertia, 0.02 * MODEL.inertia)})
    search = Search(pose([recording], MODEL, Settings(effects=(), known=known)))
    assert contradictions(search, search.refit, search.problem.values(search.refit).estimates) == ()


def test_shapes_are_told_from_values_that_rest_on_coefficients():
    told = {
        ("cogging", "periods"): True,
        ("flexible_coupling", "frequency"): False,
        ("flexible_coupling", "damping"): True,
        ("presliding_friction", "stiffness"): False,
        ("dead_zone", "width"): True,
    }
    values = {
        "cogging": {"amplitude": 0.1, "periods": 3.0, "phase": 0.1},
        "flexible_coupling": {"frequency": 20.0, "load_share": 0.3, "damping": 0.1},
        "presliding_friction": {"level": 0.1, "stiffness": 3.0},
        "dead_zone": {"width": 0.1},
    }
    for (effect, parameter), shape in told.items():
        found = get_effect(effect).to_columns(values[effect], 1.0)[1]
        assert is_shape(get_effect(effect), parameter, found) is shape, (effect, parameter)


#: Logs; two-sided 95 % of 40 are 38, and fewer than 34 are as rare as one in a thousand.
SEEDS, LEAST = 40, 34
HELPS = ("inertia held", "inertia with a prior")


@pytest.mark.parametrize("help_", HELPS)
def test_standard_errors_hold_the_truth_with_what_is_known(help_):
    model = PlantModel(J, DELAY, COVERED)
    clean, z = _log(COVERED, sensor="velocity", duration=8.0), {}
    for seed in range(SEEDS):
        spread = 0.001 * J
        prior = J + spread * float(np.random.default_rng(1000 + seed).normal())
        known = (
            PriorKnowledge(fixed={"inertia": J})
            if help_ == HELPS[0]
            else PriorKnowledge(priors={"inertia": (prior, spread)})
        )
        for name, sigma in _deviations(clean, model, known, seed):
            z.setdefault(name, []).append(sigma)
    for name, sigmas in z.items():
        assert np.count_nonzero(np.abs(sigmas) < 1.96) >= LEAST, (name, np.std(sigmas))
        assert 0.5 < np.std(sigmas) < 1.5, name


def _deviations(clean, model, known, seed):
    from dsd_cli.identify.fit.covariance import information
    from dsd_cli.identify.fit.values import Scale, fitted_values

    plain = _solver(_noisy(clean, "velocity", 1.0, seed), "velocity", 1.0)
    terms, tap = terms_of(model), int(DELAY / plain.bank.tap_time)
    variance = plain.fit(terms, tap).squares / plain.blocks.rows
    solver = Solver(plain.bank, plain.blocks, plain.inertia, known, variance)
    fit, scale = solver.fit(terms, tap), Scale(plain.bank.tap_time, 0.0, known)
    found = fitted_values(fit, solver, scale, variance, information(fit, solver)).estimates
    true = flat(model)
    return [(name, (e.value - true[name]) / e.std_error) for name, e in found.items() if not e.held]


@pytest.mark.parametrize(
    ("name", "shape"), [("backlash", {"gap": 0.0015, "slowing": 0.0}), ("flexible_coupling", {"damping": 0.1})]
)
def test_beside_a_held_inertia_a_load_is_no_negative_mass(name, shape):
    """J0 a less as much of a load that hardly swings is 0 whatever acts, and would explain every log.

    Against every share of the load from 0 up by plain least squares, the delay's own column with either sign.
    """
    problem = pose([seen({"viscous_friction": {"coefficient": 0.02}})], BELIEVED, Settings(effects=()))
    term, held, size = Term.of(name, {"frequency": 600.0, **shape}), BELIEVED.inertia, problem.solver.inertia
    fit = _with(problem, PriorKnowledge(fixed={"inertia": held})).fit((term,), TAP)
    drive, acceleration, later, load = problem.solver.bank.design((term,), TAP).rows
    least = np.inf
    for share in np.linspace(0.0, 0.9, 91):
        left = size * (acceleration + share / (1.0 - share) * load - drive / held / (1.0 - share))
        least = min(least, np.sum((left - later * (later @ left) / (later @ later)) ** 2))
    assert fit.forward[0] < 0.0 <= fit.forward[-1]
    assert fit.squares > 0.8 * least  # the sensor's noise in both columns is left in here


def test_a_prior_that_gives_way_bends_no_shape():
    """While the effect is missing its force is in what is left; a prior that weighs by that made periods 0.3 % off."""
    effects = {"cogging": {"amplitude": 0.15, "periods": 9.0, "phase": 0.7}}
    told = PriorKnowledge(priors={"inertia": (1.2 * MODEL.inertia, 0.02 * MODEL.inertia)})
    found = {}
    for name, known in (("free", PriorKnowledge()), ("told", told)):
        search = Search(pose([seen(effects)], BELIEVED, Settings(effects=("cogging",), known=known)))
        whole = search.run(search.refit)
        search = Search(search.problem.measured_again(whole))
        found[name] = search.problem.values(search.converged(search.fit(whole.terms, whole.tap))).estimates
    free, told = (found[name]["cogging.periods"] for name in ("free", "told"))
    assert told.value == pytest.approx(free.value, abs=2.0 * free.std_error)
    assert free.value == pytest.approx(9.0, abs=4.0 * free.std_error)
