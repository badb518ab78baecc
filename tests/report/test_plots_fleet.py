"""The picture of a fleet, as numbers: the points of every log, what stands out, and where they lie."""

from datetime import date

import numpy as np
import pytest

from dsd_cli.report.figure import rendered
from dsd_cli.report.fleet import summarize
from dsd_cli.report.plots_fleet import columns_shown, draw, values_of
from tests.report.test_fleet_summary import table

LEVEL = "value.coulomb_friction.level"


def odd_one() -> list[dict]:
    rows = table(3, drift=0.4)
    rows[17] = {**rows[17], "value.inertia": 0.013}
    rows[40] = {**rows[40], "status": "failed", "reason": "bad", LEVEL: None}
    return rows


def test_what_drifts_comes_first_then_what_stands_out() -> None:
    rows = odd_one()
    assert columns_shown(summarize("r", rows), rows) == [LEVEL, "value.inertia", "force_rmse"]
    same = [{**row, "force_rmse": 0.02} for row in rows]
    assert "force_rmse" not in columns_shown(summarize("r", same), same)  # one line says nothing


def test_every_log_with_a_result_is_a_point_at_its_date() -> None:
    rows = odd_one()
    values = values_of("value.inertia", summarize("r", rows), rows)
    good = [row for row in rows if row["status"] == "done"]
    assert values.log == tuple(row["log"] for row in good)
    assert values.value.tolist() == [row["value.inertia"] for row in good]
    assert [log for log, odd in zip(values.log, values.odd, strict=True) if odd] == [rows[17]["log"]]
    epoch = date(1970, 1, 1)
    assert values.at.tolist() == [(date.fromisoformat(row["date"]) - epoch).days for row in good]


def test_logs_without_a_date_are_numbered() -> None:
    rows = odd_one()
    rows[5] = {**rows[5], "date": ""}
    values = values_of(LEVEL, summarize("r", rows), rows)
    assert values.at.tolist() == list(range(1, 300))


@pytest.mark.parametrize("rows", [odd_one(), odd_one()[:1], [{**odd_one()[40], "status": "failed"}] * 2])
def test_it_draws_whatever_there_is(rows: list[dict]) -> None:
    found = summarize("r", rows)
    figure = draw(found, rows)
    axes = [axis for axis in figure.get_axes() if axis.axison]
    assert len(axes) == 1 + len(columns_shown(found, rows))
    assert rendered(lambda: figure, ".png").startswith(b"\x89PNG")
    drawn = sum(len(line.get_xdata()) for axis in axes[1:2] for line in axis.lines if line.get_linestyle() == "None")
    assert drawn == (np.isfinite([row[LEVEL] or np.nan for row in rows]).sum() if len(axes) > 1 else 0)
