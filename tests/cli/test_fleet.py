"""`dsd fleet`, the real command with real workers: rows, resuming, workers that die, a Dask cluster of processes."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from tests.cli.rig import CONFIG, DSD, done, dsd, interruptible, make_log, refused, summary, write

LOGS = 12
#: An effect that does nothing, but ends the process that computes it for a log of 77 rows.
KILLER = '''
"""killer.py"""
import os
import numpy as np
from dsd_cli.effects import Effect, Parameter, Role

def columns(channels, shape):
    if np.size(channels.u) == 77:
        os._exit(9)
    return (np.zeros(np.shape(channels.u)),)

EFFECT = Effect(id="killer", role=Role.APPLIED, law="0", summary="Nothing.", pattern="none",
    parameters=(Parameter("force", "{u}", "F"),), needs=(), columns=columns)
'''


def rows(path: Path) -> list[dict]:
    return pq.read_table(path).to_pylist()


def wait_for(what: Callable[[], bool], seconds: float = 300.0) -> None:
    end = time.monotonic() + seconds
    while not what():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.02)


def children(pid: int) -> list[int]:
    try:
        return [int(one) for one in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]
    except FileNotFoundError:
        return []


def workers_of(pid: int) -> list[int]:
    """Processes of the pool; another child keeps track of shared memory."""
    return [one for one in children(pid) if "spawn_main" in Path(f"/proc/{one}/cmdline").read_text()]


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Logs of three machines, two of them no good, and the table that one worker makes of them."""
    folder = tmp_path_factory.mktemp("fleet")
    for k in range(LOGS):
        machine = folder / "logs" / f"m{k % 3}"
        machine.mkdir(parents=True, exist_ok=True)
        write(machine, f"2026-03-{k + 1:02d}.parquet", make_log(300, k, delay=0.005 if k % 3 else 0.01))
    (folder / "logs/m0/broken.parquet").write_bytes(b"PAR1 and no more")
    (folder / "logs/m1/empty.csv").write_text("")
    (folder / "dsd.toml").write_text(CONFIG)
    done("fleet", "detect", "logs/**/*.*", "-o", "one.parquet", "--workers", "1", cwd=folder)
    return folder


def test_a_row_is_what_the_command_says_of_the_log(fleet: Path) -> None:
    table = rows(fleet / "one.parquet")
    assert len(table) == LOGS + 2
    assert [row["log"] for row in table] == sorted(row["log"] for row in table)
    row = next(row for row in table if row["log"].endswith("m1/2026-03-02.parquet"))
    alone = summary(row["log"], cwd=fleet)
    assert (row["machine"], row["date"], row["status"], row["reason"]) == ("m1", "2026-03-02", "done", "")
    for name in ("samples", "judged", "confident_share", "residual_rms", "explained_share"):
        assert row[name] == alone[name]
    assert (row["final.delay"], row["final.inertia"]) == (alone["final"]["delay"], alone["final"]["inertia"])
    assert row["verdict"] == "delay 0.005, inertia 1"


def test_a_bad_log_is_a_row_with_the_line_of_the_command(fleet: Path) -> None:
    bad = {row["log"]: row for row in rows(fleet / "one.parquet") if row["status"] == "failed"}
    assert sorted(bad) == ["logs/m0/broken.parquet", "logs/m1/empty.csv"]
    for log, row in bad.items():
        assert dsd("detect", log, cwd=fleet).stderr.strip() == f"dsd: error: {row['reason']}"
        assert row["verdict"] is None


def test_neither_the_number_of_workers_nor_the_order_of_the_logs_matters(fleet: Path) -> None:
    logs = [row["log"] for row in reversed(rows(fleet / "one.parquet"))]
    done("fleet", "detect", *logs, "-o", "three.parquet", "--workers", "3", cwd=fleet)
    assert rows(fleet / "three.parquet") == rows(fleet / "one.parquet")
    assert (fleet / "three.parquet").read_bytes() == (fleet / "one.parquet").read_bytes()


def start(folder: Path, *arguments: str) -> subprocess.Popen:
    return subprocess.Popen(
        [*DSD, *arguments],
        cwd=folder,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "NO_COLOR": "1"},
        preexec_fn=interruptible,
    )


