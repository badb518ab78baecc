"""Both wheels, of this machine and for any machine: installed by themselves, they are the same `dsd`."""

import os
import shutil
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import pytest

from tests.cli.rig import done, read_labels, same

ROOT = Path(__file__).parents[2]


def run(*command: object, cwd: Path, **environment: str) -> str:
    environment = {**os.environ, "PYTHONPATH": "", **environment}
    ran = subprocess.run([*map(str, command)], cwd=cwd, env=environment, capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stderr
    return ran.stdout


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What a clone has: no library that was compiled in place."""
    assert int(version("setuptools").partition(".")[0]) >= 77, (
        "an older environment: make setup brings what [dev] names"
    )
    here = tmp_path_factory.mktemp("wheels") / "source"
    left = shutil.ignore_patterns("*.so", "__pycache__")
    shutil.copytree(ROOT / "dsd_cli", here / "dsd_cli", ignore=left)
    for name in ("pyproject.toml", "setup.py", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, here)
    return here


@pytest.mark.parametrize(
    ("pure", "tag", "kernel"), [("0", "cp311-abi3-linux", "compiled"), ("1", "py3-none-any", "numpy")]
)
def test_a_wheel_that_is_installed_by_itself_runs(source: Path, pure: str, tag: str, kernel: str) -> None:
    if pure == "0" and not (shutil.which("cc") and sys.platform == "linux"):
        pytest.skip("no C compiler")
    made, away = source.parent / f"dist-{pure}", source.parent / f"venv-{pure}"
    pip = (sys.executable, "-m", "pip", "-q", "--disable-pip-version-check")
    slow = {"DSD_PURE": pure, "CFLAGS": "-O0"}  # it only has to run
    run(*pip, "wheel", ".", "--no-deps", "--no-build-isolation", "-w", made, cwd=source, **slow)
    (wheel,) = made.glob("*.whl")
    assert tag in wheel.name
    run(sys.executable, "-m", "venv", "--without-pip", away, cwd=source.parent)
    run(*pip, "--python", away / "bin/python", "install", "--no-deps", "--no-index", wheel, cwd=source.parent)
    (site,) = away.glob("lib/python*/site-packages")
    here = [path for path in sys.path if path.endswith("site-packages")]
    (site / "needed.pth").write_text("\n".join(here) + "\n")  # NumPy, Arrow, ... as pip would bring them
    dsd = away / "bin/dsd"
    where = run(away / "bin/python", "-c", "import dsd_cli; print(dsd_cli.__file__)", cwd=source.parent)
    assert Path(where.strip()).is_relative_to(site)
    assert kernel in run(dsd, "--version", cwd=source.parent)
    sample = ROOT / "sample_logs/paper-step"
    log = (f"{sample}.csv", "-c", f"{sample}.toml", "-q")
    run(dsd, "detect", *log, "-o", "labels.csv", cwd=source.parent)
    done("detect", *log, "-o", "here.csv", cwd=source.parent)
    same(read_labels(source.parent / "labels.csv"), read_labels(source.parent / "here.csv"))
