"""Laws that are a table: values at knots over one channel or two, linear in between, held beyond the ends."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from dsd_cli.effects.base import Channels
from dsd_cli.errors import UsageError

#: Channels that a table may stand over, and what it may be multiplied by.
OVER = ("velocity", "speed", "position", "u", "time")
FACTORS = ("one", "velocity", "u")

#: Numbers of a table, nested as its knots are.
Numbers = tuple[Any, ...]


@dataclass(frozen=True)
class Table:
    """One law.

    Attributes
    ----------
    channels : one or two of `OVER`. knots : for each channel, increasing, in its unit.
    values : at the knots, unit of u; with two channels a row for each knot of the first.
    factor : what the table is multiplied by, one of `FACTORS`.
    seen : for each channel the ends of what it was learnt from, where its knots go on beyond; (): they do not.
    """

    channels: tuple[str, ...]
    knots: tuple[tuple[float, ...], ...]
    values: Numbers
    factor: str = "one"
    seen: tuple[tuple[float, float], ...] = ()

    @property
    def size(self) -> int:
        """Number of values."""
        return math.prod(len(one) for one in self.knots)

    def unit(self, i: int) -> Table:
        """The same with 1 at knot i (of the first channel's by the second's) and 0 elsewhere: a hat."""
        return self.holding(np.eye(1, self.size, i)[0])

    def holding(self, values: Any) -> Table:
        """The same with these values, shape (size,)."""
        shaped = np.reshape(values, self._values.shape)
        return replace(self, values=_nested(shaped.tolist()))

    def __call__(self, channels: Channels) -> Any:
        """At each row, or at one instant; unit of u."""
        at = [_over(name, channels) for name in self.channels]
        found = np.interp(at[0], self._knots[0], self._values) if len(at) == 1 else self._between(at[0], at[1])
        return found if self.factor == "one" else found * _over(self.factor, channels)

    def slope(self, x: Any) -> Any:
        """Of a table over one channel, per unit of it; 0 beyond the ends."""
        knots, values = self._knots[0], self._values
        if len(knots) == 1:
            return 0.0 * x
        steps = np.diff(values) / np.diff(knots)
        found = steps[-1]
        for step, end in zip(steps[-2::-1], knots[-2:0:-1], strict=True):
            found = np.where(x < end, step, found)
        return found * ((x >= knots[0]) & (x <= knots[-1]))

    def ends(self, name: str) -> tuple[float, float]:
        """Of a channel of this table where the law is known: of what was seen, else of the knots."""
        i = self.channels.index(name)
        return self.seen[i] if self.seen else (self.knots[i][0], self.knots[i][-1])

    def beyond(self, name: str, x: Any) -> float:
        """Share of x, shape (n,), a channel of this table, that lies beyond where the law is known."""
        if name == "speed":
            x = np.abs(x)
        low, high = self.ends(name)
        margin = 0.01 * (high - low)
        return float(np.mean((x < low - margin) | (x > high + margin)))

    @cached_property
    def _knots(self) -> list[Any]:
        return [np.asarray(one, dtype=np.float64) for one in self.knots]

    @cached_property
    def _values(self) -> Any:
        return np.asarray(self.values, dtype=np.float64)

    @cached_property
    def _rows(self) -> list[tuple[Any, Any]]:
        """(hat over the first channel's knots, values over the second's) of each row that is not 0."""
        hats = np.eye(len(self._values))
        return [(hat, row) for hat, row in zip(hats, self._values, strict=True) if row.any()]

    def _between(self, x: Any, y: Any) -> Any:
        """Bilinear: of each row over y the share that its hat over x has."""
        return sum(
            (np.interp(x, self._knots[0], hat) * np.interp(y, self._knots[1], row) for hat, row in self._rows),
            0.0 * x,
        )


def _over(name: str, channels: Channels) -> Any:
    match name:
        case "time":
            return channels.t
        case "speed":
            return np.abs(channels.velocity)
    return getattr(channels, name)


def _nested(values: Any) -> Any:
    return tuple(map(_nested, values)) if isinstance(values, list | tuple) else float(values)


def _listed(values: Any) -> tuple[Any, ...]:
    """Of a list what is in it; of anything else nothing."""
    return tuple(values) if isinstance(values, list | tuple) else ()


def table_of(values: Mapping[str, Any], effect: str) -> Table:
    """From the values of an effect as they stand in a config.

    Raises
    ------
    UsageError : says what cannot be, and what must.
    """
    channels, knots = _listed(values["channels"]), _listed(values["knots"])
    if len(channels) not in (1, 2) or any(name not in OVER or channels.count(name) > 1 for name in channels):
        raise UsageError(f"{effect}.channels = {values['channels']}", f"must be one or two of {', '.join(OVER)}")
    if len(knots) != len(channels) or any(not isinstance(one, list | tuple) for one in knots):
        raise UsageError(f"{effect}.knots", "must be a list of numbers for each channel: [[0.0, 1.0, 2.0]]")
    knots = tuple(numbers_of(one, f"{effect}.knots") for one in knots)
    if any(a >= b for one in knots for a, b in pairwise(one)) or any(len(one) < len(channels) for one in knots):
        raise UsageError(f"{effect}.knots", "must increase, and be two at least over each of two channels")
    factor = values.get("factor", "one")
    if factor not in FACTORS:
        raise UsageError(f"{effect}.factor = {factor!r}", f"must be one of {', '.join(FACTORS)}")
    rows = _listed(values["values"]) if len(channels) == 2 else [values["values"]]
    found = tuple(numbers_of(one, f"{effect}.values") for one in rows)
    wanted = (len(knots[0]), len(knots[1])) if len(channels) == 2 else (1, len(knots[0]))
    if (len(found), *{len(one) for one in found}) != wanted:
        raise UsageError(f"{effect}.values", f"must be {wanted[1]} numbers" + f" in {wanted[0]} rows" * (wanted[0] > 1))
    return Table(channels, knots, found if len(channels) == 2 else found[0], factor, _seen(values, channels, effect))


def _seen(values: Mapping[str, Any], channels: tuple[str, ...], effect: str) -> tuple[tuple[float, float], ...]:
    if "seen" not in values:
        return ()
    ends = tuple(numbers_of(one, f"{effect}.seen") for one in _listed(values["seen"]))
    if len(ends) != len(channels) or any(len(one) != 2 or one[0] >= one[1] for one in ends):
        raise UsageError(f"{effect}.seen", "must be the two ends for each channel: [[-1.0, 1.0]]")
    return tuple((low, high) for low, high in ends)


def numbers_of(values: Any, what: str, kind: str = "finite numbers", above: float = -math.inf) -> tuple[float, ...]:
    """A list of numbers of a config, each above `above`.

    Raises
    ------
    UsageError : `what` is no list of one number at least, or one is not finite, or not above.
    """
    numbers = isinstance(values, list | tuple) and all(
        isinstance(x, int | float) and not isinstance(x, bool) and math.isfinite(x) and x > above for x in values
    )
    if not numbers or not values:
        raise UsageError(what, f"must be a list of {kind}")
    return tuple(float(x) for x in values)


def values_of(table: Table, scale: float = 1.0) -> dict[str, Any]:
    """The inverse of `table_of`."""
    return {
        "channels": table.channels,
        "knots": table.knots,
        "values": table.values,
        "factor": table.factor,
        "scale": scale,
        **({"seen": table.seen} if table.seen else {}),
    }
