"""Recordings made ready: white rows, honest counts, what is of use, and candidates that can be tested."""

import math
from dataclasses import replace

import numpy as np
import pytest

from dsd_cli.effects import catalogue
from dsd_cli.errors import DataError, UsageError
from dsd_cli.identify.fit.bank import drive
from dsd_cli.identify.verdict.examination import LEAST_FALL, Examination, Settings, _inflation
from dsd_cli.plant.model import PlantModel
from tests.identify.comparison_rig import BELIEVED, MOVES, OBSERVER, T, recorded


@pytest.fixture(scope="module")
def exam():
    return Examination([recorded(duration=8.0)], BELIEVED, OBSERVER, Settings(window=60))


def test_rows_are_white_after_whitening(exam):
    left = exam.bank.y - exam.refit.total[:2] @ np.stack([exam.bank.drive((), exam.refit.tap + i) for i in (0, 1)])
    correlation = [left[:-k] @ left[k:] / (left @ left) for k in range(1, 15)]
    assert np.abs(correlation).max() < 0.12
    assert np.mean(left**2) == pytest.approx(exam.noise.variance, rel=0.15)
    assert 1.0 <= exam.noise.inflation < 3.0


def test_rows_that_count_twice_are_told():
    rng = np.random.default_rng(1)
    white = rng.normal(size=20_000)
    assert _inflation(white) < 1.5
    held = np.repeat(rng.normal(size=2000), 10)  # ten rows that are one
    assert _inflation(held) == pytest.approx(10.0, rel=0.3)
    assert _inflation(np.diff(white)) == 1.0


def test_the_inertia_and_delay_of_the_rig_come_back(exam):
    model = exam.scale.model(exam.refit)
    assert model.inertia == pytest.approx(BELIEVED.inertia, rel=0.01)
    assert model.delay == pytest.approx(BELIEVED.delay, abs=0.1 * T)


def test_held_out_error_in_the_unit_of_u_is_a_loop(exam):
    plain, fit = exam.plain, exam.refit
    y = exam.equations.plain_measured()
    columns = [exam.equations.plain(drive(exam.equations, (), fit.tap + i)) for i in (0, 1)]
    fold_of = exam.blocks.fold[exam.blocks.block_of_rows()]
    keep, total = exam.equations.kept, 0.0
    for k in np.flatnonzero(keep):
        theta = fit.folds[fold_of[k]]
        total += (y[k] - theta[0] * columns[0][k] - theta[1] * columns[1][k]) ** 2
    assert plain.rmse(fit) == pytest.approx(math.sqrt(total / keep.sum()), rel=1e-9)
    assert plain.rmse(fit) == pytest.approx(0.01, rel=0.1)
    assert plain.force == pytest.approx(math.sqrt(np.mean(y[keep] ** 2)))


def test_what_is_of_use_takes_off_a_share(exam, monkeypatch):
    before, after = exam.refit, replace(exam.refit, terms=("x",))
    for fall, useful in ((0.5 * LEAST_FALL, False), (2.0 * LEAST_FALL, True)):
        values = {before.terms: 1.0, after.terms: 1.0 - fall}
        monkeypatch.setattr(exam.plain, "rmse", lambda fit, values=values: values[fit.terms])
        monkeypatch.setattr(type(exam.plain), "force", 20.0)
        assert exam.practical(before, after) is useful
        assert not exam.practical(after, before)


def test_what_is_small_against_the_force_is_of_no_use(exam, monkeypatch):
    after = replace(exam.refit, terms=("x",))
    values = {exam.refit.terms: 1e-3, after.terms: 5e-4}
    monkeypatch.setattr(exam.plain, "rmse", lambda fit: values[fit.terms])
    monkeypatch.setattr(type(exam.plain), "force", 1.0)
    assert not exam.practical(exam.refit, after)


def test_candidates_are_the_catalogue_less_what_the_model_has():
    model = replace(BELIEVED, effects={"viscous_friction": {"coefficient": 0.01}})
    found = Examination([recorded(duration=3.0)], model, OBSERVER, Settings())
    assert set(found.candidates) == set(catalogue()) - {"viscous_friction"}
    assert found.untestable == {}
    few = Examination([recorded(duration=3.0)], model, OBSERVER, Settings(effects=("gravity", "viscous_friction")))
    assert few.candidates == ("gravity",)


def test_blocks_keep_their_distance_from_window_and_delay():
    slow = replace(BELIEVED, delay=0.05)
    for window in (30, 90):
        exam = Examination([recorded(duration=6.0, model=slow)], slow, OBSERVER, Settings(window=window))
        assert exam.gap >= max(window, 25)
        assert exam.most_tap * T > slow.delay
        assert exam.equations.startup >= exam.most_tap


def test_the_structure_of_a_residual_is_that_of_its_spectrum(exam):
    assert exam.structured(exam.refit) < 0.35
    pushed = Examination(
        [recorded({"constant_load": {"force": 0.0}, "gravity": {"amplitude": 0.3, "phase": 0.0}}, duration=8.0)],
        BELIEVED,
        OBSERVER,
        Settings(),
    )
    assert pushed.structured(pushed.refit) > 0.35


def test_free_functions_of_the_position_take_gravity_and_nothing_takes_noise(exam):
    hidden = {"gravity": {"amplitude": 0.3, "phase": 0.4}}
    heavy = Examination([recorded(hidden, duration=8.0)], BELIEVED, OBSERVER, Settings())
    fits = heavy.freeform(heavy.refit)
    by_group = {group: fits.fit_with(group).loss for group in fits.groups() if len(group) == 1}
    assert min(by_group, key=by_group.get) == ("position",)
    assert by_group["position",] < 0.2 * fits.loss
    quiet = exam.freeform(exam.refit)
    assert all(quiet.fit_with(group).loss > 0.98 * quiet.loss for group in quiet.groups())
    assert quiet.loss == pytest.approx(exam.refit.loss, rel=1e-6)


def test_sample_times_that_differ_are_refused():
    one, other = recorded(duration=3.0), recorded(duration=3.0)
    slow = replace(other, pieces=tuple(replace(p, sample_time=2 * T) for p in other.pieces), name="slow.csv")
    with pytest.raises(UsageError, match=r"slow\.csv"):
        Examination([one, slow], BELIEVED, OBSERVER, Settings())


def test_a_log_that_is_too_short_for_its_delay_is_one_line():
    with pytest.raises(DataError) as error:
        Examination([recorded(duration=1.0, reference=MOVES)], PlantModel(0.01, 2.0), OBSERVER, Settings())
    assert "\n" not in str(error.value)
