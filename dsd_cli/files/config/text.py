"""The text of a config file: of a size that a config can have, and of a file where it is read again."""

from __future__ import annotations

from pathlib import Path

from dsd_cli.errors import UsageError

#: No config is larger, and /dev/zero has no end.
MOST_BYTES = 10_000_000


def read_text(path: str | Path) -> str:
    """The file's text, line ends as they are.

    Raises
    ------
    UsageError : it is too large for a config.
    OSError, UnicodeDecodeError : it cannot be read.
    """
    with open(path, "rb") as file:
        content = file.read(MOST_BYTES + 1)
    if len(content) > MOST_BYTES:
        raise UsageError(f"{path}: is no config, it has more than {MOST_BYTES // 1_000_000} MB", "-c names the config")
    return content.decode("utf-8-sig")


def read_again(path: str | Path) -> str:
    """`read_text` of a config that has been read before.

    Raises
    ------
    UsageError : it is a FIFO or a device: what was in it is gone.
    """
    if Path(path).exists() and not Path(path).is_file():
        raise UsageError(f"{path}: is no file, and this command reads its config twice", "save it as a file")
    return read_text(path)
