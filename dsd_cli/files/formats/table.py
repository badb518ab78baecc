"""A file of groups of channels as the one table that commands read."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from pathlib import Path

from dsd_cli.errors import DataError
from dsd_cli.files.formats.base import Group, understanding
from dsd_cli.files.formats.join import Sampled, join
from dsd_cli.files.formats.known import Format, open_container
from dsd_cli.files.formats.names import Place, chosen_places, places, stamps_of
from dsd_cli.files.parquet_in import BATCH_ROWS
from dsd_cli.files.table_source import Batch
from dsd_cli.signals.log import Array, Hold


class ContainerTable:
    """A file of another tool; see `TableSource`. Channels of one clock are read in batches, others joined in memory."""

    def __init__(
        self,
        path: str | Path,
        found: Format,
        columns: Mapping[str, str],
        optional: Collection[str] = (),
        u_hold: Hold = "held",
        scaled: bool | None = None,
    ) -> None:
        self.name, self._kind, self._u_hold = str(path), found.kind, u_hold
        self._file = open_container(path, found, scaled)
        groups = self._file.groups
        self.column_names: list[str] = list(dict.fromkeys(place.full for place in places(groups)))
        try:
            self._places = chosen_places(self.name, groups, columns, optional)
        except DataError as error:
            if self._file.notes:  # it may be in what could not be read
                raise DataError(error.message, "; ".join(self._file.notes)) from None
            raise
        self._stamps: dict[str, Place] = {}
        if "t" in columns:
            self._stamps = {c: stamps_of(self.name, groups, place, columns["t"]) for c, place in self._places.items()}
        elif len({place.group.rows for place in self._places.values()}) > 1:
            rows = ", ".join(f"{place.full} has {place.group.rows:,}" for place in self._places.values())
            raise DataError(f"{self.name}: channels with different numbers of rows: {rows}", "set signals.time")
        self.columns = {canonical: place.full for canonical, place in self._places.items()}
        if self._stamps:
            self.columns = {"t": self._stamps["u" if "u" in self._stamps else next(iter(self._stamps))].full} | (
                self.columns
            )
        self.metadata = dict(self._file.metadata)
        self.unreadable = 0
        self._notes: list[str] = []

    @property
    def warnings(self) -> list[str]:
        return [*self._file.notes, *self._notes]

    def batches(self) -> Iterator[Batch]:
        clocks = list(dict.fromkeys(self._stamps.values()))
        if len(clocks) > 1:
            yield from self._joined(clocks)
            return
        wanted = dict(self._places) | ({"t": clocks[0]} if clocks else {})
        rows = next(iter(wanted.values())).group.rows
        for start in range(0, rows, BATCH_ROWS):
            columns = self._read(wanted, start, BATCH_ROWS)
            yield Batch(next(iter(columns.values())).size, columns)

    def _joined(self, clocks: list[Place]) -> Iterator[Batch]:
        parts = []
        for clock in clocks:
            mine = {c: place for c, place in self._places.items() if self._stamps[c] == clock}
            columns = self._read({**mine, "t": clock}, 0, clock.group.rows)
            parts.append(Sampled(clock.full, columns.pop("t"), columns))
        joined = join(self.name, parts, self._u_hold)
        self._notes += joined.notes
        for start in range(0, joined.t.size, BATCH_ROWS):
            cut = slice(start, start + BATCH_ROWS)
            columns = {name: values[cut] for name, values in joined.values.items()}
            yield Batch(joined.t[cut].size, {**columns, "t": joined.t[cut]})

    def _read(self, wanted: Mapping[str, Place], start: int, rows: int) -> dict[str, Array]:
        by_group: dict[int, tuple[Group, dict[str, str]]] = {}
        for canonical, place in wanted.items():
            by_group.setdefault(id(place.group), (place.group, {}))[1][canonical] = place.channel
        out: dict[str, Array] = {}
        with understanding(self.name, self._kind):
            for group, mine in by_group.values():
                found = self._file.read(group, list(dict.fromkeys(mine.values())), start, rows)
                out |= {canonical: found[channel] for canonical, channel in mine.items()}
        return {canonical: out[canonical] for canonical in wanted}
