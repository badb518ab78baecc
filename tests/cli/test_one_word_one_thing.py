"""Words and figures that a newcomer met and could not use: each says one thing, with the digits that it needs."""

import re
from pathlib import Path

import numpy as np

from dsd_cli.files.logs import load_log
from dsd_cli.files.scaled import FACTORS
from dsd_cli.report.detection import _stamp
from tests.cli.rig import csv_text, done


def test_stamps_of_samples_that_follow_each_other_differ() -> None:
    for start in (0.0, 32400.0, 1732700000.0):
        for apart in (0.1, 0.01, 0.0025, 0.001, 0.0005):
            said = [_stamp(start + k * apart, apart) for k in range(200)]
            assert len(set(said)) == len(said), (start, apart)
            assert max(abs(float(text) - start - k * apart) for k, text in enumerate(said)) < apart


def test_metadata_has_the_offsets_of_the_channels_that_are_there(tmp_path: Path) -> None:
    data = {"t": 0.01 * np.arange(50), "u": np.ones(50), "q": np.arange(50.0)}
    (tmp_path / "a.csv").write_text(csv_text(data))
    columns = {"t": "t", "u": "u", "position": "q", "velocity": "v"}
    read = {"factors": {"velocity": 2.0, "position": 3.0}, "offsets": {"u": 0.5, "velocity": 1.5}}
    loaded = load_log(str(tmp_path / "a.csv"), columns, {"velocity"}, **read)
    assert loaded.log.metadata[FACTORS] == "u - 0.5, position x 3"


def test_init_and_check_say_the_same_of_an_inertia(tmp_path: Path) -> None:
    """A weak push beside friction and a spring that are most of u: a scan finds an inertia, a model alone does not."""
    rng, dt = np.random.default_rng(11), 0.005
    t = dt * np.arange(2400)
    q = 0.9 * np.sin(2.0 * np.pi * 0.5 * t) + 0.1 * np.sin(2.0 * np.pi * 1.3 * t)
    v, a = np.gradient(q, dt), np.gradient(np.gradient(q, dt), dt)
    for inertia, identified in ((0.15, False), (3.0, True)):
        u = inertia * a + 5.0 * q * (not identified) + 2.0 * np.sign(v) * (not identified)
        u += 0.02 * rng.standard_normal(t.size)
        (tmp_path / "a.csv").write_text(csv_text({"t": t, "u": u, "q": q}))
        said = done("init", "a.csv", "--force", cwd=tmp_path).stderr
        checked = done("check", "a.csv", cwd=tmp_path).stdout
        known = re.search(r"^inertia +(weakly )?identifiable", checked, re.MULTILINE) is not None
        line = next(one for one in said.splitlines() if "nominal_inertia" in one)
        assert ("identified from this log" in line) is known, (line, checked)
        assert known is identified, checked


def test_a_column_that_has_a_number_as_its_name_is_in_quotes(tmp_path: Path) -> None:
    dt = 0.001
    t = dt * np.arange(3000)
    q = np.sin(2.0 * np.pi * 2.0 * t) + 0.3 * np.sin(2.0 * np.pi * 3.1 * t)
    u = 0.02 * np.gradient(np.gradient(q, dt), dt) + 0.3 * np.gradient(q, dt)
    np.savetxt(tmp_path / "a.dat", np.column_stack([1e6 * t, u, np.rint(1e6 * q)]), "%.6g")
    said = done("init", "a.dat", "--force", "--u", 2, cwd=tmp_path).stderr
    assert 'explain "2"' in said
