"""Logs that are written faster than their sensors are read, or slower than u moves; speeds that a drive has filtered or
taken as differences; stamps on arrival."""

import json
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from bench.paired_ask import write
from tests.cli.rig import FEW, done
from tests.oracle import tiers_logs, tiers_rig
from tests.oracle.questions import Question

TIERS = {tier.name: tier for tier in tiers_logs.tiers()}
#: A seed of 230000 on is one of each of `tiers_logs.FROM`, in turn.
DRAG, NOTHING = 230004, 230005


#: What is hidden in these logs, and what a late or uneven sensor stands for.
LIKELY = (*FEW, "load_friction", "stribeck_friction", "gravity", "stiffness", "actuator_lag")


def asked(folder: Path, question: Question) -> tuple[dict, str]:
    write(question, folder)
    ran = done("diagnose", "log.parquet", "-c", "dsd.toml", "--format", "json", cwd=folder, effects=LIKELY)
    return json.loads(ran.stdout), ran.stderr


@pytest.mark.parametrize(
    ("tier", "seed", "missing"),
    [("sensors read in every fifth row", NOTHING, "none"), ("sensors read unevenly", DRAG, "quadratic_drag")],
)
def test_what_is_missing_is_found_on_the_rows_with_new_values(tmp_path, tier, seed, missing):
    question = TIERS[tier].draw(seed)
    assert question.hidden == (() if missing == "none" else (missing,))
    said, warnings = asked(tmp_path, question)
    assert (said["verdict"], said["probability"] > 0.9) == (missing, True)
    assert "each value for " in " ".join(warnings.split())
    assert said["estimates"]["inertia"]["value"] == pytest.approx(question.truth["inertia"], rel=3e-3)


def test_a_check_says_so_and_looks_at_those_rows(tmp_path):
    question = TIERS["sensors read in every fifth row"].draw(DRAG)
    write(question, tmp_path)
    ran = done("check", "log.parquet", "-c", "dsd.toml", cwd=tmp_path)
    assert "position repeats each value for 5 rows" in " ".join(ran.stderr.split())
    assert f"{question.channels['u'].size // 5 + 1:,} samples, 5 ms apart" in ran.stdout


@pytest.fixture(scope="module")
def delayed() -> Question:
    """Speed and position behind a delay that nobody told."""
    question = TIERS["speed averaged over 20 rows"].draw(230006)
    assert question.hidden == ("delay",)
    return question


def test_a_speed_that_is_late_is_not_used_beside_the_position(tmp_path, delayed):
    said, warnings = asked(tmp_path, delayed)
    assert "the position alone is used" in " ".join(warnings.split())
    assert "no column" not in warnings
    assert said["estimates"]["delay"]["value"] == pytest.approx(delayed.truth["delay"], abs=2e-4)  # with it 9.5 ms more


def test_a_position_that_is_late_is_put_where_the_speed_has_it_by_then(tmp_path, delayed):
    q = delayed.channels["position"]
    late = {"position": np.concatenate([np.full(25, q[0]), q[:-25]]), "velocity": np.gradient(q, delayed.channels["t"])}
    said, warnings = asked(tmp_path, replace(delayed, channels={**delayed.channels, **late}))
    assert "later than the velocity; it is taken as so much earlier" in " ".join(warnings.split())
    assert said["estimates"]["delay"]["value"] == pytest.approx(delayed.truth["delay"], abs=1e-3)  # with it 25 ms more


@pytest.mark.parametrize("way", ["late", "held"])
def test_the_zero_of_a_late_or_slow_position_stays(tmp_path, way):
    """A pendulum that starts far from its rest, its weight in the model: the phase is the position's."""
    t = np.arange(0.0, 20.0, 0.001)
    q = 2.0 + np.sin(2.0 * t) + 0.5 * np.sin(5.3 * t)
    v, a = np.gradient(q, t), np.gradient(np.gradient(q, t), t)
    rng = np.random.default_rng(5)
    u = 0.02 * a + 0.3 * np.sin(q)
    rows = np.arange(t.size)
    seen = np.concatenate([np.full(12, q[0]), q[:-12]]) if way == "late" else q[rows - rows % 5]
    channels = {"t": t, "u": u, "position": seen, "velocity": v + 1e-3 * rng.standard_normal(t.size)}
    gravity = {"gravity": {"amplitude": 0.3, "phase": 0.0}}
    model = {"inertia": 0.02, "delay": 0.0, "effects": gravity}
    observer = {"nominal_inertia": 0.02, "time_constant": 0.005}
    said, _ = asked(tmp_path, Question((), channels, model, observer, model))
    assert said["verdict"] != "gravity"


@pytest.mark.parametrize("seed", [230003, 230005])
def test_stamps_on_arrival_are_not_taken_for_those_of_the_samples(tmp_path, seed):
    question = TIERS["stamped on arrival"].draw(seed)
    said, warnings = asked(tmp_path, question)
    assert "the motion is smoother on an even clock than at its stamps" in " ".join(warnings.split())
    assert (said["verdict"], said["probability"] > 0.9) == ((*question.hidden, "none")[0], True)


@pytest.mark.parametrize("seed", [230004, 230006])
def test_a_speed_by_differences_of_counts_is_as_good_as_their_position(tmp_path, seed):
    question = TIERS["speed by differences of counts"].draw(seed)
    said, warnings = asked(tmp_path, question)
    assert "velocity has the noise of a difference of positions" in " ".join(warnings.split())
    assert said["provenance"]["position"] == "integrated from velocity"  # no sensor knows its zero
    assert (said["verdict"], said["probability"] > 0.9) == ((*question.hidden, "none")[0], True)


