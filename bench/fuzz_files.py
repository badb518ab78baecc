"""What `bench fuzz --files` runs: files of every kind, as their libraries and tools write them, a few bytes spoiled."""

from __future__ import annotations

import bz2
import gzip
import io
import lzma
import random
import shutil
import warnings
import zipfile
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

from bench.fuzz_cases import CONFIG, spoil
from tests.files import drives, strangers
from tests.files.formats import makers

#: Rows of a file; a longer one is only slower to read.
ROWS = 600
#: Share of the texts that are packed, or written in UTF-16, and of these that are spoiled before and not after.
PACKED = 0.4
KINDS = tuple(
    name
    for name in dir(makers)
    if not name.startswith("_") and getattr(getattr(makers, name), "__annotations__", {}).get("return") is makers.Made
)


def _zipped(content: bytes) -> bytes:
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("log.csv", content)
    return packed.getvalue()


def _wide(content: bytes, encoding: str) -> bytes:
    return content.decode("utf-8", "replace").encode(encoding)


PACKERS: tuple[Callable[[bytes], bytes], ...] = (
    gzip.compress,
    bz2.compress,
    lzma.compress,
    _zipped,
    partial(_wide, encoding="utf-16"),
    partial(_wide, encoding="utf-16-be"),
)


def made(folder: Path) -> list[Path]:
    """One file of every kind whose library is installed, each in a folder of its own."""
    data, axis, found = makers.channels(ROWS), strangers.axis(), []
    jobs: dict[str, Callable[[Path], Path]] = {
        kind: lambda here, kind=kind: getattr(makers, kind)(here, data).path
        for kind in KINDS  # type: ignore[misc]
    }
    others = (*strangers.MADE.items(), *drives.MADE.items())
    jobs |= {name: lambda here, make=make: make(here, axis) for name, (make, *_) in others}  # type: ignore[misc]
    for name, job in jobs.items():
        here = folder / name
        here.mkdir()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                found.append(job(here))
            except (ImportError, pytest.skip.Exception):  # its library is not installed
                continue
    return found


def case(number: int, folder: Path, files: list[Path]) -> list[str]:
    """The arguments of a run; a spoiled copy of one of the files and a config are put into the folder."""
    rng = random.Random(number)
    source = rng.choice(files)
    (folder / "dsd.toml").write_text(CONFIG, encoding="utf-8")
    target = folder / source.name
    if source.is_dir():
        shutil.copytree(source, target)
        victim = rng.choice([path for path in target.rglob("*") if path.is_file()])
    else:
        victim = Path(shutil.copy(source, target))
    content = victim.read_bytes()
    if rng.random() < PACKED and b"\0" not in content:
        content = rng.choice(PACKERS)(spoil(rng, content) if rng.random() < PACKED else content)
    victim.write_bytes(spoil(rng, content) if rng.random() < 1.0 - PACKED else content)
    to = rng.choice((["-o", "out.toml"], ["-o", "-"]))
    return rng.choice((["init", target.name, *to], ["columns", target.name], ["detect", target.name]))
