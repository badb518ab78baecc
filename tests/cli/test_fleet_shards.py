"""`dsd fleet --shard` and `dsd fleet merge`: the parts make the table of one run, or nothing; recipes of the docs."""

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pyarrow.parquet as pq
import pytest
import yaml

from dsd_cli.cli.fleet_tasks import COMMON
from dsd_cli.files.fleet_parts import FleetShard, joined
from dsd_cli.files.fleet_table import Journal, columns_of, write_table
from tests.cli.rig import CONFIG, done, dsd, make_log, refused, write
from tests.docs.test_readme_commands import blocks

#: What a step of a pipeline needs, its command, and what it makes.
Stage = tuple[list[str], str, list[str]]
Stages = Callable[[str], Iterator[Stage]]
LOGS, SHARDS = 9, 4
RUN = ("fleet", "detect", "runs/*.csv", "--workers", "1")


def shard(folder: Path, number: int, *more: str, to: str = "", of: int = SHARDS) -> str:
    """Make that part."""
    output = to or f"parts/part_{number}.parquet"
    done(*RUN, "--shard", f"{number}/{of}", "-o", output, *more, cwd=folder)
    return output


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Logs, those of shard 2 no good; the table of one run, and that of parts made by xargs as in the docs."""
    folder = tmp_path_factory.mktemp("shards")
    (folder / "runs").mkdir()
    for k in range(LOGS):
        write(folder / "runs", f"{k}.csv", make_log(250, k, delay=0.005 if k % 3 else 0.01))
    for k in range(1, LOGS, SHARDS):  # all logs of shard 2
        (folder / f"runs/{k}.csv").write_text("")
    (folder / "dsd.toml").write_text(CONFIG)
    (folder / "bin").mkdir()
    (folder / "bin/dsd").write_text(f'#!/bin/sh\nexec {shlex.quote(sys.executable)} -m dsd_cli "$@"\n')
    (folder / "bin/dsd").chmod(0o755)
    done(*RUN, "-o", "one.parquet", cwd=folder)
    path = os.pathsep.join([str(folder / "bin"), os.environ["PATH"]])
    subprocess.run(["bash", "-ec", recipe("xargs")], cwd=folder, env={**os.environ, "PATH": path}, check=True)
    return folder


def recipe(word: str) -> str:
    """The block of docs/fleet.md that has this word."""
    kinds = ("bash", "snakemake", "yaml")
    (found,) = (text for kind in kinds for text in blocks(kind, "docs/fleet.md") if word in text)
    return found


def test_the_recipe_makes_the_table_of_one_run(fleet: Path) -> None:
    assert (fleet / "results.parquet").read_bytes() == (fleet / "one.parquet").read_bytes()
    parts = [pq.read_table(fleet / f"parts/part_{i}.parquet").to_pylist() for i in range(1, SHARDS + 1)]
    assert [[row["log"] for row in part] for part in parts] == [
        [f"runs/{k}.csv" for k in range(i, LOGS, SHARDS)] for i in range(SHARDS)
    ]
    assert {row["status"] for row in parts[1]} == {"failed"}  # which is no failure of the run
    parts_given = [f"parts/part_{i}.parquet" for i in (3, 1, 4, 2)]
    done("fleet", "merge", *parts_given, "-o", "all.csv", cwd=fleet)
    done(*RUN, "-o", "one.csv", cwd=fleet)
    assert (fleet / "all.csv").read_bytes() == (fleet / "one.csv").read_bytes()


def test_a_part_goes_on_from_its_rows(fleet: Path) -> None:
    again = done(*RUN, "--shard", "1/4", "-o", "parts/part_1.parquet", cwd=fleet)
    assert "3 of 3 logs are done already" in again.stderr
    done("fleet", "merge", *(f"parts/part_{i}.parquet" for i in range(1, 5)), "-o", "again.parquet", cwd=fleet)
    assert (fleet / "again.parquet").read_bytes() == (fleet / "one.parquet").read_bytes()


def expanded(text: str, **values: object) -> list[str]:
    """The words of a command with its placeholders filled; `{wildcards.i}`, `${item}`, `$i` and the like."""
    for name, value in values.items():
        text = re.sub(rf"\$?\{{(wildcards\.)?{name}\}}|\${name}\b", str(value), text)
    return shlex.split(text)


def line_with(word: str, text: str) -> str:
    (found,) = (line for line in text.splitlines() if word in line)
    return found


def test_all_recipes_run_the_commands_of_the_one_that_is_run() -> None:
    """SLURM and GNU parallel need not be there: what they would start is what xargs starts."""
    run = line_with("--shard", recipe("xargs")).partition("-I{} ")[2]
    for i in range(1, SHARDS + 1):
        wanted = shlex.split(run.replace("{}", str(i)))
        slurm = line_with("--shard", recipe("#SBATCH"))
        assert sorted(expanded(slurm, i=i, SLURM_CPUS_PER_TASK=1)) == sorted(wanted)
        parallel = line_with("--shard", recipe("parallel")).partition("parallel ")[2]
        words = " ".join(shlex.split(parallel))  # parallel hands its words to a shell
        assert sorted(shlex.split(words.replace("{}", str(i)))) == sorted(wanted)


def _stages_of_dvc(text: str) -> Iterator[Stage]:
    """What DVC would run: a stage for each item of its matrix, then the one that needs them."""
    stages = yaml.safe_load(text)["stages"]
    for i in stages["shard"]["matrix"]["i"]:
        made = yaml.safe_load(yaml.safe_dump(stages["shard"]).replace("${item.i}", str(i)))
        yield made["deps"], made["cmd"], [*made["outs"][0]]
    yield stages["merge"]["deps"], stages["merge"]["cmd"], stages["merge"]["outs"]


def _stages_of_snakemake(text: str) -> Iterator[Stage]:
    """What Snakemake would run: the rule whose output matches what the first one asks for, once for each, then that."""
    names = {"Path": Path, "expand": lambda pattern, i: [pattern.format(i=each) for each in i]}
    rules = dict(re.findall(r"^rule (\w+):\n((?: {4}.*\n)+)", text, flags=re.MULTILINE))
    merge, shard = (dict(re.findall(r"^ {4}(\w+): (.*)$", rules[one], re.MULTILINE)) for one in ("merge", "shard"))
    parts, pattern = eval(merge["input"], names), json.loads(shard["output"])
    for part in parts:
        (i,) = re.fullmatch(pattern.replace("{i}", "(.+)"), part).groups()
        needs, one = eval(f"[{shard['input']}]", names), SimpleNamespace(i=i)
        yield needs, json.loads(shard["shell"]).format(wildcards=one, output=part), [part]
    to = json.loads(merge["output"])
    yield parts, json.loads(merge["shell"]).format(input=" ".join(parts), output=to), [to]


@pytest.mark.parametrize(
    ("file", "word", "stages", "engine"),
    [
        ("dvc.yaml", "matrix", _stages_of_dvc, "dvc init -q --no-scm; dvc repro"),
        ("Snakefile", "rule merge", _stages_of_snakemake, "snakemake --cores 2"),
    ],
)
def test_pipelines_make_the_table_of_one_run(
    fleet: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, file: str, word: str, stages: Stages, engine: str
) -> None:
    """By the engine where it is installed; else each of its lines by a shell, with what it says it needs and makes."""
    shutil.copytree(fleet / "runs", tmp_path / "runs")
    shutil.copy2(fleet / "dsd.toml", tmp_path)
    (tmp_path / "parts").mkdir()
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PATH", os.pathsep.join([str(fleet / "bin"), os.environ["PATH"]]))
    text = recipe(word)
    assert len(text.splitlines()) <= 10
    if shutil.which(engine.split()[0]):
        Path(file).write_text(text, encoding="utf-8")
        subprocess.run(["sh", "-ec", engine], check=True)
    else:
        for needs, command, makes in stages(text):
            assert all(Path(one).exists() for one in needs)
            assert not any(Path(one).exists() for one in makes)
            subprocess.run(["/bin/sh", "-ec", command], check=True)
            assert all(Path(one).exists() for one in makes)
    made, one = (pq.read_table(path).drop(["key"]) for path in ("results.parquet", fleet / "one.parquet"))
    assert made.equals(one)  # but for the keys, which know the folder


@pytest.mark.parametrize("text", ["0/4", "5/4", "1", "1/0", "-1/4", "1/4/2", "a/b", "1.0/4", "1/4 "])
def test_a_shard_that_there_is_not(fleet: Path, text: str) -> None:
    refused(dsd(*RUN, f"--shard={text}", "-o", "x.parquet", cwd=fleet), 2, f"--shard {text}".strip(), "1/8 to 8/8")


def test_parts_that_do_not_belong_together_are_refused(fleet: Path, tmp_path: Path) -> None:
    to = ("-o", "x.parquet")
    one, two, three, four = (f"parts/part_{i}.parquet" for i in range(1, 5))

    def merge(*parts: str, to: tuple[str, str] = to, code: int = 2) -> None:
        *given, text = parts
        refused(dsd("fleet", "merge", *given, *to, cwd=fleet), code, text)
        assert not (fleet / "x.parquet").exists()

    merge(one, three, "shard 2, 4 of 4 is missing: give the parts of all shards")
    merge(one, two, three, four, "./" + two, f"{two}: is shard 2/4, as")
    merge(one, "none.parquet", "none.parquet: no such file", code=1)
    merge(one, "one.parquet", "one.parquet: is no part of a fleet", code=1)
    merge(one, "runs/0.csv", "runs/0.csv: is no part of a fleet", code=1)
    merge(one, two, three, four, "end the name in .parquet or .csv", to=("-o", "x.json"))
    merge(one, two, three, four, "runs/0.csv: is no table of results", to=("-o", "runs/0.csv"))
    merge(one, two, three, four, f"{one}: is the input: write to another file", to=("-o", one))
    made = {
        "has another number of shards than parts/part_1.parquet (3, not 4)": {"of": 3},
        "has another config or options than": {"more": ("--set", "detector.window=30")},
        "has another list of logs than": {"more": ("runs/0.csv.gone",)},
    }
    for k, (text, how) in enumerate(made.items()):
        other = shard(fleet, 2, *how.get("more", ()), of=how.get("of", SHARDS), to=f"other_{k}.parquet")
        merge(one, other, three, four, f"{other}: {text}")
    done("fleet", "compare", "runs/*.csv", "--shard", "2/4", "-o", "c.parquet", "--workers", "1", cwd=fleet)
    merge(one, "c.parquet", three, four, f"c.parquet: has another command than {one} (compare, not detect)")
    refused(dsd(*RUN, "--shard", "1/10", *to, cwd=fleet), 2, "--shard 1/10: there are 9 logs: at most 9 shards")
    refused(dsd(*RUN, "--shard", "1/4", "-o", "x.csv", cwd=fleet), 2, "x.csv: a part is a Parquet file")


def test_a_fleet_without_any_result_is_an_error_of_merge(tmp_path: Path) -> None:
    (tmp_path / "runs").mkdir()
    for name in "ab":
        (tmp_path / f"runs/{name}.csv").write_text("")
    (tmp_path / "dsd.toml").write_text(CONFIG)
    for i in (1, 2):
        shard(tmp_path, i, of=2, to=f"{i}.parquet")
    merged = dsd("fleet", "merge", "1.parquet", "2.parquet", "-o", "r.parquet", cwd=tmp_path)
    alone = dsd(*RUN, "-o", "one.parquet", cwd=tmp_path)
    assert (merged.returncode, alone.returncode) == (1, 1)
    assert merged.stderr == alone.stderr.replace("one.parquet", "r.parquet")
    assert (tmp_path / "r.parquet").read_bytes() == (tmp_path / "one.parquet").read_bytes()


@pytest.mark.parametrize("seed", range(6))
def test_tables_of_rows_with_columns_of_their_own_are_equal(tmp_path: Path, seed: int) -> None:
    """As diagnose makes them: each log has its own fitted values, some without an error, and some logs have nothing."""
    rng = np.random.default_rng(seed)
    rows, of = [], int(rng.integers(2, 6))
    for k in range(int(rng.integers(of, 30))):
        row = dict.fromkeys(COMMON, "x") | {"log": f"{k:02d}", "command": "diagnose", "status": "failed"}
        if rng.random() < 0.8:
            row |= {"status": "done", "samples": k, "floor": None if rng.random() < 0.7 else 0.5}
            for name in rng.permutation(list("abcde"))[: rng.integers(0, 4)]:
                row |= {f"value.{name}": 1.0 + k, f"error.{name}": None if rng.random() < 0.7 else 0.1}
        rows.append(row | {"warnings": "", "key": str(k)} if row["status"] == "done" else row | {"key": str(k)})

    def table(name: str, rows: list[dict], part: FleetShard | None = None) -> Path:
        journal = Journal(tmp_path / name)
        for row in reversed(rows):  # as they come
            journal.add(row)
        journal.finish([row["key"] for row in rows], COMMON, None if part is None else part.metadata())
        return tmp_path / name

    whole = table("one.parquet", rows)
    parts = [
        table(f"{i}.parquet", rows[i - 1 :: of], FleetShard(i, of, len(rows), "diagnose", "1", "l", "c"))
        for i in range(1, of + 1)
    ]
    found = joined(parts)
    write_table(tmp_path / "all.parquet", iter(found), columns_of(found, COMMON))
    assert (tmp_path / "all.parquet").read_bytes() == whole.read_bytes()
