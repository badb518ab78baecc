"""The sheet of an Excel workbook that has most in it, as the text of a CSV file: what every reader of text reads.

Sheets with a signal each stand side by side.
"""

from __future__ import annotations

import csv
import io
import warnings
from collections.abc import Collection, Iterable, Iterator, Sequence
from datetime import date, time
from importlib.util import find_spec
from itertools import chain, zip_longest
from typing import Any

from dsd_cli.errors import UsageError, how_to_install


def is_workbook(names: list[str]) -> bool:
    """Whether an archive with files of these names is one."""
    return "xl/workbook.xml" in names


def text_of_workbook(path: str) -> Iterator[bytes]:
    """Line by line, fields with commas between them; formulas as the values that were saved with them.

    Raises
    ------
    UsageError : openpyxl is not installed.
    ValueError : it is damaged.
    """
    if find_spec("openpyxl") is None:
        raise UsageError(f"{path}: is an Excel workbook, and openpyxl is not installed", how_to_install("excel"))
    return _lines(path)


def _lines(path: str) -> Iterator[bytes]:
    from openpyxl import load_workbook  # slow to import
    from openpyxl.cell.cell import ERROR_CODES

    line = io.StringIO()
    write = csv.writer(line, lineterminator="\n").writerow
    try:
        with open(path, "rb") as file, warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of charts and formats that are not read
            book = load_workbook(file, read_only=True, data_only=True)
            for row in _rows(book.worksheets):
                line.seek(0)
                line.truncate()
                write(_text(value, ERROR_CODES) for value in row)
                yield line.getvalue().encode()
    except (KeyError, TypeError, AttributeError, IndexError, SyntaxError) as error:  # of XML, SyntaxError
        raise ValueError(f"no sheet of it can be read: {error}") from None


def _rows(sheets: Sequence[Any]) -> Iterator[Iterable[Any]]:
    """Of the sheet with most in it; of sheets with a signal each, alone or beside its stamps, all in one row."""
    most = max(sheets, key=lambda one: (one.max_row or 0) * (one.max_column or 0))
    width, rows = most.max_column or 0, most.max_row or 0
    beside = [one for one in sheets if one.max_column == width and 2 * (one.max_row or 0) >= rows]
    if width > 2 or len(beside) < 2:
        yield from most.iter_rows(values_only=True)
        return
    all_rows = zip_longest(*(one.iter_rows(values_only=True) for one in beside), fillvalue=(None,) * width)
    heads = [list(row) for row in next(all_rows, ())]
    if not heads:
        return
    if len({head[-1] for head in heads}) < len(heads):  # all are called `value`: the sheet has the name
        heads = [[*head[:-1], f"{one.title} {head[-1]}"] for one, head in zip(beside, heads, strict=True)]
    yield chain.from_iterable(heads)
    yield from map(chain.from_iterable, all_rows)


def _text(value: Any, errors: Collection[str]) -> Any:
    """What a cell says; nothing where its formula failed."""
    if isinstance(value, time):
        return value.isoformat("microseconds")
    if isinstance(value, date):
        return value.isoformat(*(" ", "microseconds") if hasattr(value, "hour") else ())
    if isinstance(value, bool):
        return int(value)
    if isinstance(value, str):
        return "" if value in errors else " ".join(value.splitlines())
    return value
