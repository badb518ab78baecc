"""`dsd.toml`: what is read, and for every mistake one line that names file, key, what was found, what is allowed."""

import re
from pathlib import Path

import pytest

from dsd_cli.errors import UsageError
from dsd_cli.files.config import Observer, Signals, Simulate, States, Stay, TransitionFile, load_config, parse_config
from dsd_cli.files.template import load_template, template_names

OBSERVER = "[observer]\nnominal_inertia = 1\ntime_constant = 0.01\n"
STATES = "[states]\ndelays = [0.2, 0.3]\ninertias = [0.5, 1.0]\n"
SIMULATE = "[simulate]\nduration = 1\nsample_time = 0.001\n"
REFERENCE = '[simulate.reference]\nkind = "step"\n'
CONTROLLER = '[simulate.controller]\nkind = "pd"\nkp = 1\nkd = 1\n'
COULOMB = "[model.effects.coulomb_friction]\nlevel = "


def test_an_empty_config_has_the_defaults() -> None:
    config = parse_config("")
    assert config.signals == Signals()
    assert (config.signals.time, config.signals.u, config.signals.d_hat) == ("t", "u", "d_hat")
    assert (config.detector.window, config.detector.rho, config.detector.transition) == (100, 0.3, "uniform")
    assert config.observer is None
    assert config.model.effects == {}


def test_values_are_typed_and_integers_are_numbers() -> None:
    config = parse_config(OBSERVER + STATES + '[detector]\ntransition = { file = "A.csv" }\n', folder=Path("rigs"))
    assert config.require(Observer).nominal_inertia == 1.0
    assert isinstance(config.require(Observer).nominal_inertia, float)
    assert config.require(States).delays == (0.2, 0.3)
    assert config.detector.transition == TransitionFile(file="A.csv")
    assert config.resolve("A.csv") == Path("rigs/A.csv")
    assert parse_config("[detector]\ntransition.stay = 0.9").detector.transition == Stay(stay=0.9)


def test_sections_are_read_only() -> None:
    with pytest.raises(AttributeError):
        parse_config(OBSERVER).require(Observer).sign = -1


def test_sample_time_stands_for_a_missing_time_column() -> None:
    signals = parse_config("[signals]\nsample_time = 0.001\nvelocity = ''").signals
    assert (signals.time, signals.sample_time, signals.velocity) == (None, 0.001, None)
    assert "time" not in signals.columns()


def test_says_tells_what_was_written_from_defaults() -> None:
    config = parse_config("[signals]\nd_hat = 'd'")
    assert config.says("signals.d_hat")
    assert not config.says("signals.u")
    assert not config.says("signals.d_hat.x")


