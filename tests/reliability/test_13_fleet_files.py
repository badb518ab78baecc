"""A fleet takes nothing that is not its own: foreign files where its rows are kept, logs as output, full disks."""

import json
import os
import subprocess
import sys

import pytest

from dsd_cli.cli.fleet_logs import Entry, refuse_output_among
from dsd_cli.errors import DataError, UsageError
from dsd_cli.files.fleet_table import Journal
from tests.cli.rig import CONFIG, dsd, make_log, write

VALUES = ["1.0"] * 9 + ["1e308"]
ROW = b'{"log": "a.csv", "status": "done", "verdict": "none", "key": "k"}\n'
FOREIGN = {
    "another tool's half download": b"PK\x03\x04 not yet whole",
    "text": b"my notes\n",
    "JSON lines": b'{"t": 1.0}\n',
    "rows and something else": ROW + b"my notes\n" + ROW,
    "a row without its key": b'{"log": "a.csv"}\n',
}


@pytest.mark.parametrize("kind", FOREIGN)
def test_a_file_of_somebody_else_is_left_alone(tmp_path, kind):
    part = tmp_path / "results.csv.part"
    part.write_bytes(FOREIGN[kind])
    with pytest.raises(UsageError, match="is not of dsd fleet"):
        Journal(tmp_path / "results.csv")
    assert part.read_bytes() == FOREIGN[kind]


def test_a_link_is_not_written_through(tmp_path):
    (tmp_path / "victim").write_bytes(ROW)
    (tmp_path / "results.csv.part").symlink_to(tmp_path / "victim")
    with pytest.raises(UsageError, match="is not of dsd fleet"):
        Journal(tmp_path / "results.csv")
    assert (tmp_path / "victim").read_bytes() == ROW


@pytest.mark.parametrize("cut", [0, 1, 5, 20, len(ROW) - 1, len(ROW), len(ROW) + 3])
def test_what_a_killed_run_left_is_its_own(tmp_path, cut):
    (tmp_path / "results.csv.part").write_bytes((ROW + ROW.replace(b'"k"', b'"l"'))[:cut])
    journal = Journal(tmp_path / "results.csv")
    assert len(journal) == (cut >= len(ROW))
    journal.close()


def test_a_log_is_no_output_even_if_the_rows_may_be_lost(tmp_path):
    (tmp_path / "dsd.toml").write_text(CONFIG)
    for name in ("a.csv", "b.csv"):
        write(tmp_path, name, make_log())
    os.link(tmp_path / "b.csv", tmp_path / "hard.csv")
    (tmp_path / "soft.csv").symlink_to("b.csv")
    before = (tmp_path / "b.csv").read_bytes()
    for output in ("b.csv", "hard.csv", "soft.csv"):
        with pytest.raises(UsageError, match="is one of the logs"):
            refuse_output_among(
                [Entry(str(tmp_path / "a.csv")), Entry(str(tmp_path / "b.csv"))], str(tmp_path / output)
            )
    result = dsd("fleet", "detect", "a.csv", "b.csv", "-o", "b.csv", "--anew", "--workers", 1, cwd=tmp_path)
    assert (result.returncode, result.stdout) == (2, "")
    assert "b.csv: is one of the logs" in result.stderr
    assert (tmp_path / "b.csv").read_bytes() == before


def test_a_full_disk_is_said_of_the_file(tmp_path):
    code = (
        "import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))\n"
        "from pathlib import Path; from dsd_cli.files.fleet_table import Journal\n"
        "journal = Journal(Path('results.csv'))\n"
        "try:\n"
        "    for i in range(100): journal.add({'log': 'a.csv', 'key': str(i)})\n"
        "finally:\n"
        "    journal.close()\n"
    )
    result = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, timeout=300, check=False
    )
    assert result.stderr.splitlines()[-1].endswith("results.csv.part: cannot be written (File too large)")
    assert DataError.__name__ in result.stderr.splitlines()[-1]


def test_absurd_values_have_a_summary(tmp_path):
    """Ten machines alike, one with an inertia of 1e308: it stands out by a number, in JSON too."""
    rows = [f"{i}.csv,m,2026-01-{i + 1:02d},dsd.toml,diagnose,done,,none,{v},1e308,k{i}" for i, v in enumerate(VALUES)]
    head = "log,machine,date,config,command,status,reason,verdict,value.inertia,error.inertia,key"
    (tmp_path / "results.csv").write_text("\n".join([head, *rows]) + "\n")
    result = dsd("fleet", "summary", "results.csv", "--format", "json", cwd=tmp_path)
    assert (result.returncode, result.stderr) == (0, "")
    json.loads(result.stdout, parse_constant=pytest.fail)
    (tmp_path / "results.csv").write_text("\n".join([head, *rows]).replace(",1e308,k", ",0.01,k") + "\n")
    result = dsd("fleet", "summary", "results.csv", "--format", "json", cwd=tmp_path)
    odd = json.loads(result.stdout, parse_constant=pytest.fail)["odd"]
    assert [one["log"] for one in odd] == ["9.csv"]
