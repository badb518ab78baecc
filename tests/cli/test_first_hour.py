"""What a newcomer meets: the help, a config, the catalogue, tables of 80 columns, completion, the next command."""

import json
import os
import re
import subprocess
import tomllib
from pathlib import Path

import numpy as np
import pyte
import pytest

from dsd_cli.cli.lazy import COMMANDS
from dsd_cli.effects import catalogue
from tests import warm
from tests.cli.rig import DSD, done, dsd, read_labels, same, without_signals, write

ROOT = Path(__file__).parents[2]
SAMPLES = ROOT / "sample_logs"
LOG = SAMPLES / "servo-friction.csv"
#: Of a u whose unit the config has; "per unit of u" is of the gain of a drive.
UNNAMED = re.compile(r"(?<!per )unit of u")


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A rig whose log has its own names and units, with a config that knows them, and folders below it."""
    folder = tmp_path_factory.mktemp("rig")
    log = read_labels(LOG)
    mine = {"t_ms": log["t"] * 1e3, "i_q": log["u"], "angle": np.rad2deg(log["position"])}
    write(folder, "raw.csv", mine)
    names = '[signals]\ntime = "t_ms"\ntime_unit = "ms"\nu = "i_q"\nu_unit = "N m"\nposition = "angle"\n'
    (folder / "dsd.toml").write_text(
        names + 'position_unit = "deg"\n\n' + without_signals(SAMPLES / "servo-bare.toml"), encoding="utf-8"
    )
    (folder / "runs/today").mkdir(parents=True)
    return folder


def words(text: str) -> set[str]:
    return set(re.sub("[─│╭╮╰╯]", " ", text).split())


@pytest.mark.parametrize(
    "command",
    [
        "check ../../raw.csv",
        "compare ../../raw.csv",
        "compare ../../raw.csv --horizon simulation",
        "compare ../../raw.csv -c ../../dsd.toml -c ../../other.toml",
        "diagnose ../../raw.csv --to 1",
        "improve ../../raw.csv --to 1 --auto",
        "detect ../../raw.csv",
        "detect ../../raw.csv --method dsd,average,viterbi",
        "tune ../../raw.csv",
        "effects",
        "effects flexible_coupling",
        "effects backlash",
        "--help",
    ],
)
def test_eighty_columns_cut_no_word(rig, command):
    """Every word of the same output on a terminal of 300 columns is there, whole, and nothing is left out."""
    (rig / "other.toml").write_text(
        (rig / "dsd.toml").read_text() + "\n[model.effects.viscous_friction]\ncoefficient = 0.01\n"
    )
    shown, effects = [], warm.FEW if command.startswith("improve") else ()
    for columns in (80, 300):
        screen = pyte.Screen(columns, 200)
        size = {"columns": columns, "lines": 200}
        written = warm.on_terminal(*command.split(), cwd=rig / "runs/today", **size, effects=effects)
        pyte.Stream(screen).feed(written.decode())
        shown.append(re.sub(r"\d+\.\d+ s\b", "", "\n".join(map(str.rstrip, screen.display))))
    assert not UNNAMED.search(shown[1])
    assert "…" not in shown[0]
    times = re.compile(r"\d+(\.\d+)?")  # of what takes how long, which differs from run to run
    lost = {word for word in words(shown[1]) - words(shown[0]) if not times.fullmatch(word)}
    assert lost == set(), shown[0]


@pytest.mark.parametrize(
    "command",
    [
        "add raw.csv coulomb_friction --to 1 -o added.toml",
        "learn raw.csv --to 1 -o learnt.toml",
        "plan raw.csv -o next.csv --seconds 4",
        "observe raw.csv -o seen.csv",
    ],
)
def test_the_unit_of_u_is_named_where_the_config_names_it(rig, command):
    """Of the other commands the test above asks it."""
    ran = dsd(*command.split(), cwd=rig, effects=warm.FEW)
    assert ran.returncode == 0, ran.stderr
    assert not UNNAMED.search(ran.stdout + ran.stderr)


def test_no_unit_is_no_empty_bracket():
    for effect in catalogue():
        assert "[]" not in done("effects", effect, cwd=ROOT).stdout


def test_the_nearest_config_upward_is_taken_and_said(rig):
    ran = done("compare", "../../raw.csv", "--format", "json", cwd=rig / "runs/today")
    assert ran.stderr.splitlines()[0] == "dsd: config: ../../dsd.toml"
    assert json.loads(ran.stdout)["force"]["unit"] == "N m"
    assert "config:" not in done("compare", "../../raw.csv", "-q", cwd=rig / "runs/today").stderr
    assert "config:" not in done("compare", "raw.csv", cwd=rig).stderr
    (rig / "runs/dsd.toml").write_text("[signals]\nu = 1\n")
    try:
        assert "../dsd.toml: signals.u" in dsd("compare", "../../raw.csv", cwd=rig / "runs/today").stderr
        named = done("compare", "../../raw.csv", "-c", "../../dsd.toml", cwd=rig / "runs/today")
        assert "config:" not in named.stderr
    finally:
        (rig / "runs/dsd.toml").unlink()


def test_no_config_anywhere_is_one_line(tmp_path):
    ran = dsd("detect", LOG, cwd=tmp_path)
    assert ran.returncode == 2
    assert ran.stderr.startswith("dsd: error: dsd.toml: no such config file: `dsd init` writes one")


@pytest.mark.parametrize("kind", ["csv", "parquet"])
def test_a_log_that_observe_wrote_is_read_by_the_same_config(rig, kind):
    """Names, milliseconds and degrees of [signals] are in it; they are not asked for, nor applied, once more."""
    out = f"observed.{kind}"
    done("observe", "raw.csv", "-o", out, cwd=rig)
    figures = [json.loads(done("compare", log, "--format", "json", cwd=rig).stdout) for log in ("raw.csv", out)]
    assert figures[1]["force"]["unit"] == "N m"
    for name in ("rmse", "band_hz", "floor"):
        assert figures[1]["force"][name] == pytest.approx(figures[0]["force"][name], rel=1e-6), name
    assert figures[1]["sample_time"] == 0.001
    done("detect", "raw.csv", "-o", "a.parquet", cwd=rig)
    done("detect", out, "-o", "b.parquet", cwd=rig)
    same(read_labels(rig / "a.parquet"), read_labels(rig / "b.parquet"), single=True)
    done("check", out, cwd=rig)
    done("observe", out, "-o", "again.csv", cwd=rig)


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (("diagnose", "raw.csv", "--holdout", "nope.csv"), "nope.csv: no such file"),
        (("compare", "raw.csv", "nope.csv"), "nope.csv: no such file"),
        (("simulate", "--reference", "nope.csv", "-o", "x.csv"), "nope.csv: no such file"),
        (("add", "raw.csv", "coulomb_friction", "--effects-from", "nope.py", "-o", "x.toml"), "nope.py: no such file"),
        (("plan", "raw.csv", "--diagnosis", "nope.json", "-o", "x.csv"), "nope.json: no such file"),
        (("init", "--template", "nope"), "no template 'nope'"),
    ],
)
def test_a_message_names_its_file(rig, arguments, named):
    ran = dsd(*arguments, cwd=rig)
    assert ran.returncode in (1, 2)
    assert ran.stderr.splitlines()[-1].startswith(f"dsd: error: {named}")


def test_every_command_has_its_whole_line_in_the_help():
    text = dsd("--help", cwd=ROOT, COLUMNS="80").stdout
    assert "..." not in text.partition("Commands:")[2]
    assert all(re.search(rf"^  {name} ", text, flags=re.MULTILINE) for name in COMMANDS)


def test_init_says_what_can_be_asked(tmp_path):
    ran = done("init", cwd=tmp_path)
    text = (tmp_path / "dsd.toml").read_text()
    for command in ("check", "compare", "diagnose", "improve", "detect"):
        assert f"dsd {command} LOG" in text
        assert command in ran.stderr
    tomllib.loads(text)


def test_the_catalogue_fits_a_screen_with_whole_laws():
    text = dsd("effects", cwd=ROOT, COLUMNS="80").stdout
    lines = text.splitlines()
    assert len(lines) <= 40
    assert max(map(len, lines)) <= 100  # the two lines at the foot are broken where a person reads them
    bare = " ".join(text.split())
    for effect in catalogue().values():
        assert f"{effect.id} {effect.law}" in bare


def test_regimes_that_overlap_say_so():
    shown = done("compare", LOG, "-c", SAMPLES / "servo-bare.toml", cwd=ROOT).stdout
    assert "(accelerating)" in shown
    assert "(in brackets): samples that the other regimes have, too" in shown


def complete(line: str) -> list[str]:
    """What a bash offers at the end of that line."""
    environment = {**os.environ, "_DSD_COMPLETE": "complete_bash", "COMP_WORDS": line}
    environment["COMP_CWORD"] = str(len(line.split(" ")) - 1)
    ran = subprocess.run(DSD, env=environment, capture_output=True, text=True, check=False)
    assert (ran.returncode, ran.stderr) == (0, "")
    return ran.stdout.split()


@pytest.mark.parametrize(
    ("line", "offered"),
    [
        ("dsd com", ["compare"]),
        ("dsd compare --ho", ["--holdout", "--horizon"]),
        ("dsd fleet dia", ["diagnose"]),
        ("dsd add log.csv cou", ["coulomb_friction"]),
        ("dsd effects visc", ["viscous_asymmetry", "viscous_friction"]),
        ("dsd init --template pap", ["paper-delay-change", "paper-sine", "paper-step"]),
        ("dsd diagnose --format j", ["json"]),
    ],
)
def test_completion(line, offered):
    assert sorted(complete(line)) == offered


def test_completion_is_installed_by_one_option(tmp_path):
    shell = "import sys; from typer import completion; completion._get_shell_name = lambda: 'bash'; "
    run = "from dsd_cli.cli.main import run; sys.exit(run(['--show-completion']))"
    ran = subprocess.run([DSD[0], "-c", shell + run], capture_output=True, text=True, check=False)
    assert ran.returncode == 0
    assert "_DSD_COMPLETE=complete_bash" in ran.stdout
    assert "--install-completion" in dsd("--help", cwd=tmp_path).stdout


def test_a_log_without_d_hat_needs_no_observer_and_one_with_it_does(tmp_path):
    text = (SAMPLES / "servo-friction.toml").read_text()
    start = text.index("[observer]")
    (tmp_path / "without.toml").write_text(text[:start] + text[text.index("[model]") :])
    rows = [line.split(",") for line in (SAMPLES / "servo-friction.csv").read_text().splitlines()]
    bare = "\n".join(",".join((t, u, position)) for t, u, _, position, *_ in rows)
    (tmp_path / "bare.csv").write_text(bare + "\n")
    of_either = [
        dsd("add", "bare.csv", "inertia", "-c", str(config), "-o", "-", cwd=tmp_path).stderr.partition("detector")[0]
        for config in (SAMPLES / "servo-friction.toml", tmp_path / "without.toml")
    ]
    assert of_either[0] == of_either[1] != ""
    refused = dsd("diagnose", str(SAMPLES / "servo-friction.csv"), "-c", "without.toml", cwd=tmp_path)
    assert refused.returncode == 2
    assert "[observer] is missing" in refused.stderr
