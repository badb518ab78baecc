"""`dsd learn` as a user runs it: a law that no effect has, from the log to a config whose error falls."""

import csv
import html
import json
from types import SimpleNamespace

import pytest

from dsd_cli.cli.learn import in_short
from tests.cli.rig import FEW, done, dsd
from tests.oracle.rig_strange import make

CONFIG = """
[signals]
time = "t"
u = "u"
position = "position"

[observer]
nominal_inertia = {inertia}
time_constant = 0.01

[model]
inertia = {inertia}
delay = {delay}

[model.effects.viscous_friction]
coefficient = {viscous}

[model.effects.coulomb_friction]
level = {dry}
"""


def write(folder, law, name="log", second=0, motion="moves"):
    log = make(law, 1, "enc40k", motion, duration=12.0, second=second)
    with (folder / f"{name}.csv").open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(log.channels)
        rows.writerows(zip(*(c.tolist() for c in log.channels.values()), strict=True))
    own = log.believed
    text = CONFIG.format(
        inertia=log.inertia,
        delay=log.delay,
        viscous=own["viscous_friction"]["coefficient"],
        dry=own["coulomb_friction"]["level"],
    )
    (folder / "model.toml").write_text(text)
    return log


@pytest.fixture(scope="module")
def spot(tmp_path_factory):
    """A place where friction is three times as high, and another motion of the same machine."""
    folder = tmp_path_factory.mktemp("spot")
    write(folder, "friction_spot", "other", second=1, motion="sines")
    return folder, write(folder, "friction_spot")


def rmse(folder, config, log="log.csv"):
    return json.loads(done("compare", log, "-c", config, "--format", "json", cwd=folder).stdout)["force"]["rmse"]


@pytest.fixture(scope="module")
def learnt(spot):
    """What `learn` says, and every file that it writes."""
    files = ("-o", "better.toml", "--curve", "law.csv", "--law-file", "law.py", "--plot", "law.png")
    command = ("learn", "log.csv", "-c", "model.toml", *files, "--holdout", "other.csv", "--format", "json")
    return json.loads(done(*command, cwd=spot[0]).stdout)


@pytest.fixture(scope="module")
def improved(spot):
    command = ("improve", "log.csv", "-c", "model.toml", "--auto", "--learn", "-o", "rung.toml", "--format", "json")
    return json.loads(done(*command, cwd=spot[0], effects=FEW).stdout)


def test_the_law_goes_into_a_config_that_works_by_itself(spot, learnt):
    folder, result = spot[0], learnt
    assert (result["verdict"], result["channels"]) == ("learnt", ["direction", "position"])
    assert result["heldout_rmse_after"] < 0.15 * result["heldout_rmse_before"]
    assert rmse(folder, "better.toml") < 0.1 * rmse(folder, "model.toml")
    assert rmse(folder, "better.toml", "other.csv") < 0.1 * rmse(folder, "model.toml", "other.csv")
    assert (folder / "law.png").read_bytes()[:4] == b"\x89PNG"
    far = (folder / "other.csv").read_text().splitlines()
    wide = [line.split(",") for line in far[1:]]
    at = far[0].split(",").index("position")
    rows = [",".join([*row[:at], str(3.0 * float(row[at])), *row[at + 1 :]]) for row in wide]
    (folder / "far.csv").write_text("\n".join([far[0], *rows]))
    both = done("compare", "far.csv", "-c", "model.toml", "-c", "better.toml", cwd=folder)
    assert "better.toml: far.csv: friction_curve is known for position from" in both.stderr
    undone = done("improve", "-c", "better.toml", "--undo", "-o", "undone.toml", cwd=folder)
    assert "wrote undone.toml" in undone.stderr
    assert "friction_curve" not in (folder / "undone.toml").read_text()


def test_the_curve_is_the_law_that_was_hidden(spot, learnt):
    folder, log = spot
    rows = list(csv.DictReader((folder / "law.csv").open()))
    size = log.values["size"]
    inside = []
    for row in rows:
        if row["low"]:
            q = float(row["knot_1"])
            true = 2.0 * size / (1.0 + ((q - log.values["q0"]) / log.values["w"]) ** 2)
            assert float(row["value"]) == pytest.approx(true, abs=0.08 * size)
            inside.append(float(row["low"]) - 0.02 * size <= true <= float(row["high"]) + 0.02 * size)
    assert len(inside) > 15
    assert sum(inside) >= 0.9 * len(inside)


def test_the_law_file_is_an_effect_that_the_other_commands_take(spot, learnt):
    (folder, log), formula = spot, learnt["formula"]
    assert (formula["effects"], formula["in_catalogue"]) == (["learnt_dry_lorentz_q"], False)
    assert formula["as_good_as_the_curve"]
    for name, true in (
        ("place", log.values["q0"]),
        ("width", log.values["w"]),
        ("coefficient", 2 * log.values["size"]),
    ):
        found = formula["parameters"][f"learnt_dry_lorentz_q.{name}"]
        assert found["value"] == pytest.approx(true, abs=max(5 * found["std_error"], 0.01 * abs(true)))
    with_it = ("-c", "model.toml", "--effects-from", "law.py", "-o", "formula.toml", "--quiet")
    done("add", "log.csv", "learnt_dry_lorentz_q", *with_it, cwd=folder)
    shown = done("compare", "log.csv", "-c", "formula.toml", "--effects-from", "law.py", "--format", "json", cwd=folder)
    assert json.loads(shown.stdout)["force"]["rmse"] < 0.1 * rmse(folder, "model.toml")


