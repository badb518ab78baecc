"""Changes of `dsd.toml` in place: what a fit found goes in, the rest stays, and the last step can be undone."""

import math
import stat
import tomllib
from collections import Counter
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dsd_cli.errors import DataError, UsageError
from dsd_cli.files.config import History, parse_config
from dsd_cli.files.config.edit import (
    check_config_output,
    now,
    read_origin,
    rounded,
    undone,
    with_model,
    with_step,
    write_text,
)
from dsd_cli.files.config.toml_text import statements
from dsd_cli.files.template import template_names, template_text
from dsd_cli.identify.results import Estimate
from dsd_cli.plant.model import PlantModel

MODEL = PlantModel(
    1.0234567890123, 0.02, {"viscous_friction": {"coefficient": 0.3}, "coulomb_friction": {"level": 0.5}}
)
ESTIMATES = {
    "inertia": Estimate(1.0234567890123, 2e-4, "kg m2"),
    "coulomb_friction.level": Estimate(0.5, 0.01, "{u}"),
}
STEP = History(
    effect="coulomb_friction",
    date="2026-01-31T12:00:00Z",
    logs=('a "b".csv',),
    rmse_before=0.4,
    rmse_after=0.1,
    heldout_rmse_before=0.41234567,
    heldout_rmse_after=None,
    values={"level": 0.5},
    std_errors={"level": 0.01},
)
CONFIG = """\
# my rig
[observer]
nominal_inertia = 1.0   # Jn
time_constant = 0.01

[model]         # what I believe
inertia = 1     # kg m2
  delay = 2e-2  # measured
# no gravity

[model.effects.viscous_friction]
coefficient = 3e-1   # grease
# end of model

# the grid
[states]
delays = [0.0, 0.02]
inertias = [0.5, 1.0]
"""


def comments(text: str) -> list[str]:
    return [text[s.start : s.end].strip() for s in statements(text) if s.kind == "#"]


def test_values_change_in_place_and_the_new_effect_stands_behind_the_model() -> None:
    assert with_model(CONFIG, MODEL, ESTIMATES) == CONFIG.replace(
        "inertia = 1     #", "inertia = 1.023457     #"
    ).replace(
        "# end of model\n",
        "# end of model\n\n[model.effects.coulomb_friction]\n# Fc, the friction force while moving [u]\nlevel = 0.5\n",
    )


def test_a_comment_directly_above_a_header_stays_above_it() -> None:
    text = "[model]\ninertia = 1.0\n# the grid\n[states]\n"
    changed = with_model(text, MODEL, ESTIMATES)
    assert changed.endswith("level = 0.5\n# the grid\n[states]\n")
    assert undone(with_step(changed, STEP, text)) == text


def test_a_step_is_valid_config_and_undone_to_the_byte() -> None:
    changed = with_step(with_model(CONFIG, MODEL, ESTIMATES), STEP, CONFIG)
    config = parse_config(changed)
    (step,) = config.history
    assert step.logs == ('a "b".csv',)
    assert (step.heldout_rmse_before, step.heldout_rmse_after) == (0.412346, None)
    assert dict(step.before) == {"inertia": 1, "delay": 0.02, "effects": {"viscous_friction": {"coefficient": 0.3}}}
    assert config.model.effects["coulomb_friction"]["level"] == 0.5
    assert undone(changed) == CONFIG


def test_steps_are_undone_one_by_one() -> None:
    first = with_step(with_model(CONFIG, MODEL, ESTIMATES), STEP, CONFIG)
    model = MODEL.changed(delay=0.03, effects={"constant_load": {"force": -0.25}})
    second = with_step(with_model(first, model, {}), STEP, first)
    assert len(parse_config(second).history) == 2
    assert undone(second) == first
    assert undone(undone(second)) == CONFIG
    with pytest.raises(UsageError, match="no step to take back"):
        undone(CONFIG)