MISTAKES = {
    "unknown key, near": ("[detector]\nwindw = 3", "unknown key detector.windw: did you mean window?"),
    "unknown key, far": ("[states]\nzzzz = 3", "unknown key states.zzzz: known here are delays, inertias, effects"),
    "a factor of 0": ("[signals]\nvelocity_scale = 0", "signals.velocity_scale = 0: must be a number other than 0"),
    "a negative scale of u": ("[signals]\nu_scale = -2", "signals.u_scale = -2: must be a number above 0"),
    "a sign that is none": ("[signals]\nu_sign = 0", "signals.u_sign = 0: must be one of 1, -1"),
    "an infinite factor": ("[signals]\nposition_scale = inf", "signals.position_scale = inf: must be a finite number"),
    "no way to hold": ('[signals]\nu_hold = "foh"', 'signals.u_hold = "foh": must be one of "held", "sampled"'),
    "unknown section": ("[detectr]\nwindow = 3", "unknown section detectr: did you mean detector?"),
    "section is a value": ("detector = 3", "detector = 3: must be a table, written [detector]"),
    "missing key": ("[observer]\ntime_constant = 0.01", "[observer] nominal_inertia is missing: nominal inertia Jn"),
    "no number": ('[observer]\nnominal_inertia = "1"', "[observer] time_constant is missing"),
    "text for number": (OBSERVER + 'sign = "1"', 'observer.sign = "1": must be one of 1, -1'),
    "flag for sign": (OBSERVER + "sign = true", "observer.sign = true: must be one of 1, -1"),
    "number for text": ("[signals]\nu = 3", "signals.u = 3: must be a text in quotes"),
    "column number": ("[signals]\nd_hat = 3", "signals.d_hat = 3: must be a column name"),
    "no u": ('[signals]\nu = ""', 'signals.u = "": no column given'),
    "no clock": ('[signals]\ntime = ""', "[signals] sample_time is missing"),
    "two clocks": ('[signals]\ntime = "t"\nsample_time = 1', "signals.sample_time = 1.0: must be left out"),
    "column twice": ('[signals]\nd_hat = "u"', 'signals.d_hat = "u": must be another column: signals.u has it'),
    "unit": ('[signals]\ntime_unit = "min"', 'time_unit = "min": must be one of "s", "ms", "us", "ns", "100ns"'),
    "flag": ("[detector]\nobserver_filter = 1", "detector.observer_filter = 1: must be true or false"),
    "fraction": ("[detector]\nwindow = 1.5", "detector.window = 1.5: must be an integer of at least 1"),
    "zero window": ("[detector]\nwindow = 0", "detector.window = 0: must be an integer of at least 1"),
    "zero rho": ("[detector]\nrho = 0", "detector.rho = 0: must be a number above 0"),
    "nan": ("[detector]\nrho = nan", "detector.rho = nan: must be a number above 0"),
    "inf": ("[model]\ndelay = inf", "model.delay = inf: must be a number of at least 0"),
    "huge": ("[detector]\nrho = 1" + "0" * 400, "must be a number above 0"),
    "date": ("[detector]\nrho = 2024-01-01", "detector.rho = 2024-01-01: must be a number above 0"),
    "negative hold": ("[detector]\nhold = -1", "detector.hold = -1: must be a number of at least 0"),
    "method": ('[detector]\nmethod = "hmm"', 'detector.method = "hmm": must be one of "dsd"'),
    "average": ("[detector]\naverage = 3", 'detector.average = 3 contradicts detector.method = "dsd"'),
    "transition word": ('[detector]\ntransition = "sticky"', 'detector.transition = "sticky": must be "uniform"'),
    "transition table": ("[detector]\ntransition = { go = 1 }", "detector.transition = { go = 1 }: must be"),
    "stay": ("[detector]\ntransition.stay = 1.1", "detector.transition.stay = 1.1: must be a number of at least 0 and"),
    "empty grid": ("[states]\ndelays = []\ninertias = [1]", "states.delays = []: must be a list, not empty"),
    "no list": ("[states]\ndelays = 0.3\ninertias = [1]", "states.delays = 0.3: must be a list, not empty"),
    "delay missing": ("[states]\ninertias = [1]", "[states] delays is missing: candidate delays (s)"),
    "delay twice": ("[states]\ndelays = [1, 1.0]\ninertias = [1]", "states.delays = [1, 1.0]: 1 is in it twice"),
    "negative delay": ("[states]\ndelays = [0, -1]\ninertias = [1]", "states.delays[1] = -1: must be a number of at"),
    "zero inertia": ("[states]\ndelays = [0]\ninertias = [0]", "states.inertias[0] = 0: must be a number above 0"),
    "initial": (
        STATES + "[detector]\ninitial = { delay = 0.4, inertia = 1 }",
        "detector.initial.delay = 0.4: must be one of states.delays = [0.2, 0.3]",
    ),
    "effect": ("[model.effects.coulomb]\nlevel = 1", "unknown effect model.effects.coulomb: did you mean coulomb_fric"),
    "parameter": (
        COULOMB + "1\nlevl = 2",
        "unknown parameter model.effects.coulomb_friction.levl: did you mean level?",
    ),
    "no parameter": ("[model.effects.coulomb_friction]", "[model.effects.coulomb_friction] level is missing: Fc, the"),
    "no parameters": (
        "[model.effects.cogging]\namplitude = 0.1",
        "[model.effects.cogging] periods and phase are missing: periods: n: periods per turn",
    ),
    "bounds": (COULOMB + "-1", "model.effects.coulomb_friction.level = -1: must be a number of at least 0"),
    "effect value": (
        "[model.effects]\ncoulomb_friction = 1",
        "must be a table, written [model.effects.coulomb_friction]",
    ),
    "axis bounds": (
        STATES + "[states.effects.coulomb_friction]\nlevel = [0, -1]",
        "states.effects.coulomb_friction.level[1] = -1: must be a number of at least 0",
    ),
    "no reference": (SIMULATE + CONTROLLER, "[simulate] reference is missing"),
    "no kind": (
        SIMULATE + CONTROLLER + "[simulate.reference]\ntime = 1",
        "[simulate.reference] kind is missing: one of",
    ),
    "kind": (
        SIMULATE + CONTROLLER + '[simulate.reference]\nkind = "ramp"',
        'simulate.reference.kind = "ramp": must be one of',
    ),
    "key of another kind": (SIMULATE + CONTROLLER + REFERENCE + "speed = 1", "unknown key simulate.reference.speed"),
    "half the gains": (
        SIMULATE + REFERENCE + '[simulate.controller]\nkind = "pd"\nkp = 1',
        "[simulate.controller] kd is missing: kp is given",
    ),
    "no gains": (
        SIMULATE + REFERENCE + '[simulate.controller]\nkind = "pd"',
        "[simulate.controller] time_constant is missing",
    ),
    "both gains": (SIMULATE + REFERENCE + CONTROLLER + "time_constant = 1", "has kp, kd and time_constant"),
    "open loop": (SIMULATE + REFERENCE + CONTROLLER.replace("pd", "open_loop"), "contradicts gains"),
    "shorter than a sample": (
        SIMULATE.replace("= 1\n", "= 1e-4\n") + REFERENCE + CONTROLLER,
        "at least one sample_time",
    ),
    "events": (SIMULATE + "events = 1\n" + REFERENCE + CONTROLLER, "simulate.events = 1: must be an array of tables"),
    "idle event": (
        SIMULATE + REFERENCE + CONTROLLER + "[[simulate.events]]\ntime = 1",
        "simulate.events[0] changes nothing",
    ),
    "syntax": ("[model]\ninertia = = 1", "line 2, column 11: not valid TOML: Invalid value"),
    "cut off": ('[signals]\nu = "', "not valid TOML"),
    "key twice": ("[model]\ndelay = 1\ndelay = 2\n", "line 3, column 10: not valid TOML: Cannot overwrite a value"),
}


