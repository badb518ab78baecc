"""The text in a file that is packed, or that is not in UTF-8, as bytes of UTF-8: what every reader of text reads."""

from __future__ import annotations

import bz2
import codecs
import csv
import gzip
import io
import lzma
import re
import zipfile
import zlib
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import Any

from dsd_cli.errors import DataError
from dsd_cli.files.formats.base import check_size
from dsd_cli.files.turned_rows import may_be_turned, turned
from dsd_cli.files.workbook import is_workbook, text_of_workbook

#: Bytes that are unpacked at a time, and those that tell how a text is written.
PIECE, HEAD = 1 << 20, 4096
#: How a packed file begins -> what it is, and what opens it.
_PACKED: dict[bytes, tuple[str, Any]] = {
    b"\x1f\x8b": ("gzip-compressed", gzip.open),
    b"BZh": ("bzip2-compressed", bz2.open),
    b"\xfd7zXZ\0": ("xz-compressed", lzma.open),
}
_ZIP = b"PK\x03\x04"
#: The stamp that a serial monitor puts before each line.
_STAMPED = re.compile(rb"(?m)^(\d\d:\d\d:\d\d[.,]\d+) -> ")
#: A cell that is a list, as pandas and bags of ROS write arrays: [1, 2], [1 2], array('d', [1, 2]), (1, 2).
_LIST = re.compile(
    rb'"(?:array\(\'\w\', ?)?\[([^"\[\]]*)\]\)?"|"\(((?:[-+.\deE\s]|nan|inf)+,(?:[-+.\deE\s,]|nan|inf)*)\)"'
)
#: What lies beside a log in a zip: what was written about it.
_BESIDE = re.compile(r"(?i)(\.(json|ya?ml|toml|ini|md|pdf|png|jpe?g|svg|html?|xml|m|py)|(^|/)(readme|license)[^/]*)$")
#: What archives hold that are documents: of OpenDocument, of Microsoft.
_OF_OFFICE = ("mimetype", "[Content_Types].xml")
_CONTROLS = re.compile("[\0-\x08]")


def content_of(path: str | Path, most: int | None = None) -> bytes | None:
    """The text of a file, of more than `most` bytes the first of them; None: the file is read as it is.

    Raises
    ------
    DataError : it cannot be unpacked, or what is packed is not one text.
    """
    try:
        with open(path, "rb") as file:
            head = file.read(HEAD)
            if packed := next((packed for magic, packed in _PACKED.items() if head.startswith(magic)), None):
                return _unpacked(path, packed[0], packed[1](path, "rb"), most)
            if head.startswith(_ZIP):
                member = _member(str(path), head)
                return None if member is None else _unpacked(path, *member, most)
            turn = may_be_turned(head)
            if _encoding(head) is None and _STAMPED.match(head) is None and _without_lists(head) == head and not turn:
                return None
            file.seek(0)
            return _first(_as_utf8(file.read() if most is None or turn else file.read(2 * most)), most)
    except (OSError, ValueError):
        return None  # whoever reads it says why


def text_of(path: str | Path) -> bytes:
    """All bytes of a text, unpacked and in UTF-8 where it was neither."""
    content = content_of(path)
    return Path(path).read_bytes() if content is None else content


def _member(path: str, head: bytes) -> tuple[str, Any] | None:
    """What a zip is and the one file in it, but for what systems and people add; None: arrays of NumPy, or no zip."""
    try:
        archive = zipfile.ZipFile(path)
    except NotImplementedError:
        return None
    except zipfile.BadZipFile as error:
        if b".npy" in head:
            return None
        raise _damaged(path, "a zip archive or a spreadsheet", error) from None
    names = [name for name in archive.namelist() if not name.endswith("/")]
    if any(name.endswith(".npy") for name in names):
        return None
    if is_workbook(names):
        check_size(path, sum(one.file_size for one in archive.infolist()))
        return "an Excel workbook", _Lines(text_of_workbook(path))
    if any(name in _OF_OFFICE for name in names):
        raise DataError(f"{path}: is a file of an office program", "save the sheet with the log as .xlsx or CSV")
    files = [name for name in names if not name.startswith("__MACOSX/") and not Path(name).name.startswith(".")]
    logs = [name for name in files if len(files) == 1 or not _BESIDE.search(name)]
    if len(logs) != 1:
        listed = ", ".join(files[:4]) + (" ..." if len(files) > 4 else "")
        raise DataError(f"{path}: is a zip archive of {len(files)} files{listed and f' ({listed})'}", "unpack it first")
    check_size(path, archive.getinfo(logs[0]).file_size)
    try:
        return "a zip archive", archive.open(logs[0])
    except (RuntimeError, NotImplementedError, zipfile.BadZipFile) as error:  # with a password, or an odd method
        raise _damaged(path, "a zip archive", error) from None