def test_what_the_user_wrote_after_the_step_stays() -> None:
    changed = with_step(with_model(CONFIG, MODEL, ESTIMATES), STEP, CONFIG)
    changed = (
        changed.replace("inertia = 1.023457", "rest_speed = 0.1\ninertia = 1.023457") + "# mine\n[detector]\nrho = 1\n"
    )
    back = undone(changed)
    assert tomllib.loads(back)["model"] == {**tomllib.loads(CONFIG)["model"], "rest_speed": 0.1}
    assert tomllib.loads(back)["detector"] == {"rho": 1}
    assert "# mine" in comments(back)


def test_nothing_changes_where_nothing_changed() -> None:
    model = PlantModel(1.0, 0.02, {"viscous_friction": {"coefficient": 0.1 + 0.2}})
    assert with_model(CONFIG, model, {}) == CONFIG


def test_pulses_of_an_external_force_are_a_list_of_tables() -> None:
    events = [{"start": 1.0, "end": 1_700_000_000.123, "force": 0.1 + 0.2}]
    text = with_model(CONFIG, MODEL.changed(effects={"external_force": {"events": events}}), ESTIMATES)
    assert "events = [{ start = 1.0, end = 1700000000.123, force = 0.3 }]\n" in text
    again = text.replace("events = [{", "events = [ # pushed\n {")
    assert undone(with_step(with_model(again, MODEL, {}), STEP, again)).count("start = 1.0") == 1
    tables = CONFIG + "[[model.effects.external_force.events]]\nstart = 1\nend = 2\nforce = 3\n# hand\n"
    more = MODEL.changed(effects={"external_force": {"events": [{"start": 1, "end": 2, "force": 3}]}})
    assert "start = 1\nend = 2\nforce = 3\n# hand\n" in with_model(tables, more, ESTIMATES)


WAYS = {
    "no model": "[observer]\nnominal_inertia = 1\ntime_constant = 0\n",
    "empty": "",
    "no line end": "[model]\ninertia = 2",
    "inline": "model = { inertia = 2, delay = 0.02 } # all\n[states]\ndelays = [1]\ninertias = [1]\n",
    "inline effects": "[model]\neffects = { viscous_friction = { coefficient = 3e-1 } } # e\ninertia = 2\n",
    "no inline effects": "[model]\neffects = {}\ninertia = 2\n",
    "inline effect": "[model.effects]\nviscous_friction = { coefficient = 1 }\n[observer]\n",
    "dotted": "model.inertia = 2\nmodel.effects.viscous_friction.coefficient = 1 # B\n[states]\n",
    "dotted without inertia": "model.effects.viscous_friction.coefficient = 1 # B\n[states]\n",
    "dotted in the table": "[model]\neffects.viscous_friction.coefficient = 1 # B\n\n# grid\n[states]\n",
    "out of order": "[model.effects.viscous_friction]\ncoefficient = 1\n[states]\n# s\n\n[model]\ninertia = 2\n",
    "only effects": "# a\n[model.effects.viscous_friction]\n# b\ncoefficient = 1\n# states\n[states]\n",
    "quoted": '["model".effects."viscous_friction"]\n"coefficient" = 1 # B\n',
    "crlf": "[model]\r\ninertia = 2 # J\r\n\r\n# grid\r\n[states]\r\n",
    "traps": '[signals]\nu = """\n[model]\ninertia = 3 # no\n"""\nd_hat = \'[x] # "\' # c\n[model]\ninertia = 2\n',
    "literal traps": "[signals]\nu = '''\n[model]\ninertia = 3 # 'no'\n''''\n[model]\ninertia = 2\n",
    "rest speed": "[model]\nrest_speed = 0.10\n\n",
}


@pytest.mark.parametrize("way", WAYS)
def test_any_way_of_writing_it(way: str) -> None:
    text = WAYS[way]
    changed = with_model(text, MODEL, ESTIMATES)
    now_ = tomllib.loads(changed)["model"]
    rest = now_.pop("rest_speed", None)
    assert now_ == {
        "inertia": 1.023457,
        "delay": 0.02,
        "effects": {"viscous_friction": {"coefficient": 0.3}, "coulomb_friction": {"level": 0.5}},
    }
    assert rest == tomllib.loads(text).get("model", {}).get("rest_speed")
    assert set(comments(text)) <= set(comments(changed))
    back = undone(with_step(changed, STEP, text))
    assert tomllib.loads(back) == tomllib.loads(text)
    assert comments(back) == comments(text)
    if "line end" not in way:
        assert back == text
    assert way != "crlf" or "\n" not in changed.replace("\r\n", "")


