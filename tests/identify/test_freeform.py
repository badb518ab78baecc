"""Free-form functions beside the model: they reach what the law would, on rows that they did not see."""

import numpy as np
import pytest

from dsd_cli.identify.fit.bank import Term
from dsd_cli.identify.verdict.examination import Examination, Settings
from dsd_cli.identify.verdict.freeform import loss_of, rich_residual
from tests.identify.comparison_rig import BELIEVED, OBSERVER, recorded

LAWS = {
    "viscous_friction": ({"coefficient": 0.03}, "velocity"),
    "coulomb_friction": ({"level": 0.1}, "velocity"),
    "stiffness": ({"coefficient": 0.4}, "position"),
}


@pytest.fixture(scope="module", params=LAWS)
def hidden(request):
    values, channel = LAWS[request.param]
    exam = Examination([recorded({request.param: values}, duration=8.0)], BELIEVED, OBSERVER, Settings(effects=()))
    return exam, request.param, channel


def test_the_function_of_the_right_channel_comes_near_the_law(hidden):
    exam, name, channel = hidden
    fits = exam.freeform(exam.refit)
    law = exam.search.fit((Term(name),), exam.refit.tap)
    free = fits.fit_with((channel,))
    assert free.on == (channel,)
    assert free.loss == pytest.approx(float(free.losses.sum()))
    taken = (exam.refit.loss - free.loss) / (exam.refit.loss - law.loss)
    assert 0.9 < taken < 1.02
    singles = [fits.fit_with(group) for group in fits.groups() if len(group) == 1]
    assert loss_of(singles).on == (channel,)


def test_beside_the_law_nothing_is_left_to_reach(hidden):
    exam, name, _ = hidden
    fits = exam.freeform(exam.search.fit((Term(name),), exam.refit.tap))
    assert all(fits.fit_with(group).loss > 0.97 * fits.loss for group in fits.groups() if len(group) == 1)


def test_the_rich_residual_is_the_noise(hidden):
    exam, name, _ = hidden
    law = exam.search.fit((Term(name),), exam.refit.tap)
    left = rich_residual(exam.freeform(exam.refit))[exam.equations.kept]
    assert np.mean(left**2) < 1.1 * law.squares / exam.equations.kept.sum()


def test_only_channels_that_vary_are_tried(hidden):
    exam, _, _ = hidden
    groups = exam.freeform(exam.refit).groups()
    assert ("velocity",) in groups
    assert ("time",) in groups
    assert all(len(set(group)) == len(group) for group in groups)
