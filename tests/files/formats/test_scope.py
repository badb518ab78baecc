"""Text whose channels have stamps of their own, a column of time beside each: every value stays with its stamp."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from dsd_cli.files.formats.known import SCOPE, format_of
from dsd_cli.files.sample import sample
from dsd_cli.files.tables_in import open_table

#: torque each ms, position each 2 ms: at stamp s it is 0.5 s, in whichever row that stands.
FAST, SLOW = 4000, 2000
PREAMBLE = "Name\tTorque\tName\tPosition\nUnit\tNm\tUnit\tmm\nSampleTime[ms]\t1\tSampleTime[ms]\t2\n\n"


def scope(folder: Path, head: str, by: str = "\t", ragged: bool = True) -> Path:
    rows = []
    for k in range(FAST):
        cells = [str(k), f"{0.1 * (k % 7):.1f}"] + ([str(2 * k), f"{k}.0"] if k < SLOW else [] if ragged else ["", ""])
        rows.append(by.join(cells))
    (folder / "scope.csv").write_text(head + "\n".join(rows) + "\n")
    return folder / "scope.csv"


@pytest.mark.parametrize("ragged", [True, False])
@pytest.mark.parametrize(
    ("head", "by"),
    [
        (PREAMBLE, "\t"),
        ("time,Torque,time,Position\n", ","),
        ("t_1;Torque;t_2;Position\n", ";"),
        ("X\tTorque\tX\tPosition\tComment\n", "\t"),
    ],
)
def test_every_value_stays_with_its_stamp(head: str, by: str, ragged: bool, tmp_path: Path) -> None:
    path = scope(tmp_path, head, by, ragged)
    columns = {"t": "time", "position": "Position/value"}
    (batch,) = open_table(path, columns).batches()
    assert np.array_equal(batch.columns["t"], 2.0 * np.arange(SLOW))
    assert np.array_equal(batch.columns["position"], 0.5 * batch.columns["t"])


def test_units_of_the_preamble_stay_with_their_channel(tmp_path: Path) -> None:
    looked = sample(str(scope(tmp_path, PREAMBLE)))
    units = {one.name: one.unit for table in looked.tables for one in table.channels}
    assert (units["Torque/value"], units["Position/value"]) == ("Nm", "mm")


@pytest.mark.parametrize(
    "text",
    [
        "time,u,time,q\n" + "".join(f"{k},{k % 5},{k},{k % 3}\n" for k in range(50)),
        "t,u,q,v\n" + "".join(f"{k},{k % 5},{k + 1},{k % 3}\n" for k in range(50)),
        "q1,tau1,q2,tau2\n" + "".join(f"{k},{k % 5},{2 * k},{k % 3}\n" for k in range(50)),
        "ch1,a1,ch2,a2\n" + "".join(f"{k % 9},{k % 5},{k % 7},{k % 3}\n" for k in range(50)),
    ],
    ids=["the same stamps twice", "no pairs", "two joints", "what swings"],
)
def test_a_table_of_one_clock_is_none(text: str, tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text(text)
    assert format_of(tmp_path / "log.csv", text.encode()[:4096]) is not SCOPE
