"""Changes of `dsd.toml` that leave comments, order and formatting as they are.

Every change is read again and compared with what was meant before it is handed out.
"""

from __future__ import annotations

import math
import os
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any, NamedTuple

from dsd_cli.errors import DataError, UsageError
from dsd_cli.files.config.history import History
from dsd_cli.files.config.moved import moved
from dsd_cli.files.config.placing import newline, with_raws, without
from dsd_cli.files.config.text import read_again
from dsd_cli.files.config.toml_text import Path, Statement, inline, inline_leaves, leaves, literal, statements
from dsd_cli.files.table_source import sidecar
from dsd_cli.files.whole import STREAM, check_target, is_same, only_one, write_whole

if TYPE_CHECKING:
    from dsd_cli.identify.results import Estimates
    from dsd_cli.plant.model import PlantModel

#: Digits that a fitted value keeps at least, and beyond the first digit of its standard error.
DIGITS, BEYOND = 6, 2
#: Enough for any value, and one less than shows the noise of binary fractions.
EXACT = 15
#: Comments on keys of a step.
_REMARKS = {"levels": "  # one for each of `logs`; [model] has their mean, each log counting once"}
#: The keys of [model] that a fit changes.
FITTED = ("inertia", "delay", "effects")


def with_model(text: str, model: PlantModel, estimates: Estimates) -> str:
    """The config with this model in [model]; values that did not change stay as they are written.

    Parameters
    ----------
    estimates : "inertia" or "<effect>.<parameter>" -> estimate, for the number of digits.

    Raises
    ------
    UsageError : [model] is written in a way that cannot be changed in place.
    """
    old = leaves({"model": tomllib.loads(text).get("model", {})})
    raws = _raws(text)
    wanted = {path: raw for path, raw in raws.items() if path[1] not in FITTED}
    values = {"inertia": model.inertia, "delay": model.delay, "effects": model.effects}
    for path, value in leaves({"model": values}).items():
        unchanged = path in old and (old[path] == value or _close(old[path], value))
        wanted[path] = raws[path] if unchanged else literal(_rounded_leaf(path, value, estimates))
    if ("model", "delay") not in old and model.delay == 0.0:
        del wanted["model", "delay"]  # the default
    return _checked(with_raws(text, wanted), text, wanted)


def with_step(text: str, step: History, before: str) -> str:
    """The config with one more [[history]]; `before` is the config before the step.

    Raises
    ------
    UsageError : `history` is written in a way that cannot be added to.
    """
    end = newline(text)
    lines = ["[[history]]  # `dsd improve --undo` takes the last step back"]
    given = {name: getattr(step, name) for name in History.keys if name != "before"}
    lines += [
        f"{name} = {_history_value(v)}{_REMARKS.get(name, '')}"
        for name, v in given.items()
        if v is not None and v != {} and v is not False
    ]
    if "model" in tomllib.loads(before):
        kept = {path[1:]: raw for path, raw in _raws(before).items() if path[1] in FITTED}
        lines.append(f"before = {inline(kept)}")
    changed = _ended(text) + end + end.join(lines) + end
    try:
        now = tomllib.loads(changed)
    except tomllib.TOMLDecodeError:
        raise UsageError("history cannot be added to", "write it as [[history]] tables") from None
    assert len(now["history"]) == len(tomllib.loads(text).get("history", ())) + 1
    return changed


def undone(text: str) -> str:
    """The config as before the last step of its history, which goes.

    Raises
    ------
    UsageError : there is no step, or [model] is written in a way that cannot be changed in place.
    """
    steps = tomllib.loads(text).get("history", [])
    if not steps:
        raise UsageError("no [[history]]", "there is no step to take back")
    all_of_it = statements(text)
    first = max((i for i, s in enumerate(all_of_it) if s.kind == "[[" and s.path == ("history",)), default=None)
    if first is None:
        raise UsageError("history is no [[history]]", "write it as [[history]] tables")
    gone, wanted = {first}, {path: raw for path, raw in _raws(text).items() if path[1] not in FITTED}
    if first and all_of_it[first - 1].kind == "":
        gone.add(first - 1)
    for i, statement in enumerate(all_of_it[first + 1 :], first + 1):
        if statement.kind in ("[", "[[") and statement.path[0] != "history":
            break
        if statement.kind in ("[", "[[", "="):
            gone.add(i)
    wanted |= {("model", *path): raw for path, raw in _before(text, all_of_it, first, steps[-1]).items()}
    rest = without(text, all_of_it, gone)
    return _checked(with_raws(rest, wanted, keep_header="before" in steps[-1]), rest, wanted)


def _before(text: str, all_of_it: Sequence[Statement], first: int, step: Mapping[str, Any]) -> dict[Path, str]:
    """The [model] that a step keeps, each leaf as it was written."""
    written = {path: literal(value) for path, value in leaves(step.get("before", {})).items()}
    for statement in all_of_it[first:]:
        if statement.path == ("history", "before") and statement.kind == "=":
            kept = inline_leaves(statement.raw(text))
            return {path: kept.get(path, raw) for path, raw in written.items()}
    return written