@pytest.mark.parametrize(("text", "line"), MISTAKES.values(), ids=MISTAKES)
def test_a_mistake_is_one_line_that_names_file_and_key(text: str, line: str) -> None:
    with pytest.raises(UsageError) as failure:
        parse_config(text, "rig.toml")
    said = str(failure.value)
    assert said.startswith("rig.toml: ")
    assert line in said
    assert "\n" not in said


def test_require_says_what_is_missing() -> None:
    config = parse_config("", "rig.toml")
    with pytest.raises(UsageError, match=re.escape("rig.toml: [states] is missing: the grid of candidate states; it")):
        config.require(States)
    with pytest.raises(UsageError, match=re.escape("rig.toml: [simulate] is missing")):
        config.require(Simulate)
    with pytest.raises(UsageError, match=re.escape("rig.toml: [model] inertia is missing")):
        config.require_inertia()


def test_an_effect_may_live_on_the_grid_alone() -> None:
    config = parse_config(STATES + "[states.effects.coulomb_friction]\nlevel = [0, 1]")
    assert config.require(States).effects == {"coulomb_friction": {"level": (0.0, 1.0)}}


class TestOverride:
    def test_values_effects_and_list_items(self) -> None:
        config = load_template("paper-delay-change").override(
            ["model.inertia=0.7", "detector.method=imm", "simulate.events.0.delay = 0.2", "states.delays=[0.2,0.4]"],
            ["coulomb_friction:level=0.5"],
        )
        assert config.model.inertia == 0.7
        assert config.detector.method == "imm"
        assert config.require(Simulate).events[0].delay == 0.2
        assert config.require(States).delays == (0.2, 0.4)
        assert config.model.effects == {"coulomb_friction": {"level": 0.5}}

    def test_nothing_is_no_column(self) -> None:
        assert parse_config(STATES).override(["signals.d_hat="]).signals.d_hat is None

    def test_the_original_stays(self) -> None:
        config = load_template("paper-step")
        before = config.to_toml()
        config.override(["model.inertia=0.7", "detector.initial.delay=0.2"])
        assert config == load_template("paper-step")
        assert config.to_toml() == before
        assert config.model.inertia == 1.0

    def test_the_name_of_a_column_needs_no_quotes(self) -> None:
        assert load_template("lab").override(["signals.u=Voltaje (V)"]).signals.u == "Voltaje (V)"

    @pytest.mark.parametrize(
        ("value", "line"),
        [
            ("model.inertia", "--set model.inertia: write KEY=VALUE"),
            ("=1", "--set =1: write KEY=VALUE"),
            ("model.inertia=", 'model.inertia = "": must be a number'),
            ("model.inertia=1 2", "'1 2' is not a TOML value"),
            ("model.inertia=1\nx=2", "is not a TOML value"),
            ("model.inertia=-1", "with --set: model.inertia = -1: must be a number above 0"),
            ("model.inertia.x=1", "model.inertia has no 'x'"),
            ("simulate.events.3.delay=1", "simulate.events has no '3'"),
        ],
    )
    def test_a_wrong_set_is_one_line(self, value: str, line: str) -> None:
        with pytest.raises(UsageError) as failure:
            load_template("paper-delay-change").override([value])
        assert line in str(failure.value)

    @pytest.mark.parametrize(
        ("effect", "line"),
        [
            ("coulomb_friction", "write ID:PARAMETER=VALUE"),
            ("coulomb_friction:level", "'level' is not PARAMETER=VALUE"),
            ("coulomb_friction:level=x y", "'x y' is not a TOML value"),
            ("coulomb_friction:levl=1", "did you mean level?"),
            ("friction:level=1", "unknown effect model.effects.friction"),
        ],
    )
    def test_a_wrong_effect_is_one_line(self, effect: str, line: str) -> None:
        with pytest.raises(UsageError) as failure:
            load_template("paper-step").override(effects=[effect])
        assert line in str(failure.value)


