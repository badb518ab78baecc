"""Progress with rate and time left, on a terminal only, gone at the end; --quiet silences it."""

import re
import sys
import time
from pathlib import Path

import pytest

from dsd_cli.cli.progress import Activity, progress_line, span
from dsd_cli.files.watched import about_rows
from tests.cli.rig import done, make_log, write
from tests.cli.terminal import terminal

SAMPLES = Path(__file__).parents[2] / "sample_logs"
#: A drawn line: the cursor to the left, the rest of the line away, the text.
DRAWN = re.compile(rb"\r\x1b\[K([^\r\n\x1b]+)")
#: The command on a machine on which every part of the work takes longer than the silence at the beginning (short here):
#: on a fast one a fit is over before anybody could see it or type.
SLOWLY = """
import time
from dsd_cli.cli import progress
from dsd_cli.__main__ import main
progress.SILENT = 0.2
said = progress.Progress.__call__
def slowly(*arguments):
    said(*arguments)
    time.sleep(2.0 * progress.SILENT)
progress.Progress.__call__ = slowly
main()
"""


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A long log of the sample rig, whose every command takes some seconds."""
    folder = tmp_path_factory.mktemp("rig")
    for name in ("servo-bare.toml", "servo-friction.toml"):
        (folder / name).write_text((SAMPLES / name).read_text())
    done("simulate", "-c", "servo-friction.toml", "--duration", 4, "-o", "log.parquet", cwd=folder)
    return folder


def drawn(raw: bytes) -> list[str]:
    return [text.decode() for text in DRAWN.findall(raw)]


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (
            "simulate -c servo-friction.toml --duration 2000 -o x.csv",
            r"simulating: [\d,]+ of 2,000,000 rows, .* left",
        ),
        ("compare log.parquet -c servo-bare.toml", r"\w.*: \d+ %, \d+ s left"),
        ("diagnose log.parquet -c servo-bare.toml", r"\w.*: \d+ %, \d+ \w+ left"),
        ("improve log.parquet -c servo-bare.toml --auto", r"\w.*: \d+ %, \d+ \w+ left"),
        ("add log.parquet coulomb_friction -c servo-bare.toml -o x.toml", r"fitting with coulomb_friction, \d+ s"),
        ("tune log.parquet -c servo-friction.toml", r"\w.*: \d+ %, \d+ \w+ left"),
    ],
)
def test_what_takes_long_says_how_long(rig, arguments, line):
    """Seen, then ended by Ctrl-C: the line is gone, nothing is left behind."""
    before = sorted(rig.iterdir())
    with terminal(cwd=rig, command=[sys.executable, "-c", SLOWLY, *arguments.split()]) as screen:
        screen.until(lambda: any(re.fullmatch(line, one) for one in drawn(screen.raw)))
        screen.type("\x03")
        assert screen.finish() == 130
        assert screen.text.replace("^C", "").strip() == ""
    assert sorted(rig.iterdir()) == before


def test_rows_of_a_log_with_rate_and_time_left(rig, tmp_path):
    """A text of a million rows; Ctrl-C before its end. The compiled kernel may be there before anything is drawn."""
    write(tmp_path, "one.csv", make_log(20_000))
    header, body = (tmp_path / "one.csv").read_text().split("\n", 1)
    (tmp_path / "log.csv").write_text(header + "\n" + body * 60)
    bare = [option for key in ("position", "velocity") for option in ("--set", f'signals.{key}=""')]
    arguments = ["detect", tmp_path / "log.csv", "-c", rig / "servo-friction.toml", *bare, "--set", "model.effects={}"]
    with terminal(*arguments, cwd=rig, DSD_KERNEL="numpy") as screen:
        wanted = r"labelling log\.csv: [\d,]+ of (\d,\d{3},\d{3}) rows, [\d,]+ a second, \d+ s left"
        screen.until(lambda: any(re.fullmatch(wanted, one) for one in drawn(screen.raw)))
        found = next(match for one in drawn(screen.raw) if (match := re.fullmatch(wanted, one)))
        assert abs(int(found[1].replace(",", "")) / 1_200_000 - 1) < 0.02
        screen.type("\x03")
        assert screen.finish() == 130


@pytest.mark.parametrize("command", ["compare log.parquet -c servo-bare.toml", "simulate -c servo-friction.toml -o -"])
def test_quiet_is_the_result_alone(rig, command):
    """Far longer than the silence at the beginning; what is written is the result and nothing else."""
    with terminal(*command.split(), "--quiet", cwd=rig) as screen:
        if command.startswith("simulate"):
            time.sleep(2.0)
            screen.read()
            screen.type("\x03")
        screen.finish(120)
        assert b"\r\x1b[K" not in screen.raw
        assert "warning" not in screen.text


def test_nothing_is_drawn_where_there_is_no_terminal(rig):
    ran = done("compare", "log.parquet", "-c", "servo-bare.toml", cwd=rig)
    assert "\r" not in ran.stderr + ran.stdout
    assert "a second" not in ran.stderr


@pytest.mark.parametrize(
    ("activity", "now", "line"),
    [
        (Activity("reading", 0.0, 0.0), 3.0, "reading, 3 s"),
        (
            Activity("reading", 0.0, 2.0, 500.0, 1500.0, "rows"),
            2.0,
            "reading: 500 of 1,500 rows, 250 a second, 4 s left",
        ),
        (
            Activity("reading", 0.0, 2.0, 500.0, 1500.0, "rows"),
            3.0,
            "reading: 500 of 1,500 rows, 250 a second, 3 s left",
        ),
        (Activity("reading", 0.0, 2.0, 500.0, None, "rows"), 2.0, "reading: 500 rows, 250 a second"),
        (Activity("reading", 0.0, 2.0, 1600.0, 1500.0, "rows"), 2.0, "reading: 1,600 of 1,500 rows, 800 a second"),
        (Activity("fitting", 0.0, 30.0, 0.1, 1.0), 30.0, "fitting: 10 %, 4 min left"),
    ],
)
def test_the_line(activity, now, line):
    assert progress_line(activity, now) == line


def test_spans():
    assert [span(s) for s in (0.2, 89.0, 91.0, 7200.0)] == ["0 s", "89 s", "2 min", "2 h"]


def test_rows_are_guessed_from_the_first_lines_of_a_text_and_said_by_parquet(tmp_path):
    csv, parquet = (write(tmp_path, f"log.{kind}", make_log(9_000)) for kind in ("csv", "parquet"))
    assert about_rows(str(csv)) == pytest.approx(9_000, rel=0.02)
    assert about_rows(str(parquet)) == 9_000
    (tmp_path / "short.csv").write_text("t,u\n0,1\n")
    assert [about_rows(name) for name in (str(tmp_path / "short.csv"), str(tmp_path), "-", "no such")] == [None] * 4
