"""Stamps in two columns, seconds and parts of one: read as one time, to the resolution of a float."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from dsd_cli.files.sample import sample
from dsd_cli.files.tables_in import open_table

ROWS, STEP = 600, 4_000_000
START = 1_764_060_000_990_000_000


def table(start: int, header: str, per_part: int = 1) -> str:
    stamps = [start + STEP * k for k in range(ROWS)]
    return header + "".join(f"{at // 10**9},{at % 10**9 // per_part},,elbow,{k % 7}\n" for k, at in enumerate(stamps))


@pytest.mark.parametrize(
    ("text", "name", "start"),
    [
        (table(START, ""), "1+2", START),
        (table(START, "sec,nanosec,frame_id,name,q\n"), "sec+nanosec", START),
        (table(0, "header.stamp.secs,header.stamp.nsecs,f,n,q\n"), "header.stamp.secs+header.stamp.nsecs", 0),
        (table(0, "tv_sec,tv_usec,f,n,q\n", 1000), "tv_sec+tv_usec", 0),
        (re.sub(r",(\d+),,", lambda of: f",{int(of[1]):g},,", table(0, "sec,nsec,f,n,q\n")), "sec+nsec", 0),
    ],
)
def test_both_columns_are_one_time(text: str, name: str, start: int, tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text(text)
    (batch,) = open_table(path, {"t": name, "position": "5" if name == "1+2" else "q"}).batches()
    assert np.allclose(batch.columns["t"] - start / 1e9, STEP / 1e9 * np.arange(ROWS), rtol=0.0, atol=1e-6)
    assert np.array_equal(batch.columns["position"], np.arange(ROWS) % 7)
    names = [channel.name for one in sample(str(path)).tables for channel in one.channels]
    assert name in names
    assert not set(name.split("+")) & set(names)  # alone each of them is no time


@pytest.mark.parametrize("header", ["sec,ns,f,n,q\n", "stamp_s,stamp_ns,f,n,q\n"])
def test_both_together_are_in_seconds(header: str, tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text(table(START, header))
    units = {one.name: one.unit for looked in sample(str(tmp_path / "log.csv")).tables for one in looked.channels}
    assert units["+".join(header.split(",")[:2])] == "s"


@pytest.mark.parametrize(
    "header", ["sec,temp,f,n,q\n", "a.sec,b.nsec,f,n,q\n", "count,flags,f,n,q\n"], ids=["none", "of two", "counts"]
)
def test_what_does_not_belong_together_stays_apart(header: str, tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text(table(0, header))
    (looked,) = sample(str(tmp_path / "log.csv")).tables
    assert not [one.name for one in looked.channels if "+" in one.name]
