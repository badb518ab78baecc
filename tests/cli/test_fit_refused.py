"""Options of the fit and of the window that cannot be: one line, which names the option and says how to mend it."""

from pathlib import Path

import pytest

from dsd_cli.cli.main import run
from tests.cli.rig import dsd, refused, without_signals

SAMPLES = Path(__file__).parents[2] / "sample_logs"
LOG, KNOWN, BARE = "servo-friction.csv", "servo-friction.toml", "servo-bare.toml"

#: Option, its text, what the line must say.
FORMS = [
    ("--fix", "", "write NAME=VALUE"),
    ("--fix", "=3", "write NAME=VALUE"),
    ("--fix", "inertia=", "write NAME=VALUE"),
    ("--fix", "inertia=x", "'x' is no number"),
    ("--fix", "inertia==3", "'=3' is no number"),
    ("--fix", "inertia=nan", "finite"),
    ("--fix", "inertia=inf", "finite"),
    ("--fix", "inertia=0", "above 0"),
    ("--fix", "inertia=-1", "above 0"),
    ("--fix", "inertia=0.35kg", "write 0.35 without a unit"),
    ("--fix", "delay=2ms", "write 0.002 without a unit"),
    ("--fix", "inertia=3.5e-1 kg m^2", "write 3.5e-1 without a unit"),
    ("--fix", "inertia=0,35", "write 0.35, with a point"),
    ("--fix", "inertai=1", "did you mean inertia?"),
    ("--fix", "mass=3", "did you mean inertia?"),
    ("--fix", "a.b.c=1", "`dsd effects` lists them"),
    ("--fix", "viscous_friction=3", "write viscous_friction.coefficient"),
    ("--fix", "viscous_friction", "write viscous_friction.coefficient"),
    ("--fix", "viscous.coefficient=1", "did you mean viscous_friction.coefficient?"),
    ("--fix", "viscous_friction.level=3", "it has coefficient"),
    ("--fix", "viscous_friction.coefficient=-1", "at least 0"),
    ("--fix", "stribeck_friction.excess", "[model] has no stribeck_friction.excess to hold"),
    ("--fix", "external_force.events=1", "is a list"),
    ("--fix", "delay=-1", "at least 0"),
    ("--fix", "delay=1e9", "at most 10000"),
    ("--bounds", "", "write NAME=LOW:HIGH"),
    ("--bounds", "inertia", "write NAME=LOW:HIGH"),
    ("--bounds", "inertia=", "write NAME=LOW:HIGH"),
    ("--bounds", "inertia=:", "write NAME=LOW:HIGH"),
    ("--bounds", "inertia=1-3", "write NAME=LOW:HIGH"),
    ("--bounds", "inertia=1:2:3", "write NAME=LOW:HIGH"),
    ("--bounds", "inertia=5:1", "the smaller number comes first"),
    ("--bounds", "inertia=1:1", "--fix inertia=1"),
    ("--bounds", "inertia=nan:3", "finite"),
    ("--bounds", "inertia=inf:3", "finite"),
    ("--bounds", "inertia=0.1kg:1", "write 0.1 without a unit"),
    ("--bounds", "inertia=0,1:1", "write 0.1, with a point"),
    ("--bounds", "mass=1:2", "did you mean inertia?"),
    ("--bounds", "viscous_friction.coefficient=-5:-1", "at least 0"),
    ("--bounds", "coulomb_friction=0:1", "write coulomb_friction.level"),
    ("--prior", "", "write NAME=VALUE+-SPREAD"),
    ("--prior", "inertia", "write NAME=VALUE+-SPREAD"),
    ("--prior", "inertia=0.35", "write NAME=VALUE+-SPREAD"),
    ("--prior", "inertia=0.35+-0", "the standard deviation must be above 0 (to hold a value: --fix inertia=0.35)"),
    ("--prior", "inertia=0.35+--1", "the standard deviation must be above 0"),
    ("--prior", "inertia=nan+-1", "finite"),
    ("--prior", "inertia=1+-inf", "finite"),
    ("--prior", "inertia=x+-1", "'x' is no number"),
    ("--prior", "inertia=-1+-0.1", "above 0"),
    ("--prior", "inertia=0.35kg+-0.02", "write 0.35 without a unit"),
    ("--prior", "inertia=0.35+-x%", "'x' is no number"),
    ("--prior", "delay=0+-5%", "the standard deviation must be above 0"),
    ("--prior", "mass=1+-1", "did you mean inertia?"),
    ("--prior", "viscous_friction.level=1+-1", "it has coefficient"),
]
#: Options that contradict each other, or the file; what the line must say of both.
TOGETHER = [
    (["--fix", "inertia=0.3", "--fix", "inertia=0.4"], ["--fix inertia=0.3 and --fix inertia=0.4"]),
    (["--bounds", "inertia=0:1", "--bounds", "inertia=0:2"], ["--bounds inertia=0:1 and --bounds inertia=0:2"]),
    (["--prior", "delay=1+-1", "--prior", "delay=2+-1"], ["--prior delay=1+-1 and --prior delay=2+-1"]),
    (["--fix", "inertia=0.3", "--prior", "inertia=0.3+-0.1"], ["--fix inertia=0.3 and", "held needs no more"]),
    (["--bounds", "inertia=0:1", "--fix", "inertia=0.3"], ["--fix inertia=0.3 and", "held needs no more"]),
    (["--bounds", "inertia=0:1", "--prior", "inertia=2+-0.1"], ["--prior", "2 is outside", "(--bounds inertia=0:1)"]),
    (["--bounds", "delay=1:2"], ["--bounds delay=1:2: its prior, 0.5 +- 0.1 (fit.prior of rig.toml), is outside"]),
    (["--prior", "inertia=2+-0.1"], ["--prior inertia=2+-0.1: 2 is outside", "0 to 1 (fit.bounds of rig.toml)"]),
    (["--from", "2", "--to", "1"], ["--from 2 and --to 1"]),
    (["--from", "1", "--to", "1"], ["--from 1 and --to 1"]),
    (["--from", "9"], ["--from 9 and signals.end = 8 of rig.toml"]),
    (["--from", "nan"], ["--from nan: must be a finite number"]),
    (["--to", "inf"], ["--to inf: must be a finite number"]),
    (["--from", "x"], ["'--from'", "not a number"]),
    (["--to", "1s"], ["'--to'", "not a number"]),
]