def test_half_a_sample_of_delay_may_be_how_u_was_logged(tmp_path):
    """Every fifth row of a loop at 1 kHz: u is sampled, and the log has nothing else that is wrong."""
    base = {tier.name: tier for tier in tiers_rig.tiers()}["speed and 40,000 counts"].draw(230006)
    rows = {name: x[::5] for name, x in base.channels.items()}
    said, warnings = asked(tmp_path, replace(base, channels=rows, believed=base.truth))
    assert (said["verdict"], said["probability"] <= 0.5) == ("delay", True)
    assert "is signals.u_hold right?" in " ".join(warnings.split())


def test_init_proposes_for_the_rows_with_new_values(tmp_path):
    channels = TIERS["sensors read in every fifth row"].draw(DRAG).channels
    names = {"t": "time", "u": "torque", "position": "pos"}
    rows = np.column_stack([channels[name] for name in names])
    np.savetxt(tmp_path / "log.csv", rows, delimiter=",", header=",".join(names.values()), comments="")
    said = done("init", "log.csv", cwd=tmp_path).stderr
    assert "position repeats each value for 5 rows" in " ".join(said.split())
    assert "time_constant = 0.025" in (tmp_path / "dsd.toml").read_text()  # five samples of 5 ms


def test_what_a_sampled_u_leaves_unexplained_is_said_to_be_that(tmp_path):
    """Every tenth row of a weak loop; load friction is found, and 5 % of u is left over velocity and u."""
    question = {tier.name: tier for tier in tiers_rig.tiers()}["weak loop"].draw(230003)
    rows = {name: x[::10] for name, x in question.channels.items()}
    said, _ = asked(tmp_path, replace(question, channels=rows))
    assert said["unexplained"]["probability"] > 0.5
    assert 'signals.u_hold = "sampled"? with all that was found' in said["advice"][0]
    ran = done(
        "diagnose", "log.parquet", "-c", "dsd.toml", "--set", "signals.u_hold=held", cwd=tmp_path, effects=LIKELY
    )
    assert "signals.u_hold" not in ran.stdout  # who says it is not asked
    ran = done("improve", "log.parquet", "-c", "dsd.toml", "--auto", cwd=tmp_path, effects=LIKELY)
    assert 'signals.u_hold = "sampled"? with all that was found' in " ".join(ran.stderr.split())


@pytest.fixture(scope="module")
def repeating(tmp_path_factory) -> Path:
    """Position in every fifth row, nothing missing, with candidates around the truth; as Parquet and as CSV."""
    folder = tmp_path_factory.mktemp("repeating")
    question = TIERS["sensors read in every fifth row"].draw(NOTHING)
    write(question, folder)
    inertia, delay = (question.truth[name] for name in ("inertia", "delay"))
    states = f"[states]\ndelays = [{delay}, {delay + 0.01}]\ninertias = [{inertia}, {2 * inertia}]\n"
    with (folder / "dsd.toml").open("a") as config:
        config.write(f"\n{states}[detector]\nrho = 0.05\nwindow = 40\n")
    channels = question.channels
    rows = np.column_stack([channels[name] for name in ("t", "u", "position")])
    np.savetxt(folder / "log.csv", rows, delimiter=",", header="t,u,position", comments="")
    comes = np.arange((np.flatnonzero(np.diff(channels["position"])) + 1)[0], channels["u"].size, 5)  # by hand
    edges = np.append(comes, channels["u"].size)
    means = [channels["u"][a:b].mean() for a, b in pairwise(edges)]
    thin = np.column_stack([channels["t"][comes], means, channels["position"][comes]])
    np.savetxt(folder / "by-hand.csv", thin, delimiter=",", header="t,u,position", comments="")
    return folder


@pytest.mark.parametrize("way", ["file", "stream"])
def test_detect_labels_every_row_and_says_that_values_repeat(repeating, way):
    given = ("log.csv", {}) if way == "file" else ("-", {"stdin": (repeating / "log.csv").read_bytes()})
    ran = done("detect", given[0], "-c", "dsd.toml", "--format", "csv", cwd=repeating, **given[1])
    out, said = (x.decode() if isinstance(x, bytes) else x for x in (ran.stdout, ran.stderr))
    assert len(out.splitlines()) == 20_001
    (line,) = [one for one in said.splitlines() if "repeats" in one]
    assert "position repeats each value for 5 rows while the axis moves" in line
    assert "dsd observe LOG -o NEW.parquet" in line


def test_observe_writes_the_rows_with_new_values(repeating):
    ran = done("observe", "log.csv", "-c", "dsd.toml", "-o", "new.csv", cwd=repeating)
    assert "position repeats each value for 5 rows" in " ".join(ran.stderr.split())
    new, by_hand = (np.genfromtxt(repeating / name, delimiter=",", names=True) for name in ("new.csv", "by-hand.csv"))
    for name in ("t", "u", "position"):
        np.testing.assert_allclose(new[name][-3900:], by_hand[name][-3900:], rtol=1e-9, atol=1e-12)
    ran = done("detect", "new.csv", "-c", "dsd.toml", cwd=repeating)
    assert "samples, 5 ms apart" in ran.stdout
    assert "repeat" not in ran.stderr


def test_tune_takes_the_rows_with_new_values(repeating):
    """rho was 12 of all rows, where the position stands and jumps."""
    names = ("log.csv", "by-hand.csv")
    tuned = [done("tune", name, "-c", "dsd.toml", "--format", "json", cwd=repeating) for name in names]
    rho, by_hand = (json.loads(one.stdout)["rho"] for one in tuned)
    assert rho == pytest.approx(by_hand, rel=0.03)
    assert "these settings are for the log of `dsd observe LOG" in " ".join(tuned[0].stderr.split())
    assert "observe" not in tuned[1].stderr
