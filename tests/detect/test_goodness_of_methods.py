"""Logs that no state explains: no method may be confident of a wrong label."""

import numpy as np
import pytest

from dsd_cli.cli.plan import detection_plan
from dsd_cli.cli.simulate import simulation_settings
from dsd_cli.detect.doubts import Doubts, in_a_window_of
from dsd_cli.detect.session import Session
from dsd_cli.files.template import load_template
from dsd_cli.plant.simulation import simulate
from dsd_cli.signals.cleaning import Cleaner

METHODS = ("dsd", "average", "combination", "imm", "viterbi", "smooth")
STICKY = ("imm", "viterbi", "smooth")
VISCOUS = "viscous_friction={coefficient=0.01}"


def confident_and_wrong(config, log, method: str) -> tuple[int, int]:
    """Samples that are confident, and those of them with a wrong delay."""
    tuning = ("detector.transition={stay=0.999}",) if method in STICKY else ()
    names = [name for name in ("t", "u", "d_hat", "velocity", "position") if name in log.channels]
    columns = {name: np.array(log[name]) for name in names}
    plan = detection_plan(
        config.override((f'detector.method="{method}"', *tuning)), {name: name for name in columns}, {}, "log"
    )
    session = Session(plan, Cleaner(None))
    parts = [*session.feed(columns["t"], columns), *session.finish()]
    state, sure = (np.concatenate([getattr(part, name) for part in parts]) for name in ("state", "confident"))
    wrong = plan.grid.axes["delay"][state] != np.asarray(log["true_delay"])
    return int(sure.sum()), int((sure & wrong).sum())


@pytest.mark.parametrize("method", METHODS)
def test_an_inertia_between_the_candidates(method: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The paper's step with J = 0.7; without the checks 900 samples and more are confident with a wrong delay."""
    config = load_template("paper-step").override(
        ("model.inertia=0.7", "simulate.noise=0.01", "detector.hold=3.0", "simulate.duration=3")
    )
    log = simulate(simulation_settings(config))
    assert confident_and_wrong(config, log, method)[1] == 0
    monkeypatch.setattr(Doubts, "model", lambda self, samples: None)
    assert confident_and_wrong(config, log, method)[1] > 300


@pytest.mark.parametrize("method", [*STICKY, "profile"])
@pytest.mark.parametrize("effects", ["", VISCOUS], ids=["nothing", "viscous"])
def test_dry_friction_that_the_model_lacks(method: str, effects: str) -> None:
    """The servo to and fro; without the checks 10 to 40 % of 4,000 samples are confident with a wrong delay."""
    config = load_template("servo").override(
        ("states.inertias=[0.005,0.007,0.01,0.014,0.02]", "simulate.noise=0.01", "detector.rho=0.05")
    )
    truth = config.override((f"model.effects={{coulomb_friction={{level=0.03}},{VISCOUS}}}",))
    log = simulate(simulation_settings(truth))
    assert confident_and_wrong(config.override((f"model.effects={{{effects}}}",)), log, method)[1] == 0
    # and with the right model the checks leave most of the labels
    sure, wrong = confident_and_wrong(truth, log, method)
    assert wrong == 0
    assert sure > (0.3 if method == "profile" else 0.9) * len(log)


def test_who_labels_afterwards_may_take_any_window_of_the_same_label() -> None:
    state = np.array([0] * 10 + [1] * 10)
    founded = np.zeros(20, dtype=bool)
    founded[[8, 15]] = True
    found = in_a_window_of(state, founded, 4)
    expected = [any(founded[j] and (state[i:j] == state[j]).all() for j in range(i, min(i + 4, 20))) for i in range(20)]
    assert found.tolist() == expected
    assert found.sum() == 8
