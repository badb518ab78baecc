"""Tables with a row for each value, and tables that look a little like one and are none."""

import json

import numpy as np
import pyarrow as pa
import pytest

from dsd_cli.files.formats.long_form import LongFile, form_of
from dsd_cli.files.tables_in import open_table

T, ROWS = np.arange(200) * 0.01, 200
U, Q = np.sin(3.0 * T), np.cos(T)
PAIR = (("u", U), ("q", Q))


def form(**columns):
    return form_of({name: pa.array(values) for name, values in columns.items()})


def test_names_one_after_the_other_and_in_turns():
    blocks = form(time=np.tile(T, 2), name=["u"] * ROWS + ["q"] * ROWS, value=np.concatenate([U, Q]))
    turns = form(time=np.repeat(T, 2), name=["u", "q"] * ROWS, value=np.ravel([U, Q], order="F"))
    own = form(time=np.sort([*T, *(T + 0.003)]), name=["u", "q"] * ROWS, value=np.ravel([U, Q], order="F"))
    assert blocks == turns == own == ("time", ("name",), ("value",))
    joints = form(t=np.repeat(T, 2), id=np.tile([3, 7], ROWS), a=np.repeat(U, 2), b=np.repeat(Q, 2))
    assert joints == ("t", ("id",), ("a", "b"))
    frames = form(t=np.sort([*T, *(T + 0.003)]), id=np.tile([513, 385], ROWS),
                  a=np.ravel([Q, U], order="F"), b=np.ravel([U, 24.0 + 0.1 * Q], order="F"))  # fmt: skip
    assert frames == ("t", ("id",), ("a", "b"))


def test_states_trials_counters_and_remarks_are_no_names():
    assert form(t=T, u=U, q=Q, mode=["rest"] * 100 + ["run"] * 100) is None
    assert form(t=np.tile(T, 2), u=np.tile(U, 2), q=np.tile(Q, 2), trial=["a"] * ROWS + ["b"] * ROWS) is None
    assert form(t=T, u=U, q=Q, toggle=np.arange(ROWS) % 2, packet=np.arange(ROWS) % 8) is None
    assert form(t=T, u=U, q=Q, remark=[f"row {k}" for k in range(ROWS)]) is None
    assert form(t=T, u=U, remark=["started", *[""] * (ROWS - 1)]) is None
    assert form(t=T, u=U, q=Q) is None
    assert form(sec=np.arange(ROWS) // 10, nsec=np.tile(np.arange(10) * 10**8, 20), u=U, q=Q) is None


@pytest.mark.parametrize("missing", [False, True])
def test_the_values_of_one_stamp_are_one_row(tmp_path, missing):
    """In whatever order they come; blank where a stamp has no value of a name."""
    rows = [f"{t!r},{name},{x!r}" for t, u, q in zip(T.tolist(), U.tolist(), Q.tolist(), strict=True)
            for name, x in (("iq", u), ("enc", q))]  # fmt: skip
    rows = rows[:60] + rows[61:] if missing else sorted(rows, key=lambda row: row.split(",")[1])
    (tmp_path / "log.csv").write_text("\n".join(["time,name,value", *rows]) + "\n")
    table = open_table(tmp_path / "log.csv", {"t": "time", "u": "iq", "position": "enc"})
    (batch,) = table.batches()
    u = U.copy()
    u[30] = np.nan if missing else u[30]
    for name, expected in (("t", T), ("u", u), ("position", Q)):
        np.testing.assert_array_equal(batch.columns[name], expected)
    assert table.warnings == ["it has a row for each value, named by name"]


def test_newest_first_and_a_column_of_units(tmp_path):
    rows = [f"{t!r},{name},{unit},{x!r}" for t, u, q in zip(T.tolist(), U.tolist(), Q.tolist(), strict=True)
            for name, unit, x in (("iq", "A", u), ("enc", "deg", q))]  # fmt: skip
    (tmp_path / "log.csv").write_text("\n".join(["time,name,unit,value", *reversed(rows)]) + "\n")
    file = LongFile(str(tmp_path / "log.csv"))
    (group,) = file.groups
    assert group.units == {"time": "", "enc": "deg", "iq": "A"}
    np.testing.assert_array_equal(file.read(group, ["time", "iq"], 0, ROWS)["iq"], U)


def test_records_of_json_and_their_stamps_in_words(tmp_path):
    """2025-03-01T09:00:00Z is 1740819600 s; a number in quotes is one."""
    rows = [
        {"ts": f"2025-03-01T09:00:{k / 100:09.6f}Z", "name": name, "value": repr(x[k])}
        for k in range(ROWS)
        for name, x in (("iq", U.tolist()), ("enc", Q.tolist()))
    ]
    (tmp_path / "log.jsonl").write_text("\n".join(map(json.dumps, rows)) + "\n")
    (batch,) = open_table(tmp_path / "log.jsonl", {"t": "ts", "u": "iq", "position": "enc"}).batches()
    np.testing.assert_allclose(batch.columns["t"], 1740819600.0 + T, rtol=0, atol=1e-6)
    np.testing.assert_array_equal(batch.columns["u"], U)
    np.testing.assert_array_equal(batch.columns["position"], Q)


def test_names_in_the_letters_of_windows(tmp_path):
    lines = ["Zeit;Größe;Wert"]
    for t, u, q in zip(T.tolist(), U.tolist(), Q.tolist(), strict=True):
        lines += [f"{t!r};Störmoment;{u!r}", f"{t!r};Weg;{q!r}"]
    (tmp_path / "log.csv").write_bytes("\n".join(lines).encode("latin-1"))
    (batch,) = open_table(tmp_path / "log.csv", {"t": "Zeit", "u": "Störmoment", "position": "Weg"}).batches()
    np.testing.assert_array_equal(batch.columns["u"], U)


def test_numbers_that_are_written_in_two_ways_are_no_names():
    currents = [f"{u:.1f} A" if u > 0.5 else f"{1e3 * u:.0f} mA" for u in np.round(2.0 * U) / 2.0]
    assert form(t=T, current=currents, q=Q) is None


@pytest.mark.parametrize("days", ["{:.6f}", "{:.0f}"])
def test_values_and_stamps_that_are_texts_and_stamps_beside_stamps(tmp_path, days):
    """As a panel of Siemens archives them: dates, and millionths of days that it calls ms."""
    cell = '"{}"\t"01.02.2024 10:00:{:06.3f}"\t{:.6f}\t1\t{}'
    rows = [cell.format(name, t, x[k], days.format(45e9 + t / 0.0864)) for k, t in enumerate(T) for name, x in PAIR]
    text = "VarName\tTimeString\tVarValue\tValidity\tTime_ms\n" + "\n".join(rows).replace(".", ",")
    (tmp_path / "log.csv").write_text(text.replace("01,02,2024", "01.02.2024"), encoding="utf-16")
    (batch,) = open_table(tmp_path / "log.csv", {"t": "TimeString", "u": "u", "position": "q"}).batches()
    np.testing.assert_allclose(batch.columns["t"] - batch.columns["t"][0], T, atol=1e-6)
    np.testing.assert_allclose(batch.columns["u"], U, atol=1e-6)
    np.testing.assert_allclose(batch.columns["position"], Q, atol=1e-6)