@pytest.mark.parametrize("name", template_names())
def test_the_templates_survive(name: str) -> None:
    text = template_text(name)
    changed = with_step(with_model(text, MODEL, ESTIMATES), STEP, text)
    assert parse_config(changed).model.inertia == 1.023457
    assert undone(changed) == text


COMMENTS = st.lists(st.sampled_from(["# a", "  # [model]", "# inertia = 3", "#", "# \u00fc", ""]), max_size=3)
NUMBERS = st.floats(1e-6, 1e4) | st.sampled_from(["1e-3", "2", "0.50", "+3.0", "1_000.5"])
EFFECTS = {
    "viscous_friction": ["coefficient"],
    "coulomb_friction": ["level"],
    "gravity": ["amplitude", "phase"],
    "stribeck_friction": ["excess", "velocity"],
}


@st.composite
def configs(draw: st.DrawFn) -> str:
    """Configs with [model] and its effects among other sections, in any order, with comments anywhere."""
    sections = [["[observer]", "nominal_inertia = 1", "time_constant = 0.01"], ["[detector]", 'method = "dsd" # m']]
    keys = [f"{k} = {draw(NUMBERS)} # {k}" for k in ("inertia", "delay", "rest_speed") if draw(st.booleans())]
    sections += [["[model] # m", *draw(st.permutations(keys))]] if draw(st.booleans()) else []
    for effect in draw(st.lists(st.sampled_from(sorted(EFFECTS)), unique=True)):
        values = [f"{p} = {'0.25' if p == 'phase' else draw(NUMBERS)}" for p in EFFECTS[effect]]
        if draw(st.booleans()):
            sections.append([f"[model.effects.{effect}]", *values])
        else:
            sections.append([f"[model.effects.{effect}]", *(v + " # its value" for v in values)])
    lines = draw(COMMENTS)
    for section in draw(st.permutations(sections)):
        for line in section:
            lines = [*lines, line, *draw(COMMENTS)]
    return "\n".join(lines) + "\n"


@st.composite
def models(draw: st.DrawFn, text: str) -> tuple[PlantModel, dict[str, Estimate]]:
    """A model with all effects of the config, with other values, and some more."""
    old = parse_config(text).model
    names = [*old.effects, *draw(st.lists(st.sampled_from(sorted(EFFECTS))))]
    values = st.floats(1e-5, 1e5)
    effects = {e: {p: draw(st.floats(-3, 3) if p == "phase" else values) for p in EFFECTS[e]} for e in names}
    model = PlantModel(draw(values), draw(st.sampled_from([0.0, 0.01, old.delay])), effects)
    return model, {"inertia": Estimate(model.inertia, draw(st.floats(1e-9, 1e3)), "kg m2")}


@settings(max_examples=150, deadline=None)
@given(st.data())
def test_with_model_and_undone_are_inverse_and_keep_every_comment(data: st.DataObject) -> None:
    text = data.draw(configs())
    steps = [text]
    for _ in range(data.draw(st.integers(1, 2))):
        model, estimates = data.draw(models(steps[-1]))
        changed = with_model(steps[-1], model, estimates)
        got = parse_config(changed).model
        assert math.isclose(got.inertia, model.inertia, rel_tol=1e-5)
        assert (got.delay, set(got.effects)) == (model.delay, set(model.effects))
        assert not Counter(comments(text)) - Counter(comments(changed))
        steps.append(with_step(changed, STEP, steps[-1]))
    for before, after in zip(steps[-2::-1], steps[:0:-1], strict=True):
        assert undone(after) == before


