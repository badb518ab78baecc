"""`dsd passport`: values within limits, and what changed since when; on logs whose truth is known."""

import json
from pathlib import Path

import pytest

from tests.cli.rig import done, dsd, refused

SAMPLES = Path(__file__).parents[2] / "sample_logs"
RIG = SAMPLES / "servo-friction.toml"
LIMITS = """
[limits]
inertia = "within 10 %"
delay = "within 0.001"
[limits.coulomb_friction]
level = "within 20 %"
"""
#: Date -> Coulomb friction of that night; 0.15 was delivered.
NIGHTS = {"2026-03-01": 0.15, "2026-03-02": 0.17, "2026-03-03": 0.2, "2026-03-04": 0.21}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("passport")
    for seed, (date, level) in enumerate(NIGHTS.items()):
        changed = ("--set", f"model.effects.coulomb_friction.level={level}", "--duration", 2, "--seed", seed)
        done("simulate", "-c", RIG, *changed, "-o", f"{date}.csv", "-q", cwd=folder)
    (folder / "limits.toml").write_text(LIMITS)
    return folder


def passport(folder: Path, *arguments: object, limits: str = "limits.toml") -> object:
    return dsd("passport", RIG, *arguments, "--limits", limits, cwd=folder)


def test_a_log_within_its_limits_is_signed(folder: Path) -> None:
    ran = passport(folder, "2026-03-01.csv", "-o", "delivery.json")
    assert ran.returncode == 0, ran.stderr
    assert "2026-03-01.csv: within 3 limits" in ran.stdout
    document = json.loads((folder / "delivery.json").read_text())
    assert document["verdict"] == "within"
    assert document["readings"][0]["sha256"]
    by_name = {one["name"]: one for one in document["limits"]}
    friction = by_name["coulomb_friction.level"]
    assert abs(friction["value"] - 0.15) < 4.0 * friction["std_error"] + 1e-4
    assert (friction["low"], friction["high"]) == pytest.approx((0.12, 0.18))


def test_what_changed_by_how_many_sigma_since_which_log_is_one_line_and_3(folder: Path) -> None:
    """Given out of order: dates order them, and the newest decides."""
    ran = passport(folder, *(f"{date}.csv" for date in reversed(NIGHTS)), "--format", "json", "-q")
    assert ran.returncode == 3
    (line,) = ran.stderr.splitlines()
    assert line.startswith("dsd: error: coulomb_friction.level 0.2")
    assert "is above 0.18: +40 % (over 100 sigma) from 0.15, since 2026-03-03.csv (2026-03-03)" in line
    document = json.loads(ran.stdout)
    assert document["logs"] == [f"{date}.csv" for date in NIGHTS]
    assert [one["verdict"] for one in document["limits"]] == ["within", "within", "outside"]
    assert document["limits"][2]["outside"] == ["2026-03-03.csv", "2026-03-04.csv"]


def test_a_value_that_came_back_is_a_warning(folder: Path) -> None:
    (folder / "2026-03-05.csv").write_bytes((folder / "2026-03-01.csv").read_bytes())
    ran = passport(folder, "2026-03-04.csv", "2026-03-05.csv")
    assert ran.returncode == 0
    assert "coulomb_friction.level was outside of its limits in 2026-03-04.csv, and is not in 2026-03-05" in ran.stderr


def test_a_passport_is_the_reference_of_the_next_and_a_changed_one_is_refused(folder: Path) -> None:
    done("passport", RIG, "2026-03-02.csv", "--limits", "limits.toml", "-o", "p.json", "-q", cwd=folder)
    (folder / "next.toml").write_text('reference = "p.json"\n' + LIMITS)
    ran = passport(folder, "2026-03-03.csv", "--format", "json", "-q", limits="next.toml")
    assert ran.returncode == 0, ran.stderr  # 0.2 is within 20 % of 0.17
    document = json.loads(ran.stdout)
    assert document["reference"]["kind"] == "passport"
    friction = document["limits"][2]
    assert friction["sigma"] == pytest.approx(
        (friction["value"] - friction["reference"])
        / (friction["std_error"] ** 2 + friction["reference_error"] ** 2) ** 0.5
    )
    (folder / "p.json").write_text((folder / "p.json").read_text().replace('"within"', '"outside"', 1))
    refused(passport(folder, "2026-03-03.csv", limits="next.toml"), 2, "p.json: was changed after it was written")


def test_what_nothing_checked_is_not_signed(folder: Path) -> None:
    ran = passport(folder, "2026-03-01.csv", "--fix", "coulomb_friction.level", "-q")
    assert ran.returncode == 3
    assert "2026-03-01.csv does not identify coulomb_friction.level well enough for its limits" in ran.stderr


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("", "limits.toml: [limits] is missing or empty"),
        ("[limits]\ninertia = 3", "limits.inertia = 3: must be a text with at least one of within, min and max"),
        ('[limits]\ninertia = "within ten %"', "must be a text with at least one"),
        ('[limits]\ninertia = "max 20 %"', "max is a number in the unit of the value, without %"),
        ('[limits]\ninertia = "min 3, max 2"', "no value is within"),
        ('[limits]\ninertia = "max -1"', "no value is within"),
        ('[limits]\ninertai = "within 10 %"', "no value is called 'inertai'"),
        ('[limits.gravity]\nphase = "within 10 %"', "gravity.phase is an angle: write the change in rad"),
        ('[limits.gravity]\namplitude = "within 10 %"', "the delivered model has no such value"),
        ('[limits]\nrmse = "within 10 %"', "limits.rmse: the delivered model has no such value: the config has no"),
        ('reference = "none.json"\n[limits]\ninertia = "max 1"', "none.json: no such passport"),
        ('reference = "limits.toml"\n[limits]\ninertia = "max 1"', "unknown key reference"),
        ("[limits", "not valid TOML"),
    ],
)
def test_wrong_limits_are_one_line_and_2(folder: Path, text: str, line: str) -> None:
    (folder / "wrong").mkdir(exist_ok=True)
    (folder / "wrong" / "limits.toml").write_text(text)
    refused(passport(folder, "2026-03-01.csv", limits="wrong/limits.toml"), 2, line)


def test_no_input_is_written_over(folder: Path) -> None:
    before = (folder / "2026-03-01.csv").read_bytes()
    refused(passport(folder, "2026-03-01.csv", "-o", "2026-03-01.csv"), 2, "is the input")
    assert (folder / "2026-03-01.csv").read_bytes() == before