@pytest.fixture
def many(tmp_path: Path) -> Path:
    """Logs that take a little longer."""
    (tmp_path / "logs").mkdir()
    for k in range(16):
        write(tmp_path / "logs", f"{k:02d}.parquet", make_log(60_000, k))
    (tmp_path / "dsd.toml").write_text(CONFIG)
    return tmp_path


FLEET = ("fleet", "detect", "logs/*", "-o", "r.parquet", "--workers", "2")


def finished_rows(folder: Path) -> int:
    part = folder / "r.parquet.part"
    return part.read_bytes().count(b"\n") if part.exists() else 0


#: What share of its processor time a worker spends in the thread that works.
ONE_CORE = """
import resource, sys
from pathlib import Path
from dsd_cli.cli.fleet_pools import start_worker
start_worker()
from dsd_cli.cli.fleet_tasks import ConfigText, Task, run_task

def times():
    found = [resource.getrusage(who) for who in (resource.RUSAGE_THREAD, resource.RUSAGE_SELF)]
    return [one.ru_utime + one.ru_stime for one in found]

config = ConfigText("dsd.toml", ".", Path("dsd.toml").read_text())
logs = [Task("detect", log, log, config, (), "k", "", "") for log in sys.argv[1:]]
run_task(logs[0])  # which imports
before, rows, after = times(), [run_task(task) for task in logs], times()
assert all(row["status"] == "done" for row in rows), rows
print((after[0] - before[0]) / (after[1] - before[1]))
"""


@pytest.mark.skipif(sys.platform != "linux", reason="RUSAGE_THREAD")
def test_a_worker_uses_one_core(many: Path) -> None:
    logs = sorted(str(path) for path in (many / "logs").iterdir())
    run = subprocess.run([sys.executable, "-c", ONE_CORE, *logs], cwd=many, capture_output=True, text=True, check=True)
    assert float(run.stdout) > 0.95


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_a_killed_run_goes_on_and_leaves_no_workers(many: Path) -> None:
    run = start(many, *FLEET)
    wait_for(lambda: finished_rows(many) >= 3)
    left = children(run.pid)
    run.kill()
    run.wait()
    wait_for(lambda: not any(Path(f"/proc/{one}").exists() for one in left))
    assert not (many / "r.parquet").exists()
    kept = finished_rows(many)
    so_far = done("fleet", "summary", "r.parquet", cwd=many)
    assert f"{kept} logs" in so_far.stdout
    assert "r.parquet is not written yet; these are the rows so far, in r.parquet.part" in so_far.stderr
    with open(many / "r.parquet.part", "ab") as file:
        file.write(b'{"log": "torn')  # what the kill may leave
    again = done(*FLEET, cwd=many)
    assert f"{kept} of 16 logs are done already" in again.stderr
    assert not (many / "r.parquet.part").exists()
    table = rows(many / "r.parquet")
    assert [row["status"] for row in table] == ["done"] * 16
    once_more = done(*FLEET, cwd=many)
    assert "16 of 16 logs are done already" in once_more.stderr
    assert rows(many / "r.parquet") == table


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_a_worker_that_is_killed_loses_nothing(many: Path) -> None:
    run = start(many, *FLEET)
    wait_for(lambda: finished_rows(many) >= 3)
    os.kill(workers_of(run.pid)[0], signal.SIGKILL)
    _, said = run.communicate()
    assert run.returncode == 0, said
    assert "a worker died" in said
    assert [row["status"] for row in rows(many / "r.parquet")] == ["done"] * 16


def test_the_log_that_kills_its_workers_is_named(tmp_path: Path) -> None:
    for k, count in enumerate((200, 77, 200, 200)):
        write(tmp_path, f"{k}.csv", make_log(count, k))
    (tmp_path / "killer.py").write_text(KILLER)
    (tmp_path / "dsd.toml").write_text(CONFIG + "[model.effects.killer]\nforce = 1.0\n")
    options = ("-o", "r.parquet", "--workers", "2", "--effects-from", "killer.py")
    done("fleet", "detect", "[0-9].csv", *options, cwd=tmp_path)
    table = rows(tmp_path / "r.parquet")
    assert [row["status"] for row in table] == ["done", "failed", "done", "done"]
    assert table[1]["reason"].startswith("the worker died 2 time(s) with this log alone")


