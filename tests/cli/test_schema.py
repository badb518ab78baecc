"""`dsd schema COMMAND`: the published schemas hold for what the commands write, key by key."""

import copy
import json
from pathlib import Path

import pytest
from jsonschema import Draft202012Validator

from dsd_cli.cli.lazy import COMMANDS, load_command
from tests.cli.rig import FEW, done, dsd

SAMPLES = Path(__file__).parents[2] / "sample_logs"
NAMES = [
    "add",
    "check",
    "columns",
    "compare",
    "detect",
    "diagnose",
    "effects",
    "export",
    "fleet",
    "import",
    "improve",
    "learn",
    "passport",
    "plan",
    "tune",
]
FRICTION, BARE, SINE = (f"{SAMPLES}/{name}" for name in ("servo-friction.csv", "servo-bare.toml", "paper-sine"))


def published(name: str) -> dict:
    return json.loads(done("schema", name, cwd=SAMPLES).stdout)


def strict(schema: object) -> object:
    """The schema that allows no key that it does not name: what our own output must hold."""
    if isinstance(schema, list):
        return [strict(one) for one in schema]
    if not isinstance(schema, dict):
        return schema
    out = {key: strict(value) for key, value in schema.items()}
    if isinstance(out.get("properties"), dict) and "additionalProperties" not in out:
        out["additionalProperties"] = False
    return out


def holds(name: str, text: str) -> None:
    schema, result = strict(copy.deepcopy(published(name))), json.loads(text)
    parts = schema.get("oneOf", [schema])
    errors = [list(Draft202012Validator(part).iter_errors(result)) for part in parts]
    fitting = [one for one in errors if not one]
    best = min(errors, key=len)
    assert len(fitting) == 1, "\n".join(f"{one.json_path}: {one.message[:300]}" for one in best[:5])


def test_every_command_that_writes_json_has_one():
    with_format = {
        name
        for name in COMMANDS
        for command in [load_command(name)]
        for one in (command, *getattr(command, "commands", {}).values())
        if any(param.name == "form" for param in one.params)
    }
    assert with_format == set(NAMES)
    assert done("schema", cwd=SAMPLES).stdout.split() == NAMES


@pytest.mark.parametrize("name", NAMES)
def test_it_is_a_schema_whose_keys_say_what_they_are(name):
    schema = published(name)
    assert schema["$schema"] == "https://json-schema.org/draft/2020-12/schema"
    Draft202012Validator.check_schema(schema)
    bare = []

    def walk(one: object, at: str) -> None:
        if isinstance(one, dict):
            for key, value in one.get("properties", {}).items():
                if not value.get("description"):
                    bare.append(f"{at}.{key}")
            for key, value in one.items():
                walk(value, f"{at}.{key}")
        elif isinstance(one, list):
            for value in one:
                walk(value, at)

    walk(schema, name)
    assert bare == []


@pytest.mark.parametrize(
    ("name", "command"),
    [
        ("detect", f"detect {FRICTION} -c {BARE} --expect inertia=0.01 --min-share 0"),
        ("detect", f"detect {FRICTION} -c {BARE} --set detector.method=profile"),
        ("detect", f"detect {SINE}.csv -c {SINE}.toml --method dsd,viterbi"),
        ("tune", f"tune {SINE}.csv -c {SINE}.toml"),
        ("check", f"check {FRICTION} {SINE}.csv -c {BARE}"),
        ("columns", f"columns {FRICTION}"),
        ("compare", f"compare {FRICTION} -c {BARE} --max-rmse 10"),
        ("compare", f"compare {FRICTION} -c {BARE} --to 2 --holdout {FRICTION}"),
        ("compare", f"compare {SINE}.csv -c {SINE}.toml"),
        ("compare", f"compare {FRICTION} -c {BARE} --horizon simulation"),
        ("compare", f"compare -c {BARE} -c {SAMPLES}/servo-friction.toml"),
        ("diagnose", f"diagnose {FRICTION} -c {BARE} --fix inertia --to 1"),
        ("plan", f"plan {FRICTION} -c {BARE} --to 1 --seconds 4 -o next.csv"),
        ("add", f"add {FRICTION} coulomb_friction -c {BARE} -o better.toml"),
        ("learn", f"learn {FRICTION} -c {BARE} --to 1 -o learnt.toml --curve law.csv"),
        ("learn", f"learn {FRICTION} -c {SAMPLES}/servo-friction.toml --law-file law.py"),
        ("improve", f"improve {FRICTION} -c {BARE} --to 1 --auto -o best.toml"),
        ("improve", "improve -c best.toml --history"),
        ("improve", "improve -c best.toml --undo -o undone.toml"),
        ("effects", "effects"),
        ("export", f"export {SAMPLES}/servo-friction.toml --to parameters -o values.csv"),
        ("export", f"export {SAMPLES}/servo-friction.toml --to parameters -o values.csv --verify {FRICTION}"),
        ("import", "import joint.csv -o imported.toml"),
        ("passport", f"passport {SAMPLES}/servo-friction.toml {FRICTION} --to 2 --limits limits.toml"),
    ],
)
def test_what_a_command_writes_holds(tmp_path_factory, name, command):
    folder = tmp_path_factory.getbasetemp() / "schemas"
    folder.mkdir(exist_ok=True)
    (folder / "joint.csv").write_text("inertia = 0.01\ncoulomb_friction.level = 0.2\n")
    (folder / "limits.toml").write_text('[limits]\ninertia = "within 20 %"\nrmse = "max 1"\n')
    effects = FEW if name in ("diagnose", "improve") else ()  # `plan` has the whole catalogue
    ran = done(*command.split(), "--format", "json", cwd=folder, timeout=900, effects=effects)
    holds(name, ran.stdout)
    result = json.loads(ran.stdout)
    assert isinstance(result["logs"], list)  # in every command; `log` of detect is the name alone


def test_a_line_of_labels_holds(tmp_path):
    lines = done("detect", FRICTION, "-c", BARE, "--format", "jsonl", cwd=tmp_path).stdout.splitlines()
    for line in (lines[0], lines[-1]):
        holds("detect", line)


def test_a_fleet_holds(tmp_path):
    done("fleet", "detect", FRICTION, f"{SINE}.csv", "-c", BARE, "-o", "fleet.parquet", cwd=tmp_path)
    holds("fleet", done("fleet", "summary", "fleet.parquet", "--format", "json", cwd=tmp_path).stdout)


def test_a_wrong_name_is_one_line():
    ran = dsd("schema", "compere", cwd=SAMPLES)
    assert (ran.returncode, ran.stdout) == (2, "")
    assert "no schema 'compere'" in ran.stderr
