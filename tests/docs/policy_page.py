"""docs/how/policy.md, made from the policy itself: `python tests/docs/policy_page.py > docs/how/policy.md`."""

import inspect
import re
from collections.abc import Iterator
from dataclasses import fields

from dsd_cli.identify.policy import POLICY, Policy

HEAD = """# The policy: what counts as signal, as certain, as of use

`dsd compare`, `diagnose`, `add` and `improve` judge an effect by the force that it takes off the balance
`u(t - L) = J a - forces + r` ([identify.md](identify.md)). These are the thresholds of that judgement that hold for
every command; they stand in `dsd_cli/identify/policy.py`, and a test compares this page with it. None of them can be
set: a verdict that depends on a setting is none.
"""
_FIELD = re.compile(r"    (?P<name>\w+): [^=]+ = [^#]+  # (?P<why>.+)")
_PART = re.compile(r"    # -- (?P<title>.+) --")


def reasons() -> dict[str, str]:
    """Threshold -> unit and reason: the comment beside it."""
    return {name: why for _, name, why in _lines()}


def page() -> Iterator[str]:
    """The lines of the page."""
    yield from HEAD.splitlines()
    last = ""
    for part, name, why in _lines():
        if part != last:
            yield from (
                "",
                f"## {part[:1].upper()}{part[1:]}",
                "",
                "| threshold | value | what it is |",
                "|---|---|---|",
            )
            last = part
        value = getattr(POLICY, name)
        shown = ", ".join(f"{x:g}" for x in (value if isinstance(value, tuple) else (value,)))
        yield f"| `{name}` | {shown} | {why} |"


def _lines() -> Iterator[tuple[str, str, str]]:
    """(part, threshold, comment) in the order of the source."""
    part = ""
    for line in inspect.getsource(Policy).splitlines():
        if title := _PART.fullmatch(line):
            part = title["title"]
        elif found := _FIELD.fullmatch(line):
            yield part, found["name"], found["why"].replace("|", "\\|")


def without_reason() -> list[str]:
    """Thresholds that say neither unit nor reason."""
    return [f.name for f in fields(Policy) if f.name not in reasons()]


if __name__ == "__main__":
    print("\n".join(page()))
