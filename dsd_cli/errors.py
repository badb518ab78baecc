"""The few kinds of failure a user can cause, each with the exit code of the contract."""

from __future__ import annotations


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


class UsageError(DsdError):
    """A bad command line or config (exit code 2)."""

    exit_code = 2


class CheckFailed(DsdError):  # noqa: N818 (not an error: the check did its work)
    """A check that the user asked for did not hold (exit code 3)."""

    exit_code = 3
