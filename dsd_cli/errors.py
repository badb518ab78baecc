"""The few kinds of failure a user can cause, each with the exit code of the contract."""

from __future__ import annotations

import re

#: What a terminal takes for an order, or shows as what it is not: C0, DEL and C1, line ends of Unicode, marks that turn
#: the direction of writing, and halves of characters.
ORDERS = re.compile("[\x00-\x1f\x7f-\x9f\u2028\u2029\u202a-\u202e\u2066-\u2069\ud800-\udfff]")
#: Words up to this length are shown in full.
_LONGEST = 300


def printable(text: str) -> str:
    """One line that is safe on any terminal: control characters as `\\x1b`, very long words shortened."""
    text = ORDERS.sub(_written, " ".join(text.split("\n")))
    return re.sub(rf"\S{{{_LONGEST},}}", lambda word: f"{word[0][:100]}...{word[0][-60:]}", text)


def _written(found: re.Match[str]) -> str:
    code = ord(found[0])
    return f"\\x{code:02x}" if code < 0x100 else f"\\u{code:04x}"


def source_name(path: str) -> str:
    """What messages call a log: its path, <stdin> for -."""
    return "<stdin>" if path == "-" else path


def how_to_install(extra: str) -> str:
    """The command that brings what an extra of this package needs: by the libraries, for a clone is on no index."""
    from importlib.metadata import PackageNotFoundError, requires

    try:
        needed = requires("dsd-cli") or []
    except PackageNotFoundError:
        needed = []
    wanted = re.compile(rf"""(\S+?)\s*;\s*extra == ['"]{re.escape(extra)}['"]""")
    libraries = [found[1] for one in needed if (found := wanted.fullmatch(one))]
    return "pip install " + (" ".join(f"'{one}'" for one in libraries) or f"'.[{extra}]' in the folder of the source")


class DsdError(Exception):
    """A failure with one clear line for the user.

    Parameters
    ----------
    message : what is wrong and where (file, row, column or key).
    hint : what to do about it; printed on the same line.
    """

    exit_code = 1

    def __init__(self, message: str, hint: str = "") -> None:
        super().__init__(message)
        self.message = message
        self.hint = hint

    def __str__(self) -> str:
        return f"{self.message}: {self.hint}" if self.hint else self.message


class DataError(DsdError):
    """Bad data, or a failure at run time (exit code 1)."""


class TooShort(DataError):  # noqa: N818 (as CheckFailed)
    """Too few rows for what is asked of them; a longer log, or a larger part of it, may do."""


class UsageError(DsdError):
    """A bad command line or config (exit code 2)."""

    exit_code = 2


class CheckFailed(DsdError):  # noqa: N818 (not an error: the check did its work)
    """A check that the user asked for did not hold (exit code 3)."""

    exit_code = 3
