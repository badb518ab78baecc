"""Two commands that change one config at the same time: none of the two is lost without a word."""

import shutil
import subprocess
import tomllib
from pathlib import Path

import pytest

from dsd_cli.errors import DataError
from dsd_cli.files.config.edit import read_origin, write_text
from tests.cli.rig import DSD

SAMPLES = Path(__file__).parents[2] / "sample_logs"


def test_two_at_once(tmp_path):
    shutil.copy(SAMPLES / "servo-bare.toml", tmp_path / "dsd.toml")
    both = [
        subprocess.Popen([*DSD, "add", SAMPLES / "servo-friction.csv", effect, "-o", "dsd.toml", "--quiet"],
                         cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        for effect in ("coulomb_friction", "viscous_friction")
    ]  # fmt: skip
    said = [process.communicate(timeout=300)[1] for process in both]
    codes = [process.returncode for process in both]
    steps = tomllib.loads((tmp_path / "dsd.toml").read_text()).get("history", [])
    assert len(steps) == codes.count(0) >= 1
    for code, text in zip(codes, said, strict=True):
        assert code in (0, 1)
        assert not code or "was changed by somebody else meanwhile" in text


def test_a_change_meanwhile_is_noticed(tmp_path):
    path = tmp_path / "dsd.toml"
    path.write_text("a = 1\n")
    (tmp_path / "link.toml").symlink_to(path)
    origin = read_origin(path)
    path.write_text("a = 2\n")
    for name in ("dsd.toml", "link.toml"):
        with pytest.raises(DataError, match="changed by somebody else"):
            write_text(str(tmp_path / name), "a = 3\n", origin)
    assert path.read_text() == "a = 2\n"
    write_text(str(tmp_path / "other.toml"), "a = 3\n", origin)
    write_text(str(path), "a = 4\n", read_origin(path))
    assert path.read_text() == "a = 4\n"