def test_improve_takes_it_as_the_last_rung(improved):
    result = improved
    last = result["ladder"][-1]
    assert (last["kind"], last["effect"]) == ("learnt", "friction_curve")
    # what is missing, and whether that is all, is asked of the model with the law
    assert (result["verdict"], result["missing"]) == ("none", [])
    assert result["unexplained"]["probability"] < 0.5
    assert "nothing" in result["verdict_text"]
    assert last["heldout_rmse"] < 0.3 * result["ladder"][-2]["heldout_rmse"]
    assert "learnt: friction over the position" in result["stopped"]


def test_a_law_of_the_catalogue_is_named_as_that(tmp_path):
    write(tmp_path, "nothing")
    bare = (tmp_path / "model.toml").read_text().partition("[model.effects")[0]
    (tmp_path / "bare.toml").write_text(bare)
    ran = done("learn", "log.csv", "-c", "bare.toml", "-o", "better.toml", "--law-file", "law.py", cwd=tmp_path)
    assert "dsd has the law: " in ran.stderr
    text = (tmp_path / "better.toml").read_text()
    assert "[model.effects.coulomb_friction]" in text
    assert "[model.effects.viscous_friction]" in text
    assert rmse(tmp_path, "better.toml") < 1.2 * rmse(tmp_path, "model.toml")


def test_nothing_is_learnt_where_nothing_is_missing(tmp_path):
    write(tmp_path, "nothing")
    ran = done("learn", "log.csv", "-c", "model.toml", "-o", "same.toml", "--curve", "law.csv", cwd=tmp_path)
    assert ran.stdout.startswith("none: what is left below ")
    assert (tmp_path / "same.toml").read_text() == (tmp_path / "model.toml").read_text()
    assert not (tmp_path / "law.csv").exists()
    assert "law.csv: not written, no law was learnt" in ran.stderr
    assert "[model]" not in ran.stdout
    right = (tmp_path / "model.toml").read_text()
    level = right.rpartition("level = ")[2]
    (tmp_path / "model.toml").write_text(right.replace(f"level = {level}", f"level = {0.2 * float(level)}"))
    off = done("learn", "log.csv", "-c", "model.toml", cwd=tmp_path).stdout
    assert off.startswith("none: ")
    assert "values of [model] are off: as given it leaves" in off


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (["--law-file", "law.txt"], "--law-file law.txt: end its name in .py"),
        (["--curve", "log.csv"], "log.csv"),
        (["-o", "better.toml", "--curve", "better.toml"], "better.toml"),
        (["-o", "-", "--format", "json"], "-o - and --format json"),
    ],
)
def test_what_cannot_be_written_is_said_before_anything_is_computed(spot, arguments, line):
    folder, _ = spot
    ran = dsd("learn", "log.csv", "-c", "model.toml", *arguments, cwd=folder)
    assert (ran.returncode, ran.stdout, len(ran.stderr.splitlines())) == (2, "", 1)
    assert line in ran.stderr


def test_the_report_shows_the_law_and_its_rung(spot, improved):
    """The page has the same law and rung as `improve --learn`, and the curve's picture."""
    folder, _ = spot
    done("report", "log.csv", "-c", "model.toml", "--learn", "-o", "page.html", cwd=folder, effects=FEW)
    page = (folder / "page.html").read_text("utf-8")
    results, drawn = (
        json.loads(page.split(f'type="application/json" id="{name}">')[1].split("</script>")[0])
        for name in ("results", "data")
    )
    assert results["improve"]["ladder"] == improved["ladder"]
    assert results["improve"]["ladder"][-1]["kind"] == "learnt"
    assert results["learn"]["verdict"] == "learnt"
    assert results["learn"]["formula"]["text"] in html.unescape(page)
    assert "[model.effects.friction_curve]" in drawn["copies"]["config"]
    law, left = drawn["charts"]["law-0"], drawn["charts"]["left-0"]
    knots, low, high = law["series"][2]["data"][0][0], *(law["series"][i]["data"][0][1] for i in (2, 3))
    curve = results["learn"]["curve"]
    assert knots == pytest.approx(
        [k for k, x in zip(curve["knots"][0], curve["low"], strict=True) if x is not None], rel=1e-4, abs=1e-4
    )
    assert all(a <= b for a, b in zip(low, high, strict=True))
    size = [sum(x * x for x in one["data"][0][1]) for one in left["series"]]
    assert size[1] < 0.1 * size[0]
    assert 'data-chart="law-0"' in page
    assert "<h3>What was learnt (dsd learn)</h3>" in page
    assert "a law was learnt" in page  # the card is of the model at the end
    assert "something unknown" not in page


def test_a_law_that_the_catalogue_has_is_said_to_be_that():
    learnt = SimpleNamespace(
        family="friction over the position",
        formula=SimpleNamespace(
            text="-2.088 sgn v", words="friction", known=True, replaces=True, effects=("coulomb_friction",)
        ),
    )
    assert in_short(learnt) == "learnt: friction, -2.088 sgn v, which is coulomb_friction"
    learnt.formula.replaces = False
    nearest = "nearest formula -2.088 sgn v, which explains less than the curve"
    assert in_short(learnt) == f"learnt: friction over the position, {nearest}"
    learnt.formula.known, learnt.formula.replaces = False, True
    strange = "-2.088 sgn v, which no effect of the catalogue is"
    assert in_short(learnt) == f"learnt: friction over the position, {strange}"
    learnt.formula = None
    assert in_short(learnt) == "learnt: friction over the position, which no effect of the catalogue is"