@pytest.mark.parametrize("name", template_names())
def test_written_out_and_read_again_is_the_same(name: str) -> None:
    config = load_template(name)
    assert parse_config(config.to_toml()) == config


def test_overrides_are_written_out() -> None:
    config = load_template("servo").override(["model.delay=0.003"], ["constant_load:force=0.2"])
    assert parse_config(config.to_toml()) == config
    assert "0.003" in config.to_toml()


class TestFile:
    def test_byte_order_mark_and_folder(self, tmp_path: Path) -> None:
        path = tmp_path / "rig.toml"
        path.write_bytes(b"\xef\xbb\xbf" + OBSERVER.encode())
        assert load_config(path, ["observer.sign=-1"]).require(Observer).sign == -1
        assert load_config(path).resolve("A.csv") == tmp_path / "A.csv"

    def test_no_file(self, tmp_path: Path) -> None:
        with pytest.raises(UsageError, match=r"gone.toml: no such config file: `dsd init` writes one"):
            load_config(tmp_path / "gone.toml")

    def test_a_folder(self, tmp_path: Path) -> None:
        with pytest.raises(UsageError, match="cannot be read"):
            load_config(tmp_path)

    def test_not_text(self, tmp_path: Path) -> None:
        (tmp_path / "rig.toml").write_bytes(b"[model]\n# \xff\n")
        with pytest.raises(UsageError, match="byte 10 is not UTF-8"):
            load_config(tmp_path / "rig.toml")


def test_the_paper_templates_have_the_papers_numbers() -> None:
    step, sine, change = map(load_template, ("paper-step", "paper-sine", "paper-delay-change"))
    for config in (step, sine, change):
        assert (config.require(Observer).nominal_inertia, config.require(Observer).time_constant) == (1.0, 0.01)
        assert config.require(States).delays == (0.2, 0.3, 0.4)
        assert config.require(States).inertias == (0.5, 1.0, 2.0)
        assert (config.detector.window, config.detector.rho, config.detector.hold) == (100, 0.3, 0.0)
        assert config.require(Simulate).controller.time_constant == 2.5
    assert (step.require(Simulate).reference.time, sine.require(Simulate).reference.frequency) == (0.3, 20.0)
    assert (change.require(Simulate).events[0].time, change.require(Simulate).events[0].delay) == (1.5, 0.4)
