"""`dsd improve` on real axes that are nearly all friction or cogging: what their owners' regressions say is named."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests import warm
from tests.recordings import recording

#: The README of the recordings: V, V s/m, V s2/m; a hollow-shaft motor's data sheet, kg m2; cogging, A.
WHEELS_COULOMB, WHEELS_VISCOUS = 0.806, 1.20
MOTOR_INERTIA = 1.2e-4
COGGING = (0.77, 0.89)
#: The README's own regression with u 7 ms late: kg (24.7 weighed), N s/m, N, s.
RACK = {"inertia": 25.1, "viscous_friction.coefficient": 54.0, "coulomb_friction.level": 14.5, "delay": 0.007}


def improved(folder: Path, logs: list[Path], inertia: float, **signals: str) -> dict:
    columns = "\n".join(f'{name} = "{column}"' for name, column in {"d_hat": "", "reference": "", **signals}.items())
    (folder / "dsd.toml").write_text(
        f"[signals]\n{columns}\n[observer]\nnominal_inertia = {inertia}\ntime_constant = 0.02\n"
        f"[model]\ninertia = {inertia}\n",
        encoding="utf-8",
    )
    done = warm.run("improve", *logs, "--auto", "--format", "json", cwd=folder)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def added(result: dict) -> set[str]:
    return {step["effect"] for step in result["ladder"][1:]} - {"refit"}


def near(result: dict, name: str, value: float) -> bool:
    found = result["values"][name]
    return abs(found["value"] - value) < 2.0 * found["std_error"]


@pytest.fixture(scope="module")
def wheels(tmp_path_factory):
    tests = ("slow_forward", "slow_backward", "fast_forward", "fast_backward")
    logs = [recording(f"frc_drivetrain/{name}.csv") for name in tests]
    columns = {"time": "t", "u": "u", "position": "position", "velocity": "velocity"}
    return improved(tmp_path_factory.mktemp("wheels"), logs, 0.08, **columns)


def test_a_robot_on_wheels_has_the_friction_that_its_own_tool_says(wheels):
    assert added(wheels) == {"coulomb_friction", "viscous_friction"}
    assert near(wheels, "coulomb_friction.level", WHEELS_COULOMB)
    assert near(wheels, "viscous_friction.coefficient", WHEELS_VISCOUS)


def test_what_it_lacks_and_what_is_left_are_two_numbers(wheels):
    probability = {one["effect"]: one["probability"] for one in wheels["missing"]}
    assert probability["viscous_friction"] > 0.5  # rather there than not, though something is surely left
    assert wheels["unexplained"]["probability"] > 0.5
    assert "coulomb_friction" in probability
    assert wheels["unexplained"]["share_of_u"] < 0.077  # own regression with an inertia: 7.7 % left


def test_a_motor_that_runs_up_in_open_loop_has_its_inertia_and_both_frictions(tmp_path):
    columns = {"time": "t_s", "u": "u_torque_ref_Nm", "position": "position_rad", "velocity": "velocity_rad_s"}
    found = improved(tmp_path, [recording("hsm150/idf_pos_0.06_1.parquet")], MOTOR_INERTIA, **columns)
    assert added(found) == {"coulomb_friction", "viscous_friction"}
    assert near(found, "inertia", MOTOR_INERTIA)


def test_a_crawl_through_cogging_tells_its_seven_periods_and_no_inertia(tmp_path):
    columns = {"time": "t_s", "u": "u_current_A", "position": "position_rad", "velocity": ""}
    found = improved(tmp_path, [recording("odrive_cogging/slow2_comp_0.csv")], 3.5e-3, **columns)
    assert "cogging" in added(found)
    assert found["values"]["cogging.periods"]["value"] == pytest.approx(7.0, abs=0.1)
    assert COGGING[0] < found["values"]["cogging.amplitude"]["value"] < COGGING[1]
    assert found["values"]["inertia"]["identified"] == "not"
    assert found["values"]["inertia"]["value"] > 1e-9


def test_half_a_second_of_a_rack_tells_its_mass_both_frictions_and_the_delay(tmp_path):
    columns = {"time": "t_s", "u": "u_force_N", "velocity": "velocity_m_s", "position": ""}
    found = improved(tmp_path, [recording("rack_pinion/merged_raw_clock.csv")], 24.7, **columns)
    assert added(found) == {"viscous_friction", "coulomb_friction"}
    for name, value in RACK.items():
        assert found["values"][name]["value"] == pytest.approx(value, rel=0.05), name
