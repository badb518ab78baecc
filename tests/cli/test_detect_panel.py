"""`dsd detect --follow --live`: a panel on a terminal, plain lines elsewhere, and a clean end."""

import os
import re
import signal
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest

from dsd_cli.report.live import BLOCKS, Moved, change_line, sparkline
from tests.cli.rig import CONFIG, DSD, csv_text, done, dsd, interruptible, make_log, read_labels, same, write
from tests.cli.terminal import Terminal, terminal


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("rig")
    (folder / "dsd.toml").write_text(CONFIG)
    write(folder, "log.csv", make_log(400))
    return folder


def changing(rows: int) -> dict[str, np.ndarray]:
    """A log whose inertia is 1 in its first half and 2 in its second."""
    log, other = make_log(rows), make_log(rows, inertia=2.0)
    log["d_hat"][rows // 2 :] = other["d_hat"][rows // 2 :]
    return log


def shown(screen: Terminal, heading: str) -> str:
    """What the panel says on the line of that heading."""
    lines = [line for line in screen.text.splitlines() if line.startswith(f"│ {heading}")]
    return lines[0].removeprefix(f"│ {heading}").strip(" │") if lines else ""


def test_the_panel_says_what_the_detector_finds(rig, tmp_path):
    """State, confidence, the change, rows, dropped ones, both sparklines; then Ctrl-C: gone, and the summary."""
    log = changing(600)
    log["u"][500] = np.nan
    write(tmp_path, "log.csv", log)
    with terminal("detect", tmp_path / "log.csv", "--follow", "--live", cwd=rig) as screen:
        screen.until(lambda: "600 rows" in shown(screen, "at"))
        assert shown(screen, "state").startswith("5: delay 0.005 s, inertia 2, ")
        assert "confident, p = " in shown(screen, "state")
        assert "rows/s, not finite: u 1" in shown(screen, "at")
        change = re.compile(r"(0\.3\d\d) s: inertia 1 -> 2")
        screen.until(lambda: change.search(screen.text) is not None)  # a frame may fall between the rows and the change
        at = change.search(screen.text)
        assert at, screen.text
        assert 0.300 <= float(at[1]) <= 0.345  # the window of 40 samples, at most, behind the change at 0.3 s
        for heading in ("d_hat", "residual"):
            assert len(set(shown(screen, heading)) & set(BLOCKS)) >= 2, screen.text
        with (tmp_path / "log.csv").open("a") as file:  # it goes on
            file.write("0.600,0.1,0.1\n")
        screen.until(lambda: "601 rows" in shown(screen, "at"))
        screen.type("\x03")
        assert screen.finish() == 0
        assert screen.text.splitlines()[0].startswith(str(tmp_path)[:40])
        assert not any(sign in screen.text for sign in "╭╰│^")
        assert "rows not taken as they are: not finite: u 1" in screen.text
        assert not screen.screen.cursor.hidden


def test_it_keeps_up_with_ten_thousand_rows_a_second(rig, tmp_path):
    """Two seconds of 10 kHz, written as they would come; all are labelled, as without the panel."""
    header, *rows = csv_text(make_log(20_000)).splitlines()
    log, out = tmp_path / "log.csv", tmp_path / "labels.parquet"
    log.write_text(header + "\n")
    with terminal("detect", log, "--follow", "--live", "-o", out, cwd=rig) as screen:
        screen.until(lambda: bool(shown(screen, "state")))
        with log.open("a") as file:
            for start in range(0, len(rows), 250):
                file.write("\n".join(rows[start : start + 250]) + "\n")
                file.flush()
                screen.read(0.025)
        screen.until(lambda: "20,000 rows" in shown(screen, "at"))
        screen.type("\x03")
        assert screen.finish() == 0
    done("detect", log, "-o", tmp_path / "direct.parquet", cwd=rig)
    same(read_labels(out), read_labels(tmp_path / "direct.parquet"))


def test_labels_do_not_wait_for_a_terminal_that_stands_still(rig, tmp_path):
    """Nobody reads the terminal: its buffer is full, the drawing stands, the labelling goes on."""
    header, *rows = csv_text(make_log(400)).splitlines()
    log, out = tmp_path / "log.csv", tmp_path / "labels.csv"
    log.write_text(header + "\n")
    with terminal("detect", log, "--follow", "--live", "--format", "jsonl", cwd=rig) as screen:
        assert screen.finish() == 2  # both on one terminal
        assert "write the labels to a file" in screen.text
    command = f"{' '.join(DSD)} detect {log} --follow --live --format csv > {out}"
    screen = Terminal(cwd=rig, command=["sh", "-c", f"exec {command}"])
    try:
        screen.until(lambda: bool(shown(screen, "state")))
        end, at = time.monotonic() + 300.0, 0
        while len(out.read_text().splitlines()) < 401:  # the terminal is not read once in all that time
            assert time.monotonic() < end
            if at < len(rows):
                with log.open("a") as file:
                    file.write(rows[at] + "\n")
                at += 1
            time.sleep(0.01)
    finally:
        screen.close()


def test_plain_lines_where_there_is_no_terminal(rig, tmp_path):
    write(tmp_path, "log.csv", changing(600))
    process = subprocess.Popen(
        [*DSD, "detect", str(tmp_path / "log.csv"), "--follow", "--live"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=rig,
        preexec_fn=interruptible,
    )
    lines = [process.stderr.readline() for _ in range(3)]
    process.send_signal(signal.SIGINT)
    out, rest = process.communicate(timeout=300)
    assert process.returncode == 0
    assert re.fullmatch(r"change at 0\.0\d\d s: delay 0\.005 s, inertia 1\n", lines[0])
    assert re.fullmatch(r"change at 0\.3\d\d s: inertia 1 -> 2\n", lines[1])
    line = r"0\.599 s, state 5: delay 0\.005 s, inertia 2, \d+ % confident, .*, 600 rows, \S+ rows/s, none dropped\n"
    assert re.fullmatch(line, lines[2])
    assert out.startswith(f"{tmp_path / 'log.csv'}: 600 samples")
    assert "\x1b" not in "".join(lines) + out + rest


def test_quiet_shows_the_summary_alone(rig):
    with terminal("detect", "log.csv", "--follow", "--live", "--quiet", cwd=rig) as screen:
        time.sleep(2.0)
        screen.read()
        assert screen.raw == b""
        screen.type("\x03")
        assert screen.finish() == 0
        assert "400 samples" in screen.text


def test_live_needs_a_log_that_grows(rig):
    ran = dsd("detect", "log.csv", "--live", cwd=rig)
    assert ran.returncode == 2
    assert "give --follow too" in ran.stderr


def test_a_second_ctrl_c_leaves_a_cursor(rig):
    """Whatever way it ends: the cursor is never hidden."""
    with terminal("detect", "log.csv", "--follow", "--live", cwd=rig) as screen:
        screen.until(lambda: bool(shown(screen, "state")))
        os.kill(screen.process.pid, signal.SIGKILL)
        screen.finish()
        assert not screen.screen.cursor.hidden


def test_sparkline_and_changes():
    assert sparkline([0.0, 0.5, 1.0, float("nan"), 2.0], 0.0, 1.0, 6) == " ▁▅█ █"
    assert sparkline([1.0, 1.0], 1.0, 1.0, 1) == "▁"
    assert sparkline([], 0.0, 1.0, 2, "_#") == "  "
    before, after = {"delay": 0.002, "inertia": 0.01}, {"delay": 0.002, "inertia": 0.015}
    assert change_line(Moved(1.5, before, after)) == "1.500 s: inertia 0.01 -> 0.015"
    assert change_line(Moved(1.5, None, after)) == "1.500 s: delay 0.002 s, inertia 0.015"
