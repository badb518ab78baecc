"""`dsd simulate --adapt`: the real command."""

import numpy as np
import pyarrow.csv as pc

from tests.cli.rig import done, dsd, refused

RUN = ("simulate", "--template", "paper-step", "--noise", "0.01", "--duration", "15", "--set", "model.inertia=0.5")


def read(path):
    table = pc.read_csv(path)
    return {name: table[name].to_numpy() for name in table.column_names}


def test_the_tracking_error_goes_and_the_log_says_what_was_believed(tmp_path):
    said = done(*RUN, "--adapt", "-o", "with.csv", cwd=tmp_path).stderr
    done(*RUN, "-o", "without.csv", cwd=tmp_path)
    adapted, without = (read(tmp_path / f"{name}.csv") for name in ("with", "without"))
    assert abs(adapted["reference"] - adapted["position"])[-2000:].max() < 0.01
    assert abs(without["reference"] - without["position"])[-2000:].min() > 0.9
    assert "in the end delay 0.3 s, inertia 0.5; tracking error in the last quarter 0.00" in said
    assert "adopted_delay" not in without
    first = np.flatnonzero(np.isfinite(adapted["adopted_inertia"]))[0]
    assert 0.3 < adapted["t"][first] < 1.0
    assert set(adapted["adopted_inertia"][first:]) == {0.5}


def test_a_loop_that_learns_nothing_says_so(tmp_path):
    said = done(*RUN, "--adapt", "-o", "with.csv", "--set", "detector.rho=1e-6", cwd=tmp_path).stderr
    assert "nothing was adopted" in said


def test_a_feedforward_that_is_for_one_plant_is_refused(tmp_path):
    (tmp_path / "next.csv").write_text("t,position,velocity,acceleration,u_feedforward\n0,0,0,0,0\n0.001,0,0,0,0\n")
    refused(dsd(*RUN, "--adapt", "--reference", "next.csv", "-o", "with.csv", cwd=tmp_path), 2, "feedforward")
    assert not (tmp_path / "with.csv").exists()


def test_a_burst_of_noise_is_an_event(tmp_path):
    events = ("--set", "simulate.events=[{time = 1.0, noise = 2.0}, {time = 1.5, noise = 0.0}]")
    done("simulate", "--template", "paper-step", *events, "-o", "log.csv", cwd=tmp_path)
    jumps = np.diff(read(tmp_path / "log.csv")["d_hat"])
    assert jumps[1002:1499].std() > 2.0
    assert jumps[1502:].std() < 0.1


def test_what_cannot_adapt_is_one_line(tmp_path):
    base = ("simulate", "--template", "paper-step", "-o", "x.csv", "--adapt")
    for options, text in (
        (("--set", 'detector.method="viterbi"'), "needs the whole log"),
        (("--effect", "viscous_friction:coefficient=0.1"), "cannot take effects"),
        (("--set", 'simulate.controller={kind="open_loop"}'), "no loop to adapt"),
    ):
        refused(dsd(*base, *options, cwd=tmp_path), 2, text)
    assert not (tmp_path / "x.csv").exists()
