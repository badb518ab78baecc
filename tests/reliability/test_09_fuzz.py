"""A few seconds of `python -m bench fuzz`, in a process of its own, and that it would notice."""

import subprocess
import sys
from pathlib import Path

from bench import fuzz, fuzz_cases

ROOT = Path(__file__).parents[2]


def test_a_few_seconds_without_a_finding():
    for seed in ("0", "100000"):
        command = [sys.executable, "-m", "bench", "fuzz", "--seconds", "3", "--seed", seed]
        result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=300, check=False)
        assert result.returncode == 0, result.stdout + result.stderr
        assert " 0 finding(s)" in result.stdout


def test_the_matrix_has_every_key_with_every_value():
    pairs = fuzz_cases.matrix()
    assert len(set(pairs)) == len(pairs) > 1500
    assert {"model.delay", "signals.outlier_factor", "simulate.events.time"} <= {key for key, _ in pairs}


def test_a_run_is_decided_by_its_number(tmp_path):
    for number in (3, 5000):
        seen = []
        for name in ("a", "b"):
            folder = tmp_path / f"{name}{number}"
            folder.mkdir()
            arguments = fuzz_cases.case(number, folder)
            seen.append((arguments, [(p.name, p.read_bytes()) for p in sorted(folder.iterdir())]))
        assert seen[0] == seen[1]


def test_what_is_a_finding(tmp_path):
    (tmp_path / ".stdout").write_bytes(b"")

    def judged(code: int, said: bytes, before: set[str] = frozenset()) -> str:
        return fuzz._finding(code, said, tmp_path, {".stdout", *before}, [])

    assert judged(0, b"") == ""
    assert judged(1, b"dsd: error: x.csv: no such file\n") == ""
    still = b'x.csv: t, v\ndsd: error: this log has no motion that changes: "v" is 0 in all rows; dsd needs one'
    one = b'x.csv: t\ndsd: error: x.csv: only "u" changes as a control input or a motion does: dsd needs one of each'
    assert judged(1, still) == judged(1, one) == ""  # `init` says what it found first
    bad = [
        *((-11, b""), (1, b""), (4, b"dsd: error: x"), (1, b"Traceback (most recent call last)")),
        *((1, b"dsd: error: unexpected ValueError"), (1, b"dsd: error: \x1b[2J"), (1, b"dsd: error: \xc2\x9b")),
    ]
    for code, said in bad:
        assert judged(code, said)
    (tmp_path / ".out.csv.1.tmp").write_text("t")
    assert "left behind" in judged(0, b"")