@pytest.mark.parametrize(
    ("value", "std_error", "expected"),
    [
        (0.123456789, 0.01, 0.123457),
        (0.123456789, 1e-7, 0.123456789),
        (123456.789, 10.0, 123456.8),
        (0.1 + 0.2, math.nan, 0.3),
        (0.1 + 0.2, math.inf, 0.3),
        (0.1 + 0.2, 0.0, 0.3),
        (0.0, 0.1, 0.0),
        (-1.0 / 3.0, 1e-30, -0.333333333333333),
    ],
)
def test_digits_follow_the_standard_error(value: float, std_error: float, expected: float) -> None:
    assert rounded(value, std_error) == expected


def test_rounding_stays_within_the_bounds() -> None:
    model = PlantModel(1.0, 0.0, {"gravity": {"amplitude": 1.0, "phase": math.pi}})
    text = with_model("", model, {"gravity.phase": Estimate(math.pi, 1e-5, "rad")})
    assert parse_config(text).model.effects["gravity"]["phase"] <= math.pi


MISTAKES = {
    "no effect": ('date = "2026-01-01"', "[history[0]] effect is missing"),
    "date": ('effect = "x"\ndate = "soon"', 'history[0].date = "soon": must be a date and time'),
    "native date": ('effect = "x"\ndate = 2026-01-01', "history[0].date = 2026-01-01: must be a date"),
    "logs": ('effect = "x"\ndate = "2026-01-01"\nlogs = "a"', "must be a list of texts"),
    "error": ('effect = "x"\ndate = "2026-01-01"\nrmse_after = -1', "history[0].rmse_after = -1: must be a number"),
    "values": (
        'effect = "x"\ndate = "2026-01-01"\nvalues = { a = "b" }',
        'history[0].values.a = "b": must be a number',
    ),
    "before": ('effect = "x"\ndate = "2026-01-01"\nbefore = { inertia = 0 }', "history[0].before.inertia = 0: must be"),
    "key": ('effect = "x"\ndat = "2026-01-01"', "unknown key history[0].dat: did you mean date?"),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_history_is_validated(mistake: str) -> None:
    text, said = MISTAKES[mistake]
    with pytest.raises(UsageError) as error:
        parse_config("[[history]]\n" + text)
    assert said in str(error.value)
    assert "\n" not in str(error.value)


def test_what_cannot_be_changed_in_place_is_said() -> None:
    with pytest.raises(UsageError, match=r"write it as \[\[history\]\] tables"):
        with_step("history = []\n", STEP, "")
    with pytest.raises(UsageError, match=r"\[\[history\]\] tables"):
        undone('history = [{ effect = "x", date = "2026-01-01" }]\n')


def test_date_of_now_is_valid() -> None:
    parse_config(f'[[history]]\neffect = "x"\ndate = "{now()}"\n')


def test_files_are_written_whole_with_their_permissions_and_line_ends(tmp_path: Path) -> None:
    path = tmp_path / "dsd.toml"
    path.write_bytes(b"a = 1\r\n")
    path.chmod(0o640)
    link = tmp_path / "link.toml"
    link.symlink_to(path)
    write_text(str(link), read_origin(link).text + "b = 2\r\n")
    assert path.read_bytes() == b"a = 1\r\nb = 2\r\n"
    assert stat.S_IMODE(path.stat().st_mode) == 0o640
    assert link.is_symlink()
    with pytest.raises(DataError, match="cannot be written"):
        write_text(str(tmp_path / "none/x.toml"), "")
    with pytest.raises(UnicodeEncodeError):
        write_text(str(path), "\udc80")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["dsd.toml", "link.toml"]


def test_where_a_config_can_go(tmp_path: Path) -> None:
    log = tmp_path / "log.csv"
    log.write_text("t")
    check_config_output("-", [log])
    check_config_output(str(tmp_path / "new.toml"), [log])
    with pytest.raises(UsageError, match="is the input"):
        check_config_output(str(log), [log])
    for bad in (tmp_path, tmp_path / "none/x.toml"):
        with pytest.raises(DataError):
            check_config_output(str(bad))
