"""Text with its signals in its rows is read as the same text with them in columns."""

import gzip

import numpy as np
import pytest

from dsd_cli.files.sample import sample
from dsd_cli.files.tables_in import open_table

ROWS = {"Time": "s", "Torque": "Nm", "Angle": "rad"}


def channels(samples):
    t = np.arange(samples) * 0.01
    return dict(zip(ROWS, (t, np.sin(t + 0.5), t**2), strict=True))


def text(found, saying, by=",", comma=False, count=False):
    cells = {name: [f"{x:.6f}".replace(".", "," if comma else ".") for x in values] for name, values in found.items()}
    begin = [[name, ROWS[name]][:saying] for name in found]
    lines = [by.join([*one, *row]) for one, row in zip(begin, cells.values(), strict=True)]
    above = by.join([*["Signal", "Unit"][:saying], *map(str, range(len(found["Time"])))])
    return "\n".join([above, *lines] if count else lines) + "\n"


@pytest.mark.parametrize(
    ("saying", "how"),
    [(1, {}), (2, {}), (2, {"count": True}), (1, {"by": ";", "comma": True}), (2, {"by": "\t"}), (0, {"by": " "})],
)
@pytest.mark.parametrize("samples", [100, 12000])
def test_names_units_and_samples(saying, how, samples, tmp_path):
    found = channels(samples)
    (tmp_path / "log.csv").write_text(text(found, saying, **how), encoding="utf-8")
    names = list(ROWS) if saying else ["1", "2", "3"]
    table = open_table(tmp_path / "log.csv", dict(zip(("t", "u", "position"), names, strict=True)))
    parts = [batch.columns for batch in table.batches()]
    for name, x in zip(("t", "u", "position"), found.values(), strict=True):
        np.testing.assert_allclose(np.concatenate([one[name] for one in parts]), x, atol=5.1e-7)
    assert any("stand in its rows" in one for one in table.warnings)
    (looked,) = sample(str(tmp_path / "log.csv")).tables
    assert [one.unit for one in looked.channels] == (list(ROWS.values()) if saying == 2 else [""] * 3)


@pytest.mark.parametrize("title", ["Axis 3 test run, 2024-05-01\n", "Recorder 7\n\nRun;12\n"])
@pytest.mark.parametrize("packed", [False, True])
def test_a_title_above_them_and_a_packed_file(title, packed, tmp_path):
    """Of a title above its 3 rows a header was made, of 3,001 columns that no command could use."""
    found = channels(400)
    content = (title + text(found, 1)).encode()
    name = "log.csv.gz" if packed else "log.csv"
    (tmp_path / name).write_bytes(gzip.compress(content) if packed else content)
    table = open_table(tmp_path / name, {"t": "Time", "u": "Torque", "position": "Angle"})
    parts = [batch.columns["position"] for batch in table.batches()]
    np.testing.assert_allclose(np.concatenate(parts), found["Angle"], atol=5.1e-7)
    assert any("stand in its rows" in one for one in table.warnings)


def test_a_signal_that_counts_is_one(tmp_path):
    u = ",".join(f"{x:.4f}" for x in np.sin(np.arange(300) * 0.1))
    count = ",".join(map(str, range(300)))
    (tmp_path / "log.csv").write_text(f"position,{count}\nu,{u}\n", encoding="utf-8")
    (batch,) = open_table(tmp_path / "log.csv", {"u": "u", "position": "position"}).batches()
    np.testing.assert_array_equal(batch.columns["position"], np.arange(300))


@pytest.mark.parametrize("rows", [70, 200])
def test_a_wide_table_of_many_samples_is_none(rows, tmp_path):
    lines = [",".join(f"{100 * row + (37 * k) % 83}" for k in range(83)) for row in range(rows)]
    (tmp_path / "log.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    table = open_table(tmp_path / "log.csv", {"u": "2"})
    assert sum(batch.rows for batch in table.batches()) == rows
    assert not any("stand in its rows" in one for one in table.warnings)
