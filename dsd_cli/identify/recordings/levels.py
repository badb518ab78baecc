"""Levels of single logs: by how much a value of one log differs from the mean of the logs of one rig."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dsd_cli.identify.recordings.recording import Recording


@dataclass(frozen=True)
class Deviations:
    """A value of an effect that differs between logs; the deviations add up to zero, each log counting once.

    column : of the effect, that the parameter multiplies. by_log, errors : deviation of each log and its standard
        error, unit of the parameter. alike : effects whose levels would explain the logs as well in its place.
    """

    effect: str
    parameter: str
    column: int
    by_log: tuple[float, ...]
    errors: tuple[float, ...]
    alike: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """`coulomb_friction.level`."""
        return f"{self.effect}.{self.parameter}"


def may_differ(recordings: Sequence[Recording]) -> bool:
    """Whether levels of single logs can be asked for: of one there are none, and a reconstructed motion floats."""
    return len(recordings) > 1 and not any(r.walk > 0.0 for r in recordings)


def with_levels(recordings: Sequence[Recording], known: Sequence[Deviations]) -> tuple[Recording, ...]:
    """The recordings with these deviations, and no others, as forces that are known to act in them."""
    if not known and not any(r.levels for r in recordings):
        return tuple(recordings)
    return tuple(
        replace(r, levels=tuple((one.effect, one.column, one.by_log[i]) for one in known))
        for i, r in enumerate(recordings)
    )
