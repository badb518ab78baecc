"""Where a law that is a table is used beyond its knots: it is held there, and nobody has seen what it does."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from dsd_cli.effects import get_effect
from dsd_cli.effects.tables import Table
from dsd_cli.plant.model import PlantModel
from dsd_cli.signals.log import Log

#: Share of the samples from which on it is said.
_WORTH_SAYING = 0.001


def held_beyond(model: PlantModel, logs: Iterable[Log]) -> list[str]:
    """One line for each table of the model and channel that a log takes beyond the table's ends."""
    logs = list(logs)
    lines = []
    for name, values in model.effects.items():
        table = get_effect(name).to_columns(values)[1].get("table")
        if not isinstance(table, Table):
            continue
        for channel, knots in zip(table.channels, table.knots, strict=True):
            share = max(_shares(table, channel, logs), default=0.0)
            if share > _WORTH_SAYING:
                known = f"{name} is known for {channel} from {knots[0]:.4g} to {knots[-1]:.4g}"
                lines.append(f"{known}; {100.0 * share:.1f} % of the samples lie beyond, where its ends are held")
    return lines


def _shares(table: Table, channel: str, logs: Iterable[Log]) -> Iterator[float]:
    column = {"time": "t", "speed": "velocity"}.get(channel, channel)
    for log in logs:
        if column in log:
            yield table.beyond(channel, log[column])
        elif column == "velocity" and "position" in log:
            yield table.beyond(channel, np.gradient(log["position"], log.sample_time))
