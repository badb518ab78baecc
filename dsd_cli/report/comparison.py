"""The result of `dsd compare`, and the same as JSON."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from dsd_cli.identify.compare.balance import Force
from dsd_cli.identify.compare.comparison import Comparison
from dsd_cli.identify.compare.forward import Forward
from dsd_cli.identify.compare.regimes import Where
from dsd_cli.identify.compare.residuals import LARGE
from dsd_cli.report.conclusions import conclusion, simulation_conclusion
from dsd_cli.report.head import head
from dsd_cli.report.names import balance_json
from dsd_cli.signals.units import Units


@dataclass(frozen=True)
class Report:
    """A comparison (or a simulation, then `holdout` is one too) and the check that the user asked for."""

    result: Comparison | Forward
    holdout: Forward | None = None
    dropped: Mapping[str, int] = field(default_factory=dict)
    max_rmse: float | None = None

    @property
    def judged_rmse(self) -> float:
        """The rmse that a check goes by: of the holdout if there is one."""
        if isinstance(self.result, Comparison):
            aside = self.result.holdout
            return (self.result.accuracy if aside is None else aside.accuracy).rmse
        return (self.holdout or self.result).main[1].rmse

    @property
    def judged_log(self) -> str:
        """Its name."""
        if isinstance(self.result, Comparison) and self.result.holdout is not None:
            return self.result.holdout.log
        return ", ".join((self.holdout or self.result).logs)

    @property
    def holds(self) -> bool:
        """Whether the check holds; True without one."""
        return self.max_rmse is None or self.judged_rmse <= self.max_rmse


def to_json(report: Report) -> dict[str, Any]:
    """The object of the contract."""
    result = report.result
    out: dict[str, Any] = head("compare", result.logs)
    out |= _prediction(result) if isinstance(result, Comparison) else _simulation(result, report.holdout)
    if report.max_rmse is not None:
        out["check"] = {"max_rmse": report.max_rmse, "rmse": report.judged_rmse, "holds": report.holds}
    out["dropped"] = [{"reason": reason, "count": count} for reason, count in report.dropped.items()]
    return out


def _prediction(result: Comparison) -> dict[str, Any]:
    aside = result.holdout
    return {
        "horizon": "prediction",
        "split": "all",
        "force": _force(result.force.log, result.units),
        "no_force": result.force.missing or None,
        **asdict(result.accuracy),
        "skipped_samples": result.skipped,
        "skipped_seconds": result.lead,
        "sample_time": result.sample_time,
        "by_log": [
            {"log": one.log, **asdict(one.accuracy), "force_rmse": result.force.by_log.get(one.log)}
            for one in result.by_log
        ],
        "holdout": None
        if aside is None
        else {
            "split": "holdout",
            "log": aside.log,
            "force": _force(result.force.holdout, result.units),
            **asdict(aside.accuracy),
        },
        "residual": asdict(result.residual)
        | {"large_share": LARGE, "remembers": result.residual.remembers, "follows_u": result.residual.follows_u},
        "where_of": result.where_of,
        **_where(result.where),
        "dependence": [{"on": d.on, "explains": d.explains} for d in result.dependence],
        "conclusion": result.conclusion,
        "conclusion_text": conclusion(result),
        "channels": dict(result.provenance),
        "missing": dict(result.missing),
    }


def _force(force: Force | None, units: Units) -> dict[str, Any] | None:
    return None if force is None else asdict(force) | balance_json(force.band_hz, force.floor, units)


def _where(where: Where) -> dict[str, Any]:
    def bins(rows: Any) -> list[dict[str, Any]]:
        return [{key: value for key, value in asdict(row).items() if key != "log" or value} for row in rows]

    return {
        "where": [asdict(regime) for regime in where.regimes],
        "where_time": bins(where.time),
        "where_velocity": bins(where.velocity),
        "where_position": bins(where.position),
        "where_frequency": bins(where.frequency),
    }


def _simulation(result: Forward, holdout: Forward | None) -> dict[str, Any]:
    return {
        "horizon": "simulation",
        "horizon_seconds": result.horizon if math.isfinite(result.horizon) else None,
        "restarts": result.restarts,
        "split": "all",
        **_forward(result),
        "relative_error_percent": None,
        "residual": None,
        "where": [],
        "dependence": [],
        "holdout": None if holdout is None else {"split": "holdout", "log": holdout.logs[0], **_forward(holdout)},
        "conclusion_text": simulation_conclusion(result),
    }


def _forward(result: Forward) -> dict[str, Any]:
    loop, main = result.main
    figures = asdict(main)
    return {
        "samples": result.samples,
        "rmse_of": f"{figures.pop('channel')}, {loop}",
        **figures,
        "open_loop": [asdict(one) for one in result.open_loop],
        "closed_loop": [asdict(one) for one in result.closed_loop] or None,
        "no_closed_loop": result.not_closed or None,
        "channels": dict(result.provenance),
    }
