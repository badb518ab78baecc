"""XML of unknown origin: no entities, no document types, no more than a robot needs."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree as Xml

from dsd_cli.errors import DataError

MOST_BYTES = 50_000_000


def text_of(path: Path) -> str:
    """Raises DataError : no such file, too large, or no text."""
    try:
        with open(path, "rb") as file:
            content = file.read(MOST_BYTES + 1)
    except FileNotFoundError:
        raise DataError(f"{path}: no such file") from None
    except OSError as error:
        raise DataError(f"{path}: {error.strerror or error}") from None
    if len(content) > MOST_BYTES:
        raise DataError(f"{path}: has more than {MOST_BYTES // 1_000_000} MB", "is it a robot description?")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise DataError(f"{path}: byte {error.start} is not UTF-8", "is it text?") from None


def parse_xml(path: Path, text: str) -> Xml.Element:
    """The root. A document type could expand to gigabytes or read other files: it is refused, wherever it stands.

    Raises
    ------
    DataError : it is no XML, or has a document type or entities of its own.
    """
    upper = text.upper()
    if "<!DOCTYPE" in upper or "<!ENTITY" in upper:
        raise DataError(
            f"{path}: has a document type or entities of its own", "save it without: nothing here needs them"
        )
    try:
        return Xml.fromstring(text)
    except Xml.ParseError as error:
        line, column = error.position
        raise DataError(
            f"{path}: line {line}, column {column + 1}: not valid XML", str(error).partition(":")[0]
        ) from None
    except (ValueError, RecursionError) as error:
        raise DataError(f"{path}: not valid XML", " ".join(str(error).split())[:100]) from None


def numbers(path: Path, element: Xml.Element, key: str, default: str, count: int | None = None) -> list[float]:
    """An attribute as numbers.

    Raises
    ------
    DataError : it holds something else, or another number of them.
    """
    import math

    text = element.get(key, default)
    try:
        found = [float(word) for word in text.split()]
    except ValueError:
        found = []
    if not found or not all(map(math.isfinite, found)) or (count is not None and len(found) != count):
        wanted = "a number" if count == 1 else f"{count or 'some'} numbers"
        hint = "; `xacro FILE` writes the URDF that this stands for" if "$" in text else ""
        raise DataError(f'{path}: <{element.tag} {key}="{text[:40]}">', f"must be {wanted}{hint}")
    return found
