"""sample_logs/: every log is what its command makes, and `dsd detect` says of it what the README says."""

import importlib.util
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pyarrow.csv
import pyarrow.parquet
import pytest

from tests import warm

SAMPLES = Path(__file__).parents[2] / "sample_logs"
README = (SAMPLES / "README.md").read_text(encoding="utf-8")
COMMANDS = re.findall(r"^dsd (simulate .*)$", README, flags=re.MULTILINE)
LOGS = {shlex.split(command)[-1]: command for command in COMMANDS}
LARGEST = 400_000  # bytes

#: Share of judged labels that are right at least, the final label, and the share of confident labels that are right.
EXPECTED = {
    "paper-step.csv": (0.92, {"delay": 0.3, "inertia": 1.0}, 1.0),
    "paper-sine.csv": (1.0, {"delay": 0.3, "inertia": 1.0}, 1.0),
    "paper-delay-change.csv": (0.89, {"delay": 0.4, "inertia": 1.0}, 1.0),
    "servo-friction.csv": (0.93, {"delay": 0.002, "inertia": 0.01}, 1.0),
    "servo-load-change.parquet": (0.9, {"delay": 0.002, "inertia": 0.015}, 0.96),
}


def dsd(command: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    return warm.run(*shlex.split(command), cwd=cwd)


def read(path: Path) -> dict[str, np.ndarray]:
    table = pyarrow.csv.read_csv(path) if path.suffix == ".csv" else pyarrow.parquet.read_table(path)
    return {name: table[name].to_numpy() for name in table.column_names}


def provenance(path: Path) -> dict[str, str]:
    """What the log says of its making, without the version that made it."""
    if path.suffix == ".csv":
        found = json.loads(path.with_name(path.name + ".meta.json").read_text(encoding="utf-8"))
    else:
        metadata = pyarrow.parquet.read_schema(path).metadata
        found = {key.decode(): value.decode() for key, value in metadata.items() if key != b"ARROW:schema"}
    return {key: value for key, value in found.items() if key != "dsd_version"}


def test_every_log_has_its_config_and_command_and_is_small() -> None:
    files = {path.name for path in SAMPLES.iterdir() if path.suffix in (".csv", ".parquet")}
    assert files == set(LOGS) == set(EXPECTED)
    assert [name for name in files if not (SAMPLES / name).with_suffix(".toml").exists()] == []
    assert [name for name in files if (SAMPLES / name).stat().st_size > LARGEST] == []


@pytest.mark.parametrize("name", sorted(LOGS))
def test_its_command_makes_it_again(name: str, tmp_path: Path) -> None:
    shutil.copy((SAMPLES / name).with_suffix(".toml"), tmp_path)
    made = dsd(LOGS[name], tmp_path)
    assert made.returncode == 0, made.stderr
    kept, again = read(SAMPLES / name), read(tmp_path / name)
    assert list(kept) == list(again)
    assert provenance(SAMPLES / name) == provenance(tmp_path / name)
    for channel in kept:
        difference = np.abs(kept[channel] - again[channel])
        scale = max(float(np.abs(kept[channel]).max()), 1e-3)
        if name.startswith("servo"):  # a last bit may move the encoder by one step, and the loop goes on from there
            assert np.sqrt(np.mean(difference**2)) < 1e-2 * scale, channel
        else:
            assert difference.max() <= 1e-9 * scale, channel


@pytest.mark.parametrize("name", sorted(LOGS))
def test_detect_finds_what_the_readme_says(name: str) -> None:
    done = dsd(f"detect {name} -c {Path(name).stem}.toml --format json", SAMPLES)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    share, final, confident = EXPECTED[name]
    assert found["truth"]["share_correct"] >= share
    assert found["truth"]["share_correct_confident"] >= confident
    assert {axis: found["final"][axis] for axis in final} == pytest.approx(final)
    assert found["residual_rms"] <= found["rho"]


def test_without_the_friction_no_candidate_explains_the_servo() -> None:
    """The summary says so, and hardly any label is confident."""
    blind = "--set model.effects.coulomb_friction.level=0"
    done = dsd(f"detect servo-friction.csv -c servo-friction.toml {blind}", SAMPLES)
    assert "no candidate explains this log" in done.stdout
    found = json.loads(dsd(f"detect servo-friction.csv -c servo-friction.toml {blind} --format json", SAMPLES).stdout)
    assert found["residual_rms"] > 2 * found["rho"]
    assert found["confident_share"] < 0.05


@pytest.mark.parametrize("name", ["paper-step", "paper-sine", "paper-delay-change"])
def test_configs_of_the_paper_runs_are_the_templates(name: str) -> None:
    assert (SAMPLES / f"{name}.toml").read_text(encoding="utf-8") == dsd(f"init --template {name} -o -", SAMPLES).stdout


def test_config_of_the_servo_is_the_template() -> None:
    kept = (SAMPLES / "servo-friction.toml").read_text(encoding="utf-8")
    assert kept == dsd("init --template servo -o -", SAMPLES).stdout


def test_demo_says_what_its_comments_say(tmp_path: Path) -> None:
    """`make demo`: the hidden effects are found, with their values; then the change; its two checks hold and fail.

    Its page and its planned motion are those of the tests of `report` and of the loop of `plan`: here they are asked
    for with options that are there, and are not made.
    """
    shutil.copytree(SAMPLES, tmp_path / "sample_logs")
    (tmp_path / "bin").mkdir()
    here = f'"{sys.executable}" -m dsd_cli'
    made = 'report out/hidden.csv" | "plan out/short.csv'
    told = f'case "$1 $2" in "{made}") printf "%s\\n" "$@" >> asked.txt; exit;; esac'
    (tmp_path / "bin/dsd").write_text(f'#!/bin/sh\n{told}\nexec {here} "$@"\n')
    (tmp_path / "bin/dsd").chmod(0o755)
    path = os.pathsep.join([str(tmp_path / "bin"), os.environ["PATH"]])
    done = subprocess.run(
        ["sh", "sample_logs/demo.sh"],
        cwd=tmp_path,
        env={**os.environ, "PATH": path},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "final: delay 0.4, inertia 1 (confident)" in done.stdout
    assert "no candidate explains" not in done.stdout
    assert re.findall(r"^exit code (\d)$", done.stdout, flags=re.MULTILINE) == ["0", "3"]
    assert (tmp_path / "out/labels.csv").read_text().count("\n") == 3001
    effects = tomllib.loads((tmp_path / "out/better.toml").read_text())["model"]["effects"]
    assert effects["coulomb_friction"]["level"] == pytest.approx(0.15, rel=0.02)
    assert effects["viscous_friction"]["coefficient"] == pytest.approx(0.01, rel=0.02)
    asked = (tmp_path / "asked.txt").read_text().splitlines()
    assert [word for word in asked if word in ("report", "plan")] == ["report", "plan"]
    known = "".join(dsd(f"{command} --help", tmp_path).stdout for command in ("report", "plan"))
    assert [word for word in asked if word.startswith("-") and word not in known] == []
    played = ("mujoco.png",) if importlib.util.find_spec("mujoco") else ()
    for name in ("compare.png", "diagnose.png", "improve.png", *played):
        assert (tmp_path / "out" / name).read_bytes().startswith(b"\x89PNG")
