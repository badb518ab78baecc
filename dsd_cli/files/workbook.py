"""The sheet of an Excel workbook that has most in it, as the text of a CSV file: what every reader of text reads."""

from __future__ import annotations

import re
import zipfile
from collections.abc import Iterator
from datetime import datetime, timedelta
from typing import Any
from xml.etree import ElementTree

#: The day that workbooks count from, and how many that are a time of day alone.
_FIRST, _DAY = datetime(1899, 12, 30), 1.0
#: Formats of numbers that every workbook has, and that are dates or times; what a format that is one has in it.
_DATES = {*range(14, 23), *range(45, 48)}
_IS_DATE = re.compile(r"[ymdhs]", re.IGNORECASE)
_NOT_MEANT = re.compile(r'"[^"]*"|\[[^\]]*\]|\\.|_.')
_LETTERS = re.compile(r"[A-Z]+")


def is_workbook(names: list[str]) -> bool:
    """Whether an archive with files of these names is one."""
    return "xl/workbook.xml" in names


def text_of_workbook(archive: zipfile.ZipFile) -> Iterator[bytes]:
    """Line by line, fields with commas between them.

    Raises
    ------
    ValueError, zipfile.BadZipFile, ElementTree.ParseError : it is damaged.
    """
    sheets = [one for one in archive.infolist() if one.filename.startswith("xl/worksheets/")]
    if not sheets:
        raise ValueError("it has no sheet")
    shared, dated = list(_shared(archive)), _dated(archive)
    with archive.open(max(sheets, key=lambda one: one.file_size)) as sheet:
        for row in _elements(sheet, "row"):
            cells: dict[int, str] = {}
            for cell in row:
                at = _place(cell.get("r", "")) if cell.get("r") else len(cells)
                cells[at] = _quoted(_text(cell, shared, dated))
            yield ",".join(cells.get(at, "") for at in range(max(cells, default=-1) + 1)).encode() + b"\n"


def _elements(file: Any, tag: str) -> Iterator[Any]:
    """The elements of that name, one by one, forgotten behind the reader."""
    for _, element in ElementTree.iterparse(file):
        if _name(element) == tag:
            yield element
            element.clear()


def _name(element: Any) -> str:
    return str(element.tag).rpartition("}")[2]


def _shared(archive: zipfile.ZipFile) -> Iterator[str]:
    """The texts that cells name by their place in this list."""
    if "xl/sharedStrings.xml" in archive.namelist():
        with archive.open("xl/sharedStrings.xml") as file:
            yield from (
                "".join(one.text or "" for one in entry.iter() if _name(one) == "t") for entry in _elements(file, "si")
            )


def _dated(archive: zipfile.ZipFile) -> set[int]:
    """Styles of cells whose number is a date or a time."""
    if "xl/styles.xml" not in archive.namelist():
        return set()
    with archive.open("xl/styles.xml") as file:
        root = ElementTree.parse(file).getroot()
    own = [one for one in root.iter() if _name(one) == "numFmt"]
    dates = _DATES | {
        int(one.get("numFmtId", -1)) for one in own if _IS_DATE.search(_NOT_MEANT.sub("", one.get("formatCode", "")))
    }
    styles = next((one for one in root.iter() if _name(one) == "cellXfs"), ())
    return {at for at, one in enumerate(styles) if int(one.get("numFmtId", 0)) in dates}


def _place(reference: str) -> int:
    """The column of C5 is 2."""
    found = _LETTERS.match(reference)
    at = 0
    for letter in found[0] if found else "A":
        at = 26 * at + ord(letter) - ord("A") + 1
    return at - 1


def _text(cell: Any, shared: list[str], dated: set[int]) -> str:
    kind = cell.get("t", "n")
    value = next((one.text or "" for one in cell if _name(one) == "v"), "")
    if kind == "inlineStr":
        return "".join(one.text or "" for one in cell.iter() if _name(one) == "t")
    if kind == "s" and value:
        return shared[int(value)]
    if kind == "e":
        return ""
    return _stamp(float(value)) if kind == "n" and value and int(cell.get("s", 0)) in dated else value


def _stamp(days: float) -> str:
    at = _FIRST + timedelta(microseconds=round(days * 86400e6))
    return f"{at:%H:%M:%S.%f}" if 0.0 <= days < _DAY else at.isoformat(" ", "microseconds")


def _quoted(text: str) -> str:
    text = " ".join(text.splitlines()) if "\n" in text or "\r" in text else text
    return '"' + text.replace('"', '""') + '"' if "," in text or '"' in text else text
