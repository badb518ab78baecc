"""Where a law that is a table is used beyond what it was learnt from: nobody has seen what it does there."""

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
    """One line for each table of the model and channel that a log takes beyond where the law is known."""
    logs = list(logs)
    lines = []
    for name, values in model.effects.items():
        table = get_effect(name).to_columns(values)[1].get("table")
        if not isinstance(table, Table):
            continue
        for channel in table.channels:
            share, (low, high) = max(_shares(table, channel, logs), default=0.0), table.ends(channel)
            if share > _WORTH_SAYING:
                goes_on = "where its formula goes on, unseen" if table.seen else "where its ends are held"
                known = f"{name} is known for {channel} from {low:.4g} to {high:.4g}"
                lines.append(f"{known}; {100.0 * share:.1f} % of the samples lie beyond, {goes_on}")
    return lines


def _shares(table: Table, channel: str, logs: Iterable[Log]) -> Iterator[float]:
    column = {"time": "t", "speed": "velocity"}.get(channel, channel)
    for log in logs:
        if column in log:
            yield table.beyond(channel, log[column])
        elif column == "velocity" and "position" in log:
            yield table.beyond(channel, np.gradient(log["position"], log.sample_time))
