"""Columns with blank cells in between: what is linear in time is met exactly wherever it is asked for."""

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from dsd_cli.errors import DataError
from dsd_cli.files.tables_in import open_table

NAMES = {"t": "t", "u": "u", "position": "q"}


def merged(folder, *topics):
    """The file of topics {"t": stamps, name: values, ...}, in the order of their stamps."""
    names = list(dict.fromkeys(name for topic in topics for name in topic))
    rows = [{name: float(topic[name][k]) for name in topic} for topic in topics for k in range(len(topic["t"]))]
    rows.sort(key=lambda row: row["t"])
    pq.write_table(pa.table({name: [row.get(name) for row in rows] for name in names}), folder / "log.parquet")
    return folder / "log.parquet"


def read(path):
    table = open_table(path, NAMES)
    parts = [batch.columns for batch in table.batches()]
    return {name: np.concatenate([part[name] for part in parts]) for name in NAMES}, table.warnings


def test_topics_that_share_no_row_are_joined_at_the_stamps_of_u(tmp_path):
    t = np.arange(400) * 0.01
    log, notes = read(merged(tmp_path, {"t": t, "q": 3.0 * t}, {"t": t + 0.004, "u": np.sin(t)}))
    np.testing.assert_array_equal(log["t"], t + 0.004)
    np.testing.assert_array_equal(log["u"], np.sin(t))
    np.testing.assert_allclose(log["position"][:-1], 3.0 * (t[:-1] + 0.004), atol=1e-12)
    assert np.isnan(log["position"][-1])
    assert notes == ["q (sampled as often) joined to the stamps of u: position interpolated"]


def test_a_faster_u_is_averaged_though_each_position_has_a_u_in_its_row(tmp_path):
    """As an outer join of tables leaves it: to drop the rows without a position would sample the ripple."""
    fast = np.arange(1000)
    ripple = np.array([4.0, 0.0, 0.0, -4.0])
    topics = ({"t": fast * 0.25, "u": fast // 4 + ripple[fast % 4]}, {"t": fast[:250] * 1.0, "q": fast[:250] * 2.0})
    path = tmp_path / "log.parquet"
    u, q = topics[0]["u"], np.repeat(np.nan, 1000)
    q[::4] = topics[1]["q"]
    pq.write_table(pa.table({"t": topics[0]["t"], "u": u, "q": q}), path)
    log, _ = read(path)
    np.testing.assert_array_equal(log["position"], topics[1]["q"])
    np.testing.assert_allclose(log["u"][:-1], np.arange(249.0), atol=1e-9)


def test_each_recording_in_a_file_is_joined_by_itself(tmp_path):
    t = np.arange(100) * 0.01
    path = merged(tmp_path, {"t": t, "q": t}, {"t": t + 0.004, "u": t})
    one = pq.read_table(path)
    pq.write_table(pa.concat_tables([one, one]), path)
    log, _ = read(path)
    np.testing.assert_array_equal(log["t"], np.tile(t + 0.004, 2))
    np.testing.assert_allclose(log["position"][:99], log["position"][100:199])


def test_topics_of_different_hours_are_refused(tmp_path):
    t = np.arange(100) * 0.01
    with pytest.raises(DataError, match="do not overlap"):
        read(merged(tmp_path, {"t": t, "q": t}, {"t": t + 3600.0, "u": t}))


def test_a_row_here_and_there_without_a_value_stays_a_row_without_one(tmp_path):
    t = np.arange(100.0)
    u = np.where(np.arange(100) % 3 == 0, np.nan, t)
    pq.write_table(pa.table({"t": t, "u": u, "q": t}), tmp_path / "log.parquet")
    log, notes = read(tmp_path / "log.parquet")
    np.testing.assert_array_equal(log["u"], u)
    assert notes == []


def test_columns_below_one_another_are_one_recording(tmp_path):
    """As frames are that nobody sorted, in a file of more than one batch."""
    t = np.arange(90_000) * 0.001
    table = pa.concat_tables(
        [pa.table({"t": t, "u": 2.0 * t}), pa.table({"t": t + 4e-4, "q": t})], promote_options="default"
    )
    pq.write_table(table, tmp_path / "log.parquet")
    log, _ = read(tmp_path / "log.parquet")
    np.testing.assert_array_equal(log["t"], t)
    np.testing.assert_array_equal(log["u"], 2.0 * t)
    np.testing.assert_allclose(log["position"][1:], t[1:] - 4e-4, atol=1e-12)


def test_a_column_that_begins_late_is_joined_as_any_other(tmp_path):
    t = np.arange(90_000) * 0.001
    late = {"t": t[80_000:] + 4e-4, "q": 3.0 * t[80_000:]}
    table = pa.concat_tables([pa.table({"t": t, "u": t}), pa.table(late)], promote_options="default").sort_by("t")
    pq.write_table(table, tmp_path / "log.parquet")
    log, _ = read(tmp_path / "log.parquet")
    there = np.isfinite(log["position"])
    np.testing.assert_allclose(log["position"][there], 3.0 * (log["t"][there] - 4e-4), atol=1e-9)
    assert 9_900 < there.sum() <= 10_000


def test_a_recording_that_lacks_a_channel_is_said_to_be_left_out(tmp_path):
    t = np.arange(100) * 0.01
    whole = pq.read_table(merged(tmp_path, {"t": t, "q": t}, {"t": t + 0.004, "u": t}))
    pq.write_table(
        pa.concat_tables([whole, pa.table({"t": t, "q": t})], promote_options="default"), tmp_path / "log.parquet"
    )
    log, notes = read(tmp_path / "log.parquet")
    assert log["t"].size == 100
    assert notes[-1] == "1 of 2 recordings in it lack a channel and are left out"
