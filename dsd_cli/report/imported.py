"""What `dsd import` found, as JSON, as the head of the config, and as a table."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from dsd_cli.errors import printable
from dsd_cli.report import terminal
from dsd_cli.report.diagnosis import plain_table
from dsd_cli.report.head import head
from dsd_cli.report.terminal import escaped

if TYPE_CHECKING:
    from dsd_cli.export.reading.found import Found


def imported_json(found: Found, file: str, config: str) -> dict[str, Any]:
    """The object of the contract."""
    return {
        **head("import", ()),
        "file": file,
        "joint": found.name,
        "linear": found.linear,
        "model": {
            "inertia": found.model.inertia,
            "delay": found.model.delay,
            "effects": {name: _plain(values) for name, values in found.model.effects.items()},
        },
        "notes": list(found.notes),
        "not_taken": list(found.missed),
        "config": config,
    }


def _plain(values: Any) -> dict[str, Any]:
    return {name: list(value) if isinstance(value, tuple) else value for name, value in values.items()}


def imported_text(found: Found, file: str) -> str:
    """Comments at the top of the config: where the model is from, how it was taken, what was not."""
    unit = f"{'m' if found.linear else 'rad'} and {found.units.u or ('N' if found.linear else 'N m')}"
    lines = [f"joint {found.name} of {file}, in {unit}", *found.notes, *(f"not taken: {one}" for one in found.missed)]
    return "".join(f"# {printable(line)}\n" for line in lines)


def print_imported(found: Found, file: str, out: Any) -> None:
    """For a person."""
    console = terminal.console(out)
    table = plain_table(f"{file}: joint {found.name} ({'slides' if found.linear else 'turns'})", "value", "")
    model = found.model
    rows = {"inertia": model.inertia, "delay": model.delay} | {
        f"{effect}.{name}": value for effect, values in model.effects.items() for name, value in values.items()
    }
    for name, value in rows.items():
        table.add_row(escaped(name), f"{value:.6g}" if isinstance(value, int | float) else _short(value))
    console.print(table)
    for note in found.notes:
        console.print(escaped(note))


def _short(value: Any) -> str:
    text = escaped(str(list(value) if isinstance(value, tuple) else value))
    return text if len(text) <= 48 else f"{text[:45]}..."
