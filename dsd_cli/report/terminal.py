"""Text for terminals: what comes out of files is shown, never obeyed."""

from __future__ import annotations

import json
import re
from typing import Any

from dsd_cli.errors import ORDERS, printable


def escaped(text: str) -> str:
    """Safe from the terminal and from rich's markup; line ends stay."""
    from rich.markup import escape

    return escape("\n".join(map(printable, text.split("\n"))))


def console(file: Any) -> Any:
    """Where tables are printed; on a terminal long lines are broken between words, elsewhere they stay lines."""
    from rich.console import Console

    return Console(file=file, highlight=False, soft_wrap=not file.isatty())


def json_text(result: Any, indent: int | None = None) -> str:
    """JSON as UTF-8 text without control characters; a NaN is a mistake of ours and fails."""
    text = json.dumps(result, indent=indent, ensure_ascii=False, allow_nan=False)
    return re.sub("[^\n]", lambda one: ORDERS.sub(_as_json, one[0]), text) if _has_orders(text) else text


def _has_orders(text: str) -> bool:
    return ORDERS.search(text.replace("\n", "")) is not None


def _as_json(found: re.Match[str]) -> str:
    return f"\\u{ord(found[0]):04x}"
