"""How every JSON result begins."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

#: Goes up when a key is taken away or changes its meaning; new keys may come without.
SCHEMA_VERSION = 1


def head(command: str, logs: Iterable[str]) -> dict[str, Any]:
    """schema_version, command, and the logs: `logs` is a list in every result, `log` the same but for `detect`."""
    listed = list(logs)
    return {"schema_version": SCHEMA_VERSION, "command": command, "log": listed, "logs": listed}