def _line(capsys) -> str:
    """The one line that was said."""
    said = capsys.readouterr()
    assert said.out == ""
    (line,) = said.err.splitlines()
    assert line.startswith("dsd: error: ")
    return line.removeprefix("dsd: error: ")


@pytest.mark.parametrize(("option", "text", "words"), FORMS, ids=[" ".join(row[:2]) for row in FORMS])
def test_a_text_that_cannot_be_is_said_of_the_option(option, text, words, monkeypatch, capsys):
    monkeypatch.chdir(SAMPLES)
    assert run(["compare", LOG, "-c", BARE, option, text]) == 2
    line = _line(capsys)
    assert line.startswith(f"{option} {text}".rstrip() + ":")
    assert words in line
    assert ".toml" not in line
    assert "fit." not in line


@pytest.mark.parametrize(("given", "words"), TOGETHER, ids=[" ".join(row[0]) for row in TOGETHER])
def test_options_that_contradict_each_other_or_the_file_are_both_named(given, words, tmp_path, monkeypatch, capsys):
    text = '[signals]\nend = 8\n[fit]\nprior = { delay = "0.5+-0.1" }\nbounds = { inertia = [0, 1] }\n'
    (tmp_path / "rig.toml").write_text(text + without_signals(SAMPLES / BARE))
    monkeypatch.chdir(tmp_path)
    assert run(["compare", str(SAMPLES / LOG), "-c", "rig.toml", *given]) == 2
    line = _line(capsys)
    for word in words:
        assert word in line
    assert "--set" not in line


@pytest.mark.parametrize(
    "command",
    [
        ("compare", LOG),
        ("diagnose", LOG),
        ("add", LOG, "coulomb_friction", "-o", "-"),
        ("improve", LOG, "--auto"),
        ("report", LOG, "-o", "-"),
    ],
    ids=lambda command: command[0],
)
def test_every_command_that_fits_says_so(command):
    given = ("-c", BARE, "--prior", "inertia=0.01+-0")
    refused(dsd(*command, *given, cwd=SAMPLES), 2, "--prior inertia=0.01+-0: the standard deviation must be above 0")


def test_a_window_without_rows_says_what_the_log_has():
    for window in (("--from", "100"), ("--to", "-1")):
        refused(dsd("compare", LOG, "-c", BARE, *window, cwd=SAMPLES), 1, "from 0 s to 2.999 s", "--from and --to")


def test_a_learnt_value_that_its_bounds_leave_out_is_no_prior():
    given = ("--auto", "--from-prior", "--bounds", "inertia=1:2")
    refused(dsd("improve", LOG, "-c", KNOWN, *given, cwd=SAMPLES), 2, "--from-prior: inertia = 0.01", "1 to 2")


