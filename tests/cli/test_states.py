"""What was found of the model reaches the detector: `--states` of improve and add, and the labels of a report."""

import json
import re
import tomllib
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dsd_cli.cli.refresh import _serves, with_delay, with_inertia
from tests.cli.rig import FEW, done, dsd

ROOT = Path(__file__).parents[2]
LOG = ROOT / "sample_logs/servo-friction.csv"
TRUTH = {"delay": 0.002, "inertia": 0.01}


@pytest.fixture
def rig(tmp_path: Path) -> Path:
    """Nobody thought of friction, and the candidates have neither the delay nor the inertia of the axis."""
    text = (ROOT / "sample_logs/servo-bare.toml").read_text(encoding="utf-8")
    text = text.replace("delays = [0.0, 0.002, 0.004]", "delays = [0.0, 0.000767, 0.00177]")
    text = text.replace("inertias = [0.008, 0.01, 0.0125]", "inertias = [0.007, 0.0113, 0.0141]")
    (tmp_path / "dsd.toml").write_text(text.replace("inertia = 0.01 }", "inertia = 0.0113 }"))
    return tmp_path


def test_improve_lays_the_candidates_around_the_new_model(rig: Path) -> None:
    blunt = ("--set", "detector.rho=0.25")  # of the model that lacked friction, as `dsd init` takes it
    said = done("add", LOG, "coulomb_friction", *blunt, "-o", "plain.toml", cwd=rig).stderr
    grids = re.search(r"delay (\S+) and inertia (\S+) of \[model\] are no candidates of \[states\], and", said)
    model = tomllib.loads((rig / "plain.toml").read_text())["model"]
    assert [float(x) for x in grids.groups()] == pytest.approx([model["delay"], model["inertia"]], rel=1e-3)
    assert model["inertia"] == pytest.approx(TRUTH["inertia"], rel=0.01)  # the delay is bent by what is missing still
    suits = re.search(r"detector\.rho = 0\.25 does not suit .* \((\S+) does\): --states mends that", said)
    assert 0.011 < float(suits[1]) < 0.1  # noise and encoder leave 0.011, and viscous friction is missing still
    said = done("improve", LOG, "--auto", "--states", "-o", "new.toml", cwd=rig, effects=FEW).stderr
    assert "refreshed: states.delays = [0, 0.000767, 0.001997]" in said
    written = tomllib.loads((rig / "new.toml").read_text())
    assert written["observer"]["nominal_inertia"] == 0.01  # the log has the d_hat of an observer with that one
    assert written["detector"]["initial"] == {"delay": 0.0, "inertia": written["states"]["inertias"][1]}
    assert 0.011 < written["detector"]["rho"] < 0.022  # 1 to 2 times that
    shares = {}
    for config in ("plain.toml", "new.toml"):
        result = json.loads(done("detect", LOG, "-c", config, "--format", "json", cwd=rig).stdout)
        shares[config] = result["truth"]["share_correct"]
        for name, value in TRUTH.items():
            near = abs(result["final"][name] / value - 1.0) < 0.01
            assert near is (config == "new.toml"), (config, name)
    assert shares["new.toml"] > 0.9


@pytest.mark.parametrize(
    ("grid", "value", "serves"),
    [
        ((0.0, 0.01, 0.02), 7e-5, True),
        ((0.0, 0.01), 0.0013, False),
        ((0.02, 0.04, 0.08), 0.0415, True),
        ((0.1,), 0.2, False),
    ],
)
def test_a_candidate_that_is_off_by_less_than_labels_show_is_one(grid, value, serves):
    """ "delay 6.9e-05 is no candidate" was said of 0, 10 and 20 ms."""
    assert _serves(grid, value) is serves


def test_a_computed_d_hat_takes_the_new_inertia_for_jn(rig: Path) -> None:
    rows = [line.split(",") for line in LOG.read_text(encoding="utf-8").splitlines()]
    keep = [i for i, name in enumerate(rows[0]) if name in ("t", "u", "position")]
    (rig / "log.csv").write_text("\n".join(",".join(row[i] for i in keep) for row in rows) + "\n")
    options = ("--set", "observer.nominal_inertia=0.02", "--states", "-o", "new.toml")
    done("add", "log.csv", "coulomb_friction", *options, cwd=rig)
    written = tomllib.loads((rig / "new.toml").read_text())
    assert written["observer"]["nominal_inertia"] == pytest.approx(written["model"]["inertia"], rel=1e-3)


def test_jn_stays_that_of_the_observer_whose_d_hat_is_in_the_log_beside_a_position(rig: Path) -> None:
    """J 0.013, d_hat made with Jn 0.01: 0.013 was written for Jn, and no label was confident any more."""
    done("simulate", "--set", "model.inertia=0.013", "-o", "log.csv", cwd=rig)
    done("improve", "log.csv", "--auto", "--states", "-o", "new.toml", cwd=rig, effects=FEW)
    new = tomllib.loads((rig / "new.toml").read_text())
    assert new["model"]["inertia"] == pytest.approx(0.013, rel=0.01)
    assert new["observer"]["nominal_inertia"] == 0.01
    done("init", "log.csv", "-o", "first.toml", cwd=rig)  # whose config dsd check then called wrong
    first = tomllib.loads((rig / "first.toml").read_text())
    assert first["observer"]["nominal_inertia"] == pytest.approx(0.01, rel=0.05)  # d_hat has noise of its own
    assert "can answer" in done("check", "log.csv", "-c", "first.toml", cwd=rig).stdout


def test_a_report_detects_with_the_model_at_the_end(rig: Path) -> None:
    done("report", LOG, "-o", "r.html", "-q", cwd=rig, effects=FEW)
    page = (rig / "r.html").read_text(encoding="utf-8")
    assert "Detected with the model at the end, inertia 0.01, delay 0.001997 s, with coulomb_friction and" in page
    (right,) = re.findall(r"The log knows the truth: ([0-9.]+) % of the labels are right", page)
    assert float(right) > 90.0


@given(st.lists(st.floats(1e-4, 1.0), min_size=1, max_size=6, unique=True), st.floats(1e-4, 1.0))
def test_axes_keep_their_size_and_get_the_value(axis: list[float], found: float) -> None:
    for new in (with_delay(axis, found), with_inertia(axis, found)):
        assert len(new) == len(axis)
        assert min(abs(one / found - 1.0) for one in new) <= 1e-3
    spread = max(axis) / min(axis)
    assert max(with_inertia(axis, found)) / min(with_inertia(axis, found)) == pytest.approx(spread, rel=2e-3)


def test_a_log_too_short_for_d_hat_is_fitted_all_the_same(rig: Path) -> None:
    """rho is for d_hat, whose first 5 tau are none; the fit is of forces."""
    slow = ("--set", "observer.time_constant=1.0", "-o", "new.toml")
    assert "detector.rho" not in done("add", LOG, "coulomb_friction", *slow, cwd=rig).stderr
    assert "coulomb_friction" in (rig / "new.toml").read_text()


def test_without_states_nothing_is_refreshed(rig: Path) -> None:
    text = re.sub(r"\[states\].*?\[simulate\]", "[simulate]", (rig / "dsd.toml").read_text(), flags=re.DOTALL)
    (rig / "dsd.toml").write_text(text)
    made = dsd("add", LOG, "coulomb_friction", "--states", "-o", "new.toml", cwd=rig)
    assert made.returncode == 0
    assert "refreshed" not in made.stderr
