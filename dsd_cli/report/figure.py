"""Pictures as PNG."""

from __future__ import annotations

import io
from typing import Any

from dsd_cli.errors import printable


def png(figure: Any, **options: Any) -> bytes:
    """The figure as the content of a PNG file."""
    content = io.BytesIO()
    figure.savefig(content, format="png", dpi=110, **options)
    return content.getvalue()


def in_picture(text: str) -> str:
    """A text as it stands: no formula between dollars, no control characters; line ends stay."""
    return "\n".join(map(printable, text.split("\n"))).replace("$", r"\$")