class _Lines:
    """What gives lines as a stream of bytes."""

    def __init__(self, lines: Iterator[bytes]) -> None:
        self._lines = lines

    def read1(self, size: int) -> bytes:
        return b"".join(islice(self._lines, size // HEAD))

    def __enter__(self) -> _Lines:
        return self

    def __exit__(self, *_: object) -> None:
        pass


def _unpacked(path: str | Path, kind: str, stream: Any, most: int | None) -> bytes:
    """The text that a stream gives, and no more than the machine has memory for."""
    text, size = io.BytesIO(), 0  # grows in place, and is handed over without a copy
    try:
        with stream:
            while (most is None or size < 2 * most) and (part := _next(stream, size)):
                if not size and not _is_text(_as_utf8(part[:HEAD])):
                    break
                size += text.write(part)
                check_size(str(path), size)
    except (OSError, EOFError, RuntimeError, NotImplementedError, ValueError) as error:
        raise _damaged(path, kind, error) from None
    except (zlib.error, lzma.LZMAError, zipfile.BadZipFile) as error:
        raise _damaged(path, kind, error) from None
    if not size and part:
        raise DataError(f"{path}: is {kind}, and what is in it is no text", "unpack it first")
    return _first(_as_utf8(text.getvalue()), most)


def _first(content: bytes, most: int | None) -> bytes:
    """So many bytes of it; of the whole what it is stays known."""
    return content if most is None else content[:most]


def _is_text(head: bytes) -> bool:
    """Whether it is more than zeros, which may stand at its end alone."""
    return bool(text := head.rstrip(b"\0")) and b"\0" not in text


def _next(stream: Any, size: int) -> bytes:
    """More of it; what stands behind the end of a gzip file is none of it, as gzip itself has it."""
    try:
        return bytes(stream.read1(PIECE))
    except gzip.BadGzipFile as error:
        if size and "Not a gzipped file" in str(error):
            return b""
        raise


def _damaged(path: str | Path, kind: str, error: Exception) -> DataError:
    said = (str(error) or type(error).__name__).splitlines()[0].rstrip(".")
    return DataError(f"{path}: is {kind} and cannot be unpacked ({said})", "is it whole? write it again")


def _as_utf8(content: bytes) -> bytes:
    encoding = _encoding(content[:HEAD])
    if encoding is not None:  # cut at any byte, or spoiled: what is wrong shows in its place
        content = content.decode(encoding, "replace").removeprefix("\ufeff").encode()
    if _STAMPED.match(content):
        lines = content[:HEAD].splitlines()[:-1] or [content]
        by = max((b"\t", b";", b",", b" "), key=lambda one: sum(one in line.partition(b" -> ")[2] for line in lines))
        content = _STAMPED.sub(rb"\1" + by, content)
    content = _without_lists(content)
    return turned(content) or content


def _without_lists(content: bytes) -> bytes:
    """A column `name/1`, `name/2`, ... for each item where cells of the first row are lists."""
    end = content.find(b"\n") + 1
    if not end or not _LIST.search(content, end, HEAD):
        return content
    try:
        head = io.StringIO(content[:HEAD].decode("utf-8", "replace"), newline="")
        names, first = islice(csv.reader(head), 2)
    except (csv.Error, ValueError):  # no table, which its reader says better
        return content
    if len(names) != len(first):
        return content
    found = [_LIST.fullmatch(f'"{cell}"'.encode()) for cell in first]
    items = [range(_items(one).count(b",") + 1) if one else None for one in found]
    full = [f"{name}/{k + 1}" if of else name for name, of in zip(names, items, strict=True) for k in of or [0]]
    return ",".join(full).encode() + b"\n" + _LIST.sub(_items, content[end:])


def _items(cell: re.Match[bytes]) -> bytes:
    """Between commas; an array of NumPy has blanks, and goes on in the next line."""
    inside = cell[1] if cell[2] is None else cell[2]
    return inside if b"," in inside else b",".join(inside.split())


def _encoding(head: bytes) -> str | None:
    """UTF-16 of either order, with its mark or, as letters of most languages have it, zeros in every second byte."""
    if head.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "utf-16-le" if head.startswith(codecs.BOM_UTF16_LE) else "utf-16-be"
    even, odd = head[::2].count(0), head[1::2].count(0)
    if min(even, odd) or 4 * max(even, odd) < max(len(head), 1):
        return None
    encoding = "utf-16-le" if odd else "utf-16-be"
    return None if _CONTROLS.search(head.decode(encoding, "replace")) else encoding