def _raws(text: str) -> dict[Path, str]:
    """Path -> value as written, of every leaf of [model]."""
    found = {path: literal(v) for path, v in leaves({"model": tomllib.loads(text).get("model", {})}).items()}
    for statement in statements(text):
        if statement.kind == "=" and statement.path[0] == "model":
            raw = statement.raw(text)
            inside = inline_leaves(raw) if raw.startswith("{") else {(): raw}
            found |= {p: r for path, r in inside.items() if (p := (*statement.path, *path)) in found}
    return found


def _checked(changed: str, text: str, wanted: Mapping[Path, str]) -> str:
    """`changed`, if it is the config `text` with these leaves in [model] and nothing else changed."""
    cannot = UsageError("[model] cannot be changed in place", "write its effects as tables [model.effects.<id>]")
    try:
        now, old = tomllib.loads(changed), tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        raise cannot from None
    meant = {path: tomllib.loads(f"x = {raw}")["x"] for path, raw in wanted.items()}
    got = leaves({"model": now.pop("model", {})})
    old.pop("model", None)
    if got != meant or now != old:
        raise cannot
    return changed


def _rounded_leaf(path: Path, value: Any, estimates: Estimates) -> Any:
    """A leaf of [model] with the digits that its estimate deserves, and within its bounds."""
    if not isinstance(value, int | float):
        return _plain(value)
    estimate = estimates.get(".".join(path[2:] if path[1] == "effects" else path[1:]))
    short = rounded(float(value), math.nan if estimate is None else estimate.std_error)
    if path[1] == "effects":
        from dsd_cli.effects import get_effect

        bounds = get_effect(path[2]).parameter(path[3])
        return short if bounds.lower <= short <= bounds.upper else float(value)
    return short


def _plain(value: Any) -> Any:
    """Lists of tables without float noise."""
    match value:
        case Mapping():
            return {name: _plain(item) for name, item in value.items()}
        case list() | tuple():
            return [_plain(item) for item in value]
        case float():
            return rounded(value, math.nan)
    return value


def rounded(value: float, std_error: float = math.nan) -> float:
    """At least six significant digits, and two beyond the first digit of the standard error; all without one."""
    digits = EXACT
    if math.isfinite(std_error) and std_error > 0.0 and value != 0.0:
        needed = math.floor(math.log10(abs(value))) - math.floor(math.log10(std_error)) + 1 + BEYOND
        digits = min(max(DIGITS, needed), EXACT)
    return float(f"{value:.{digits}g}")


def _close(old: Any, new: Any) -> bool:
    """Equal but for float noise."""
    numbers = all(isinstance(x, int | float) and not isinstance(x, bool) for x in (old, new))
    return numbers and math.isclose(old, new, rel_tol=10.0**-EXACT)


def _history_value(value: Any) -> str:
    return literal(rounded(value, abs(value))) if isinstance(value, float) else literal(_plain(value))


def _ended(text: str) -> str:
    """With a line end at the end."""
    return text if not text or text.endswith("\n") else text + newline(text)


def now() -> str:
    """Date of a step, UTC."""
    return datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")


def check_config_output(path: str, inputs: Iterable[str | FilePath] = ()) -> None:
    """Whether a config can be written there; it may be the config that was read, not a log.

    Raises
    ------
    UsageError : `path` is one of the inputs, or the metadata beside one.
    DataError : it is a directory, or its folder is not there or cannot be written to.
    """
    if path != STREAM:
        check_target(path, [read for name in inputs for read in (name, sidecar(name))])


class Origin(NamedTuple):
    """A config file, and the text it had when a command began."""

    path: str | FilePath
    text: str


def read_origin(path: str | FilePath) -> Origin:
    """A config that `load_config` takes, line ends as they are.

    Raises
    ------
    UsageError : it cannot be read.
    """
    try:
        return Origin(path, read_again(path))
    except (OSError, UnicodeDecodeError):
        from dsd_cli.files.config.config import load_config

        load_config(path)  # says what is wrong
        raise


def write_text(path: str, text: str, origin: Origin | None = None) -> None:
    """Whole or not at all; a file that is replaced keeps its permissions.

    Parameters
    ----------
    origin : the config that this one was made from; files that it names relative to its folder stay the same files.

    Raises
    ------
    DataError : it cannot be written, or it is the origin and another process has changed it meanwhile.
    """
    target = FilePath(os.path.realpath(path))
    if origin is not None:
        text = moved(text, FilePath(origin.path).parent, FilePath(path).parent)
    if origin is None or not is_same(target, origin.path):
        write_whole(path, text.encode())
        return
    with only_one(target.parent):
        if read_origin(target).text != origin.text:
            raise DataError(f"{path}: was changed by somebody else meanwhile", "nothing was written; run it again")
        write_whole(path, text.encode())
