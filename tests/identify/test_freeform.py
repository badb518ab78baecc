"""Free-form functions beside the model: they reach what the law would, on rows that they did not see."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from dsd_cli.identify.fit.bank import Term
from dsd_cli.identify.fit.blocks import lay_blocks
from dsd_cli.identify.fit.freeform import FreeformFits, freeform_fits, rich_residual
from dsd_cli.identify.fit.problem import Settings, pose
from dsd_cli.identify.recordings.recording import prepare
from dsd_cli.identify.results import DELAY
from dsd_cli.plant.simulation import Measurement, SimulationSettings, simulate
from dsd_cli.signals.log import Log
from tests.identify.comparison_rig import BELIEVED, CONTROLLER, OBSERVER, SINES, T
from tests.identify.search_rig import seen

LAWS = {
    "viscous_friction": ({"coefficient": 0.03}, "velocity"),
    "coulomb_friction": ({"level": 0.1}, "velocity"),
    "stiffness": ({"coefficient": 0.4}, "position"),
}


def _fits(problem, fit):
    """Made of plain rows, judged on whitened ones."""
    return freeform_fits(problem.errors.bank, problem.equations, problem.blocks, fit, problem.solver.inertia)


def _recording(effects):
    """40 s of u and of a speed with noise."""
    settings = SimulationSettings(
        model=replace(BELIEVED, effects=effects),
        duration=40.0,
        sample_time=T,
        observer=OBSERVER,
        controller=CONTROLLER,
        reference=SINES,
        measurement=Measurement(velocity_noise=2e-3, seed=1),
    )
    log = simulate(settings)
    return prepare(Log({n: log[n] for n in ("t", "u", "velocity")}, T, "x"), OBSERVER)


@pytest.fixture(scope="module", params=LAWS)
def hidden(request):
    """(problem, fit without the law, fit with it, channel)."""
    values, channel = LAWS[request.param]
    problem = pose([_recording({request.param: values})], BELIEVED, Settings(effects=()))
    tap = round(BELIEVED.delay / problem.solver.bank.tap_time)
    return problem, problem.solver.fit((), tap), problem.solver.fit((Term(request.param),), tap), channel


def _single(fits):
    return [fits.fit_with(group) for group in fits.groups() if len(group) == 1]


def test_the_function_of_the_right_channel_comes_near_the_law(hidden):
    problem, bare, law, channel = hidden
    free = _fits(problem, bare).fit_with((channel,))
    assert free.on == (channel,)
    assert free.loss == pytest.approx(float(free.losses.sum()))
    assert free.gain == pytest.approx(float(free.without.sum()) - free.loss)
    taken = free.gain / (float(free.without.sum()) - law.loss)
    assert 0.95 < taken < 1.05
    assert max(_single(_fits(problem, bare)), key=lambda one: one.gain).on == (channel,)


def test_beside_the_law_nothing_is_left_to_reach(hidden):
    problem, bare, law, _ = hidden
    for found in _single(_fits(problem, law)):
        assert found.gain < 0.03 * (bare.loss - law.loss)


def test_a_function_of_nothing_is_as_stiff_as_it_must_be(hidden):
    """Beside the law every function that bends follows noise, and loses on rows that it did not see."""
    problem, _, law, _ = hidden
    fits = _fits(problem, law)
    lost = {group: -fits.fit_with(group).gain / problem.noise.nats for group in fits.groups()}
    assert max(lost.values()) < 7.0, lost


def test_without_a_function_it_is_the_forward_fit(hidden):
    """Held-out squares of least squares for J0 a on explicit rows, fold by fold."""
    problem, bare, _, channel = hidden
    rows = np.stack(problem.solver.bank.design(bare.terms, bare.tap).rows)
    target, columns, blocks = problem.solver.inertia * rows[1], np.delete(rows, 1, axis=0), problem.blocks
    block_of, weight = blocks.block_of_rows(), np.zeros(blocks.rows)
    without = _fits(problem, bare).fit_with((channel,)).without
    for fold in range(blocks.folds):
        for i, w in enumerate(blocks.fitted(fold)):
            weight[blocks.starts[i] : [*blocks.starts, blocks.rows][i + 1]] = w
        theta = np.linalg.lstsq(columns[:, weight > 0.0].T, target[weight > 0.0], rcond=None)[0]
        for b in np.flatnonzero(blocks.fold == fold):
            left = (target - theta @ columns)[block_of == b]
            assert without[b] == pytest.approx(float(left @ left), rel=1e-5)


def test_the_rich_residual_is_no_more_than_the_noise(hidden):
    problem, bare, law, _ = hidden
    kept = problem.errors.equations.kept
    left = rich_residual(_fits(problem, bare))[kept]
    noise = problem.errors.residual(law, held_out=False)[kept]
    assert np.mean(left**2) < 1.1 * np.mean(noise**2)


def test_hats_over_a_channel_add_up_to_one_where_nothing_holds(hidden):
    problem, bare, _, _ = hidden
    columns, penalty = _fits(problem, bare).columns(("position",))
    np.testing.assert_allclose(sum(columns), 1.0, atol=1e-9)
    assert penalty.shape == (len(columns),) * 2


def test_a_fold_that_did_not_see_a_push_is_not_at_a_loss():
    """The pulse keeps the level of all rows: held out, it explains the push all but its edges, which are smoothed.

    It lies within one block of 0.19 s, so that the fit which holds that one out never sees it.
    """
    push = {"external_force": {"events": [{"start": 3.02, "end": 3.12, "force": 0.5}]}}
    pulse = Term.of("external_force", {"edges": ((3.02, 3.12),)})
    problem = pose([seen(push, duration=8.0)], BELIEVED, Settings(effects=()))
    tap = round(BELIEVED.delay / problem.solver.bank.tap_time)
    with_it, alone = (
        _fits(problem, problem.solver.fit(terms, tap)).without("", whitened=False).sum() for terms in ((pulse,), ())
    )
    assert with_it < 1e-3 * alone


def test_only_channels_that_vary_are_tried(hidden):
    problem, bare, _, _ = hidden
    groups = _fits(problem, bare).groups()
    assert ("velocity",) in groups
    assert ("time",) in groups
    assert all(len(set(group)) == len(group) for group in groups)
    fits = _fits(problem, bare)
    still = replace(fits.pieces[0], values={**fits.pieces[0].values, "position": np.ones(len(fits.pieces[0].sign))})
    assert not any("position" in group for group in replace(fits, pieces=[still]).groups())


@pytest.mark.parametrize("counting", [1.0, 0.65])
def test_what_a_function_leaves_is_of_the_rows_that_count(counting, monkeypatch):
    """Where the axis rests friction is anything: no part of the error, nor of what a function leaves of it."""
    drive, law, noise, rest = np.random.default_rng(4).normal(size=(4, 20000))
    kept = np.arange(20000) % 20 < 20 * counting
    plain = np.where(kept, 0.6 * law + 0.05 * noise, 3.0 * rest)
    rows = SimpleNamespace(kept=kept, whitened=lambda x: x * kept)
    monkeypatch.setattr(FreeformFits, "columns", lambda *_: ([law], np.zeros((1, 1))))
    base, owners = [drive + plain, drive, np.zeros(20000)], ["", "", DELAY]
    fits = FreeformFits(rows, lay_blocks([20000], 5, "log"), None, base, owners, [])
    assert fits.left_of(float(np.std(plain[kept])), ("velocity",)) == pytest.approx(0.05, rel=0.1)


@pytest.mark.parametrize("of_law", [True, False])
def test_a_law_is_no_delay_below_0_and_such_a_delay_no_law(of_law, monkeypatch):
    """J a = u and 0.6 of a law, or of u's change over a step, which the fit may not take that way round. Either does
    0.6 of what the other does."""
    drive, own, other, noise = np.random.default_rng(3).normal(size=(4, 2000))
    law, step = own, 0.6 * own + 0.8 * other
    plain = 0.6 * (law if of_law else step) + 0.05 * noise
    rows = SimpleNamespace(kept=np.ones(2000, dtype=bool), whitened=lambda x: x)
    base, owners, on = [drive + plain, drive, step], ["", "", DELAY], ("velocity",)
    monkeypatch.setattr(FreeformFits, "columns", lambda *_: ([law], np.zeros((1, 1))))
    fits = FreeformFits(rows, lay_blocks([2000], 5, "log"), None, base, owners, [])
    left = fits.left_of(float(np.std(plain)), on)
    assert left == pytest.approx(0.05 if of_law else np.std(plain), rel=0.05)


def test_of_a_log_without_noise_nothing_is_left():
    """A sum of squares out of inner products was -2.6e-17 by rounding, and its root an exception."""
    made = SimpleNamespace(without=lambda *_, **__: np.array([-2.6e-17]), equations=SimpleNamespace(kept=np.ones(9)))
    assert FreeformFits.left_of(made, 0.0, ("velocity",)) == 0.0
