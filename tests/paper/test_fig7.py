"""Fig. 7 of the paper: sine reference of 20 rad/s, delay 0.3 s."""

import pytest

from tests.paper.runs import INERTIAS, run


@pytest.mark.parametrize("inertia", INERTIAS)
def test_fig7_with_a_sine_the_delay_is_right_for_every_inertia(inertia: float) -> None:
    """Section IV-B: "even though J is varied from 0.5 to 1.0, ... the time delay is correctly detected"."""
    assert set(run("paper-sine", f"model.inertia={inertia}").delay(0.8)) == {0.3}


@pytest.mark.parametrize("inertia", [0.5, 1.0])
def test_fig7_a_true_candidate_is_confident_throughout(inertia: float) -> None:
    """A sine excites all the time, so the confidence does not fade as it does after the step of Fig. 6."""
    assert run("paper-sine", f"model.inertia={inertia}").confident(0.8).all()
