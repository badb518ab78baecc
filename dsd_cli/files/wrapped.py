"""A table that hands on what another one says of itself, for those that change only its rows."""

from __future__ import annotations

from dsd_cli.files.table_source import TableSource


class WrappedTable:
    """See `TableSource`; a live stream may change what it says while it is read."""

    def __init__(self, table: TableSource) -> None:
        self._table = table
        self.name, self.metadata = table.name, table.metadata

    @property
    def column_names(self) -> list[str]:
        return self._table.column_names

    @property
    def columns(self) -> dict[str, str]:
        return self._table.columns

    @property
    def warnings(self) -> list[str]:
        return self._table.warnings

    @property
    def unreadable(self) -> int:
        return self._table.unreadable