@pytest.mark.parametrize(
    ("horizon", "words"),
    [
        ("-1s", "above 0"),
        ("0s", "above 0"),
        ("0", "above 0"),
        ("nan", "above 0"),
        ("inf", "write simulation"),
        ("1 h", "such as 0.5s or 50ms"),
        ("ms", "such as 0.5s or 50ms"),
        ("s", "such as 0.5s"),
        ("whole", "such as 0.5s"),
        ("0.0004s", "the samples are 0.001 s apart"),
    ],
)
def test_a_horizon_that_cannot_be(horizon, words, monkeypatch, capsys):
    monkeypatch.chdir(SAMPLES)
    assert run(["compare", LOG, "-c", BARE, f"--horizon={horizon}", "--quiet"]) == 2
    line = _line(capsys)
    assert line.startswith(f"--horizon {horizon}:")
    assert words in line


SHORT = ["--from", "1", "--to", "1.01"]
_WIDEN = "only its part from 1 s to 1.01 s is read, widen --from and --to"


@pytest.mark.parametrize(
    "command",
    [
        ("compare", LOG),
        ("compare", LOG, "-c", KNOWN),
        ("diagnose", LOG),
        ("improve", LOG, "--auto"),
        ("add", LOG, "coulomb_friction", "-o", "-"),
        ("detect", LOG),
        ("detect", LOG, "--method", "dsd,imm"),
        ("tune", LOG),
    ],
    ids=" ".join,
)
def test_a_part_that_is_too_short_is_to_be_widened(command, monkeypatch, capsys):
    monkeypatch.chdir(SAMPLES)
    assert run([*command, "-c", BARE, "--quiet", *SHORT]) == 1
    assert _WIDEN in _line(capsys)


def test_a_part_that_is_too_short_for_blocks_is_to_be_widened(monkeypatch, capsys):
    monkeypatch.chdir(SAMPLES)
    assert run(["diagnose", LOG, "-c", BARE, "--quiet", "--from", "1", "--to", "1.1"]) == 1
    assert "widen --from and --to" in _line(capsys)


def test_what_is_left_to_hold_out_may_be_too_short(monkeypatch, capsys):
    monkeypatch.chdir(SAMPLES)
    assert run(["diagnose", LOG, "-c", BARE, "--quiet", "--to", "2.99", "--holdout", LOG]) == 1
    line = _line(capsys)
    assert "leave more of the log to hold out" in line
    assert "widen" not in line


def test_check_says_to_widen_too(monkeypatch, capsys):
    monkeypatch.chdir(SAMPLES)
    assert run(["check", LOG, "-c", BARE, "--quiet", *SHORT]) == 0
    assert "widen --from and --to, or a longer log" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("command", "option", "words"),
    [
        (
            "check",
            "--prior",
            "check judges what is identifiable from the log alone; diagnose, add and improve take --prior",
        ),
        ("check", "--fix", "diagnose, add and improve take --fix"),
        ("compare", "--hold", "compare fits nothing"),
    ],
)
def test_an_option_of_another_command_says_why_this_one_has_none(command, option, words, monkeypatch, capsys):
    monkeypatch.chdir(SAMPLES)
    assert run([command, LOG, "-c", BARE, option, "inertia=0.01+-0.001"]) == 2
    assert words in _line(capsys)


def test_what_is_wrong_with_an_option_is_said_before_that_nobody_can_be_asked():
    wrong = dsd("improve", LOG, "-c", KNOWN, "--bounds", "inertia=5:1", cwd=SAMPLES)
    assert wrong.returncode == 2
    assert "the smaller number comes first" in wrong.stderr
    alone = dsd("improve", LOG, "-c", KNOWN, "--spread", "0.3", cwd=SAMPLES)
    assert alone.returncode == 2
    assert "--spread 0.3 without --from-prior" in alone.stderr


def test_two_configs_that_read_a_log_differently_are_not_compared(tmp_path):
    """In mN the same machine has a thousand times the inertia: the order decided which model was better."""
    signals = '[signals]\nu_unit = "N m"\nu_scale = 1.0\n'
    model = "[observer]\nnominal_inertia = 0.01\ntime_constant = 0.005\n[model]\ninertia = 0.01\ndelay = 0.002\n"
    texts = {"a.toml": signals + model, "b.toml": signals.replace("1.0", "1000.0") + model, "c.toml": model}
    for name, text in texts.items():
        (tmp_path / name).write_text(text)
    log = SAMPLES / LOG
    refused_ = dsd("compare", log, "-c", "a.toml", "-c", "b.toml", cwd=tmp_path)
    assert refused_.returncode == 2
    assert "a.toml and b.toml read a log differently (signals.u_scale)" in refused_.stderr
    assert dsd("compare", log, "-c", "a.toml", "-c", "c.toml", cwd=tmp_path).returncode == 0
    (tmp_path / "n.toml").write_text('[signals]\nu_unit = "N m"\n' + model)
    assert dsd("compare", log, "-c", "c.toml", "-c", "n.toml", cwd=tmp_path).returncode == 0, "a name alone"