def test_ctrl_c_keeps_what_is_done(many: Path) -> None:
    delays = ", ".join(f"{0.0005 * k:.4f}" for k in range(200))  # states enough to take a while
    run = start(many, *FLEET, "--set", f"states.delays=[{delays}]")
    wait_for(lambda: finished_rows(many) >= 2)
    run.send_signal(signal.SIGINT)
    _, said = run.communicate()
    assert (run.returncode, len(said.splitlines())) == (130, 1), said
    assert "the same command goes on from there" in said
    assert finished_rows(many) >= 2


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[tuple[str, list[subprocess.Popen]]]:
    """A scheduler and two workers, as processes of their own."""
    pytest.importorskip("distributed", reason="distributed is not installed")
    found, here = tmp_path / "scheduler.json", {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    module = [sys.executable, "-m"]
    at = ["--scheduler-file", str(found), "--no-dashboard"]
    serve = [*module, "distributed.cli.dask_scheduler", "--port", "0", "--host", "127.0.0.1", *at]
    work = [*module, "distributed.cli.dask_worker", "--nthreads", "1", "--no-nanny", *at]
    started = [subprocess.Popen(serve, cwd=tmp_path, **here)]
    try:
        wait_for(found.exists)
        started += [subprocess.Popen(work, cwd=tmp_path, **here) for _ in range(2)]
        yield json.loads(found.read_text())["address"], started[1:]
    finally:
        for process in started:
            process.kill()
            process.wait()


def test_a_cluster_gives_the_same_table_and_survives_a_worker(many: Path, cluster) -> None:
    address, workers = cluster
    run = start(many, "fleet", "detect", "logs/*", "-o", "r.parquet", "--cluster", address)
    wait_for(lambda: finished_rows(many) >= 3)
    workers[0].kill()
    _, said = run.communicate()
    assert run.returncode == 0, said
    done("fleet", "detect", "logs/*", "-o", "local.parquet", "--workers", "1", cwd=many)
    assert rows(many / "r.parquet") == rows(many / "local.parquet")


def test_a_list_gives_each_log_its_config_machine_and_date(fleet: Path, tmp_path: Path) -> None:
    write(tmp_path, "a.csv", make_log(300, 1))
    other = CONFIG.replace("[0.0, 0.005, 0.01]", "[0.01, 0.02]").replace("window = 40", "window = 50")
    (tmp_path / "dsd.toml").write_text(CONFIG)
    (tmp_path / "other.toml").write_text(other)
    url = (fleet / "logs/m1/2026-03-02.parquet").as_uri()
    table = f"log,config,machine,date\na.csv,,press 4,2025-12-01\na.csv,other.toml,press 4,2025-12-02\n{url},,,\n"
    (tmp_path / "logs.csv").write_text(table)
    done("fleet", "detect", "--list", "logs.csv", "-o", "r.parquet", "--workers", "1", cwd=tmp_path)
    found = {(row["log"], row["config"]): row for row in rows(tmp_path / "r.parquet")}
    assert found["a.csv", "dsd.toml"]["final.delay"] == 0.005
    assert found["a.csv", "other.toml"]["final.delay"] == 0.01
    assert found["a.csv", "other.toml"]["machine"] == "press 4"
    assert found["a.csv", "other.toml"]["date"] == "2025-12-02"
    assert found[url, "dsd.toml"]["status"] == "done"
    assert found[url, "dsd.toml"]["date"] == "2026-03-02"


def test_compare_and_diagnose_rows_are_those_of_the_commands(tmp_path: Path) -> None:
    from tests.docs.test_readme_commands import ROOT

    log, config = "part.csv", ROOT / "sample_logs/servo-bare.toml"
    rows_of_log = (ROOT / "sample_logs/servo-friction.csv").read_text().splitlines()
    (tmp_path / log).write_text("\n".join(rows_of_log[:1501]) + "\n")
    done("fleet", "compare", log, "-c", config, "-o", "c.parquet", "--workers", "1", cwd=tmp_path)
    done("fleet", "diagnose", log, "-c", config, "-o", "d.parquet", "--workers", "1", cwd=tmp_path)
    (compared,), (diagnosed,) = rows(tmp_path / "c.parquet"), rows(tmp_path / "d.parquet")
    alone = json.loads(done("compare", log, "-c", config, "--format", "json", cwd=tmp_path).stdout)
    assert (compared["verdict"], compared["rmse"]) == (alone["conclusion"], alone["rmse"])
    assert (compared["force_rmse"], compared["band_hz"]) == (alone["force"]["rmse"], alone["force"]["band_hz"])
    alone = json.loads(done("diagnose", log, "-c", config, "--format", "json", cwd=tmp_path).stdout)
    assert (diagnosed["verdict"], diagnosed["said"]) == ("coulomb_friction", alone["verdict_text"])
    level = alone["found_values"]["coulomb_friction.level"]
    assert abs(level["value"] - 0.15) < 2.0 * level["std_error"]  # which the log was made with
    assert diagnosed["value.coulomb_friction.level"] == level["value"]
    assert diagnosed["error.coulomb_friction.level"] == level["std_error"]
    assert diagnosed["heldout_rmse_after"] == alone["found_heldout_rmse"]


def test_a_log_whose_u_is_turned_names_no_effect_in_a_fleet_either(tmp_path: Path) -> None:
    from tests.docs.test_readme_commands import ROOT

    samples = ROOT / "sample_logs"
    turned = 'u_unit = "N m"\nu_sign = -1\nd_hat = ""'
    config = (samples / "servo-bare.toml").read_text("utf-8").replace('u_unit = "N m"', turned, 1)
    (tmp_path / "dsd.toml").write_text(config, encoding="utf-8")
    log = samples / "servo-friction.csv"
    done("fleet", "diagnose", log, "-o", "d.parquet", "--workers", "1", cwd=tmp_path)
    (row,) = rows(tmp_path / "d.parquet")
    alone = json.loads(done("diagnose", log, "--format", "json", cwd=tmp_path).stdout)
    assert (row["verdict"], row["said"], row["found"]) == ("unknown", alone["verdict_text"], "")
    assert "the other sign" in row["said"]


def test_a_changed_config_or_log_is_worked_on_again(tmp_path: Path) -> None:
    for k in range(2):
        write(tmp_path, f"{k}.csv", make_log(200, k))
    (tmp_path / "dsd.toml").write_text(CONFIG)
    command = ("fleet", "detect", "0.csv", "1.csv", "-o", "r.parquet", "--workers", "1")
    done(*command, cwd=tmp_path)
    write(tmp_path, "1.csv", make_log(220, 7))
    assert "1 of 2 logs are done already" in done(*command, cwd=tmp_path).stderr
    assert [row["samples"] for row in rows(tmp_path / "r.parquet")] == [200, 220]
    assert "already" not in done(*command, "--set", "detector.window=30", cwd=tmp_path).stderr


def test_a_pattern_takes_logs_and_not_what_lies_beside_them(tmp_path: Path) -> None:
    (tmp_path / "runs/day").mkdir(parents=True)
    write(tmp_path / "runs/day", "a.csv", make_log(200, 1))
    (tmp_path / "runs/day/a.csv.meta.json").write_text("{}")
    (tmp_path / "runs/day/notes.json").write_text("{}")  # not ours: a row that says what is wrong with it
    (tmp_path / "dsd.toml").write_text(CONFIG)
    for _ in range(2):  # the second finds the table of the first
        done("fleet", "detect", "runs/**/*", "-o", "runs/day/r.csv", "--workers", "1", cwd=tmp_path)
    found = (tmp_path / "runs/day/r.csv").read_text().splitlines()[1:]
    assert [line.split(",")[0] for line in found] == ['"runs/day/a.csv"', '"runs/day/notes.json"']


def test_a_log_that_is_named_twice_is_one_row(tmp_path: Path) -> None:
    write(tmp_path, "a.csv", make_log(200, 1))
    (tmp_path / "dsd.toml").write_text(CONFIG)
    (tmp_path / "list.txt").write_text("a.csv\n./a.csv\n")
    names = ("a.csv", str(tmp_path / "a.csv"), "--list", "list.txt")
    said = done("fleet", "detect", *names, "-o", "r.parquet", "--workers", "1", cwd=tmp_path).stderr
    assert "3 of 4 names are of logs that are named already: taken once" in said
    assert [row["log"] for row in rows(tmp_path / "r.parquet")] == ["a.csv"]


def test_results_of_another_command_or_of_nobody_are_not_lost(tmp_path: Path) -> None:
    for k in range(2):
        write(tmp_path, f"{k}.csv", make_log(200, k))
    (tmp_path / "dsd.toml").write_text(CONFIG)
    to = ("-o", "r.csv", "--workers", "1")
    done("fleet", "detect", "0.csv", *to, cwd=tmp_path)
    before = (tmp_path / "r.csv").read_bytes()
    refused(dsd("fleet", "compare", "0.csv", *to, cwd=tmp_path), 2, "r.csv: has rows of dsd fleet detect")
    assert (tmp_path / "r.csv").read_bytes() == before
    assert not (tmp_path / "r.csv.part").exists()
    refused(dsd("fleet", "detect", "0.csv", "-o", "1.csv", cwd=tmp_path), 2, "is no table of results")
    said = done("fleet", "detect", "1.csv", *to, cwd=tmp_path).stderr
    assert "1 of the 1 rows of r.csv are of logs that are not named now: they go" in said
    journal = tmp_path / "r.csv.part"
    journal.write_text(json.dumps({"log": "0.csv", "command": "diagnose", "status": "done", "key": "k"}) + "\n")
    refused(dsd("fleet", "detect", "1.csv", *to, cwd=tmp_path), 2, "r.csv.part: has rows of dsd fleet diagnose")
    assert journal.exists()
    done("fleet", "detect", "1.csv", *to, "--anew", cwd=tmp_path)
    assert not journal.exists()


@pytest.mark.skipif(sys.platform != "linux", reason="locks files")
def test_two_runs_cannot_write_one_table(tmp_path: Path) -> None:
    import fcntl

    write(tmp_path, "a.csv", make_log(200, 1))
    (tmp_path / "dsd.toml").write_text(CONFIG)
    with open(tmp_path / "r.csv.part", "ab") as other:
        fcntl.flock(other, fcntl.LOCK_EX)
        refused(dsd("fleet", "detect", "a.csv", "-o", "r.csv", cwd=tmp_path), 2, "another run is writing it: wait for")
        assert (tmp_path / "r.csv.part").exists()


def test_refused_in_one_line(fleet: Path, tmp_path: Path) -> None:
    run = ("fleet", "detect")
    refused(dsd(*run, cwd=fleet), 2, "no log is given")
    refused(dsd(*run, "nothing-*.csv", cwd=fleet), 2, "nothing-*.csv: no such log")
    refused(dsd(*run, "one.parquet", "-o", "one.parquet", cwd=fleet), 1, "is the only log")
    refused(dsd(*run, "logs/m1/*", "-o", "r.json", cwd=fleet), 2, "end the name in .parquet or .csv")
    refused(dsd(*run, "logs/m1/*", "-c", "no.toml", cwd=fleet), 2, "no.toml: no such config file")
    refused(dsd(*run, "logs", cwd=fleet), 2, "logs: is a folder: name its logs: 'logs/**/*'")
    refused(dsd(*run, "--list", "no.txt", cwd=fleet), 2, "no.txt: no such file")
    refused(dsd(*run, "--list", "no.csv", cwd=fleet), 2, "no.csv: no such file")
    refused(dsd(*run, "logs/m1/*", "--workers", "0", cwd=fleet), 2, "--workers 0")
    refused(dsd(*run, "logs/m1/*", "--cluster", "local:x", cwd=fleet), 2, "local:N")
    refused(dsd("fleet", "summary", "logs/m1/2026-03-02.parquet", cwd=fleet), 1, "it has no column log")
    refused(dsd("fleet", "summary", "none.parquet", cwd=fleet), 1, "none.parquet: no such file")
    result = dsd(*run, "logs/m1/empty.csv", "-o", str(tmp_path / "r.parquet"), cwd=fleet)
    assert (result.returncode, result.stdout) == (1, "")
    assert "no log gave a result; the first: logs/m1/empty.csv: is empty" in result.stderr
