"""`dsd learn` on real axes: a law only where the config that has it explains the log better than the one without."""

from __future__ import annotations

import json

from tests import warm
from tests.recordings import EMPS, recording

#: What `improve` finds of the arm's axis; the line in time stands in for something that nobody knows.
ARM = """
[signals]
time = "t_s"
u = "u_torque_motor_Nm"
d_hat = ""
velocity = "velocity_rad_s"
position = "position_rad"
reference = ""
[observer]
nominal_inertia = 7.9
time_constant = 0.02
[model]
inertia = 8.0
[model.effects.viscous_friction]
coefficient = 6.84
[model.effects.coulomb_friction]
level = 1.61
[model.effects.periodic_disturbance]
amplitude = 0.545
frequency = 0.565
phase = 0.168
"""


def test_a_law_that_helps_the_held_out_blocks_alone_is_not_learnt(tmp_path):
    """One move to and fro: without a block of it the model's own values are loose, and any law makes up for that."""
    (tmp_path / "dsd.toml").write_text(ARM, encoding="utf-8")
    log = recording("kuka_kr300/joint1_traj_A.csv")
    done = warm.run("learn", log, "-o", "learnt.toml", "--format", "json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    rmse = []
    for config in ("dsd.toml", "learnt.toml"):
        compared = warm.run("compare", log, "-c", config, "--format", "json", cwd=tmp_path)
        rmse.append(json.loads(compared.stdout)["force"]["rmse"])
    assert result["verdict"] != "learnt" or rmse[1] < 0.97 * rmse[0]
    assert result["formula"] is None or result["verdict"] == "learnt"


#: A crawl under ripple, as the ladder leaves it: u tells nothing of the inertia.
CRAWL = """
[signals]
time = "t_s"
u = "u_current_A"
velocity = ""
position = "position_rad"
[observer]
nominal_inertia = 0.00352
time_constant = 0.02
[model]
inertia = 0.000202
[model.effects.cogging]
amplitude = 0.779
periods = 7.03
phase = 2.44
"""


def test_a_crawl_under_cogging_teaches_no_law_of_u(tmp_path):
    """u on the motion gives 45 times the inertia there: by that one the motion would answer u, and any gain do."""
    (tmp_path / "dsd.toml").write_text(CRAWL, encoding="utf-8")
    log = recording("odrive_cogging/slow2_nocomp_0.csv")
    done = warm.run("learn", log, "--to", "5", "-o", "learnt.toml", "--format", "json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "u" not in json.loads(done.stdout)["channels"]


#: A rack's servo, a bare mass.
RACK = """
[signals]
time = "t_s"
u = "u_force_N"
velocity = "velocity_m_s"
position = ""
[observer]
nominal_inertia = 24.7
time_constant = 0.01
[model]
inertia = 24.7
"""


def test_a_move_of_half_a_second_teaches_no_law(tmp_path):
    """Forty independent equations: a limit of u at 78 N "explained" half of them and made the other half worse."""
    (tmp_path / "dsd.toml").write_text(RACK, encoding="utf-8")
    log = recording("rack_pinion/merged_raw_clock.csv")
    done = warm.run("learn", log, "-o", "learnt.toml", "--format", "json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert result["verdict"] == "none"
    assert "too short" in result["why"]


#: A linear axis as the ladder leaves its first half.
LINEAR = (
    EMPS.replace("\ninertia = 95\n", "\ninertia = 94.95\n")
    + """
[model.effects.coulomb_friction]
level = 20.9
[model.effects.viscous_friction]
coefficient = 199.6
[model.effects.viscous_asymmetry]
coefficient = -37.7
"""
)


def test_what_the_first_half_of_a_record_teaches_lowers_the_force_error_of_the_second(tmp_path):
    """Speed and position each have their own curve; one table over both leaves three quarters (1.4 N of 1.8)."""
    (tmp_path / "dsd.toml").write_text(LINEAR, encoding="utf-8")
    log = recording("emps/emps_train.csv")
    done = warm.run("learn", log, "--to", "12.42", "-o", "learnt.toml", "--format", "json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert {"velocity", "position"} <= set(json.loads(done.stdout)["channels"])
    force = []
    for config in ("dsd.toml", "learnt.toml"):
        compared = warm.run("compare", log, "-c", config, "--from", "12.42", "--format", "json", cwd=tmp_path)
        force.append(json.loads(compared.stdout)["force"]["rmse"])
    assert force[1] < 0.7 * force[0]


#: A wheel drive, after the ladder.
DRIVETRAIN = """
[signals]
time = "t"
u = "u"
velocity = "velocity"
position = "position"
[observer]
nominal_inertia = 0.08
time_constant = 0.05
[model]
inertia = 0.142402
[model.effects.viscous_friction]
coefficient = 1.20899
[model.effects.coulomb_friction]
level = 0.737899
"""


def test_logs_of_one_way_each_teach_no_law_over_velocity_and_position(tmp_path):
    """A slow ramp one way and a fast start the other: any force over time is a function of both there."""
    (tmp_path / "dsd.toml").write_text(DRIVETRAIN, encoding="utf-8")
    seen, unseen = (
        [recording(f"frc_drivetrain/{name}.csv") for name in names]
        for names in (("slow_forward", "fast_backward"), ("slow_backward", "fast_forward"))
    )
    done = warm.run("learn", *seen, "-o", "learnt.toml", "--format", "json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert result["verdict"] != "learnt"
    assert "over time" in result["why"]
    rmse = []
    for config in ("dsd.toml", "learnt.toml"):
        compared = warm.run("compare", *unseen, "-c", config, "--format", "json", cwd=tmp_path)
        rmse.append(json.loads(compared.stdout)["force"]["rmse"])
    assert rmse[1] <= rmse[0]
