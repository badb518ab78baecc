"""One page for all tests of a run: made by the real command from a log whose names are attacks."""

from __future__ import annotations

import fcntl
import os
import shutil
from pathlib import Path

import pytest

from tests import warm
from tests.cli.rig import without_signals

SAMPLES = Path(__file__).parents[3] / "sample_logs"
#: Name of the log, of two columns, and of a unit; none of them may ever be obeyed.
LOG = "a<script>hacked=1<\\script>[x]$$\x1b]52;\u202e\u2028.csv"
U, POSITION = "[/x]$$<img src=x onerror=hacked=1>", "</script><script>hacked=1</script><!--"
UNIT = "</script><b>$$[/x]"
CONFIG = "evil.toml"
#: What the page looks for: one of three values and long names among them.
EFFECTS = (*warm.FEW, "cogging")
ARGUMENTS = (LOG, "-c", CONFIG, "--to", "2.2")


def evil_log(folder: Path) -> None:
    """servo-friction.csv under those names, and its bare config with a comment that is one too."""
    text = (SAMPLES / "servo-friction.csv").read_text()
    head, _, rows = text.partition("\n")
    columns = head.replace("u,", f"{U},", 1).replace("position", POSITION)
    (folder / LOG).write_text(f"{columns}\n{rows}", encoding="utf-8")
    config = without_signals(SAMPLES / "servo-bare.toml")
    signals = f'[signals]\nu = "{U}"\nposition = "{POSITION}"\nu_unit = "{UNIT}"\nvelocity = ""\n'
    (folder / CONFIG).write_text(f"# <!-- <script>hacked=1</script> -->\n{config}\n{signals}", encoding="utf-8")


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory, worker_id: str) -> Path:
    """Where the page is, `page.html`, with its log and config; of several workers the first makes it."""
    base = tmp_path_factory.getbasetemp()
    here = (base if worker_id == "master" else base.parent) / "report-page"
    here.mkdir(exist_ok=True)
    with open(here / "lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not (here / "page.html").exists():
            evil_log(here)
            made = warm.run("report", *ARGUMENTS, "-o", "page.html", cwd=here, effects=EFFECTS)
            assert made.returncode == 0, made.stderr
            (here / "stderr.txt").write_text(made.stderr)
    return here


def browser() -> str | None:
    """A Chromium that is installed."""
    named = (os.environ.get("DSD_BROWSER"), "chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
    return next((found for name in named if name and (found := shutil.which(name))), None)
