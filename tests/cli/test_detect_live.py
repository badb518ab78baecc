"""`dsd detect` live: a line out per line in, files that grow, rotation, pipes that close, Ctrl-C."""

import os
import select
import signal
import subprocess
import time
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from tests.cli.rig import CONFIG, DSD, csv_text, done, interruptible, make_log, read_labels, same, write


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("rig")
    (folder / "dsd.toml").write_text(CONFIG)
    write(folder, "log.csv", make_log(60))
    return folder


class Lines:
    """Lines of a pipe, each of which must come within some seconds."""

    def __init__(self, pipe) -> None:
        self._fd, self._rest = pipe.fileno(), b""

    def next(self, wait: float = 300.0) -> str:
        end = time.monotonic() + wait
        while b"\n" not in self._rest:
            ready, _, _ = select.select([self._fd], [], [], max(end - time.monotonic(), 0))
            assert ready, "no line came"
            more = os.read(self._fd, 1 << 16)
            assert more, "the output ended"
            self._rest += more
        line, self._rest = self._rest.split(b"\n", 1)
        return line.decode()

    def silent(self, wait: float = 0.2) -> bool:
        return b"\n" not in self._rest and not select.select([self._fd], [], [], wait)[0]


@contextmanager
def running(*arguments, cwd):
    process = subprocess.Popen(
        [*DSD, "detect", *map(str, arguments)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        cwd=cwd,
        preexec_fn=interruptible,
    )
    try:
        yield process, Lines(process.stdout)
    finally:
        process.kill()
        process.wait(300)
        for pipe in (process.stdin, process.stdout, process.stderr):
            pipe.close()


@pytest.mark.parametrize(
    "options",
    [
        [],
        ["--set", "signals.sample_time=0.001"],
        ["--set", "detector.method=average"],
        ["--format", "jsonl"],
        ["--set", "detector.method=profile"],
    ],
    ids=["clock from the stamps", "sample_time", "average", "jsonl", "profile"],
)
def test_a_line_out_for_every_line_in(rig, options):
    header, *rows = csv_text(make_log(60)).splitlines()
    rows[30] = rows[30].split(",")[0] + ",nan,0.1"  # dropped, and has a label all the same
    rows[33] = rows[32]
    got = []
    with running("-", *options, cwd=rig) as (process, lines):
        process.stdin.write((header + "\n").encode())
        process.stdin.flush()
        if "jsonl" not in options:
            got.append(lines.next())
        for row in rows:
            process.stdin.write((row + "\n").encode())
            process.stdin.flush()
            got.append(lines.next())
        process.stdin.close()
        assert process.wait(300) == 0
        said = process.stderr.read().decode()
    assert "not finite: u 1" in said
    if "jsonl" in options:
        assert len(got) == 60
        return
    (rig / "dirty.csv").write_text("\n".join([header, *rows]) + "\n")
    whole = done("detect", "dirty.csv", "-o", "-", *options, cwd=rig)
    assert "\n".join(got) + "\n" == whole.stdout


def test_without_a_time_column(rig):
    log = make_log(40)
    text = csv_text({name: log[name] for name in ("u", "d_hat")})
    (rig / "untimed.toml").write_text(CONFIG + "[signals]\nsample_time = 0.001\n")
    header, *rows = text.splitlines()
    with running("-", "-c", "untimed.toml", "-q", cwd=rig) as (process, lines):
        process.stdin.write((header + "\n").encode())
        process.stdin.flush()
        got = [lines.next()]
        for row in rows:
            process.stdin.write((row + "\n").encode())
            process.stdin.flush()
            got.append(lines.next())
    (rig / "untimed.csv").write_text(text)
    assert "\n".join(got) + "\n" == done("detect", "untimed.csv", "-c", "untimed.toml", "-o", "-", cwd=rig).stdout


def test_a_growing_file_with_a_half_line_and_rotation(rig, tmp_path):
    header, *rows = csv_text(make_log(60)).splitlines()
    log = tmp_path / "log.csv"
    log.write_text("\n".join([header, *rows[:20]]) + "\n")
    with running(log, "--follow", cwd=rig) as (process, lines):
        first = [lines.next() for _ in range(21)]
        with log.open("a") as file:
            file.write(rows[20][:9])
            file.flush()
            assert lines.silent()
            file.write(rows[20][9:] + "\n" + rows[21] + "\n")
        first += [lines.next(), lines.next()]
        other = tmp_path / "other.csv"
        other.write_text("\n".join([header, *rows[:30]]) + "\n")
        other.rename(log)
        second = [lines.next() for _ in range(30)]
        process.send_signal(signal.SIGINT)
        assert process.wait(300) == 0
        said = process.stderr.read().decode()
    assert "52 samples" in said
    assert "restart 1" in said
    assert "Traceback" not in said
    whole = done("detect", rig / "log.csv", "-o", "-", cwd=rig).stdout.splitlines()
    assert first == whole[:23]
    assert second[0].startswith("0,4,")  # the label stands until there is new evidence
    assert second[29].split(",")[1:4] == ["4", "0.005", "1.0"]


def until_read(process, path) -> None:
    """Waits until the process has read the file to its end; on a busy machine that takes a while."""
    opened = Path("/proc") / str(process.pid) / "fd"
    if not opened.exists():
        time.sleep(5.0)
        return
    end = time.monotonic() + 300.0
    while not any(_at_end(one, path) for one in opened.iterdir()):
        assert time.monotonic() < end
        time.sleep(0.05)
    time.sleep(0.5)  # the first look at a log reads it, too


def _at_end(descriptor: Path, path: Path) -> bool:
    try:
        place = (descriptor.parents[1] / "fdinfo" / descriptor.name).read_text().split()[1]
        return descriptor.resolve() == path.resolve() and int(place) == path.stat().st_size
    except OSError:  # closed meanwhile
        return False


def test_follow_into_a_file_is_whole_after_ctrl_c(rig, tmp_path):
    out = tmp_path / "labels.parquet"
    with running("log.csv", "--follow", "-o", out, cwd=rig) as (process, _):
        until_read(process, rig / "log.csv")
        assert not out.exists()
        process.send_signal(signal.SIGINT)
        assert process.wait(300) == 0
        assert b"60 samples" in process.stdout.read()
    done("detect", "log.csv", "-o", tmp_path / "direct.parquet", cwd=rig)
    same(read_labels(out), read_labels(tmp_path / "direct.parquet"))


def test_ctrl_c_without_follow_leaves_nothing(rig, tmp_path):
    out = tmp_path / "labels.csv"
    with running("-", "-o", out, cwd=rig) as (process, _):
        process.stdin.write(csv_text(make_log(60)).encode())
        process.stdin.flush()
        time.sleep(1.5)
        process.send_signal(signal.SIGINT)
        assert process.wait(300) == 130
        assert process.stderr.read() == b""
    assert list(tmp_path.iterdir()) == []


def test_a_closed_pipe_is_quiet(rig):
    write(rig, "long.csv", make_log(20_000))
    for source in ("detect long.csv -o -", "detect - --format jsonl < long.csv", "detect long.csv --format csv"):
        command = f"{' '.join(DSD)} {source} | head -1"
        said = subprocess.run(command, shell=True, capture_output=True, text=True, check=False, cwd=rig)
        assert said.stderr == ""
        assert len(said.stdout.splitlines()) == 1


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["-", "--follow"], "--follow needs a file"),
        (["log.csv", "--follow", "--set", "detector.method=viterbi"], "needs the whole log"),
    ],
)
def test_what_cannot_be_live(rig, arguments, text):
    with running(*arguments, cwd=rig) as (process, _):
        assert process.wait(300) == 2
        assert text in process.stderr.read().decode()


def test_whole_log_methods_take_stdin_whole(rig):
    text = (rig / "log.csv").read_text()
    streamed = done("detect", "-", "--set", "detector.method=viterbi", cwd=rig, stdin=text).stdout
    whole = done("detect", "log.csv", "-o", "-", "--set", "detector.method=viterbi", cwd=rig).stdout
    assert streamed == whole
    assert len(streamed.splitlines()) == 61
    assert np.isfinite(read_labels(whole)["log_likelihood"].astype(float)[21:]).all()
