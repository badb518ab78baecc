"""Effects of a user: a Python file that defines `EFFECT`, or `EFFECTS` for several."""

from __future__ import annotations

import re
import traceback
from collections.abc import Mapping
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from dsd_cli.effects.base import Channels, Effect, Ranges, Role
from dsd_cli.effects.catalogue import catalogue
from dsd_cli.errors import UsageError

#: Rows that an effect is tried on.
_ROWS = 5


def load_effects(path: str | Path) -> list[Effect]:
    """The effects that a file defines, tried on a few rows. The file is run: it is the user's own code.

    Raises
    ------
    UsageError : no such file, an error in it, neither `EFFECT` nor `EFFECTS`, an id that is taken, or columns that are
        not one array per coefficient.
    """
    path = Path(path)
    found = _effects_of(_run(path), path)
    known = set(catalogue())
    for effect in found:
        if effect.id in known:
            raise UsageError(f"{path}: effect '{effect.id}' is there already", "give it another id")
        known.add(effect.id)
        _check_names(effect, path)
        _try_out(effect, path)
    return found


#: A name that TOML, the command line and every table take as it is.
_NAME = re.compile(r"[a-z][a-z0-9_]{0,39}")
#: Verdicts, values of [model] and steps that are no effects.
_TAKEN = ("none", "unknown", "inertia", "delay", "refit", "rest_speed", "effects")


def _check_names(effect: Effect, path: Path) -> None:
    """Ids and parameter names are words that mean nothing else.

    Raises
    ------
    UsageError : says which one is not.
    """
    allowed = "use small letters, digits and _, beginning with a letter, at most 40"
    if not isinstance(effect.id, str) or not _NAME.fullmatch(effect.id):
        raise UsageError(f"{path}: {effect.id!r} is no id of an effect", allowed)
    if effect.id in _TAKEN:
        raise UsageError(f"{path}: an effect cannot be called '{effect.id}'", "that word means something else already")
    if effect.repeats is not None and effect.periods is None:
        raise UsageError(
            f"{path}: effect '{effect.id}': repeats without periods", "several are distinguished by their periods"
        )
    for parameter in effect.parameters:
        if not isinstance(parameter.name, str) or not _NAME.fullmatch(parameter.name):
            raise UsageError(f"{path}: effect '{effect.id}': {parameter.name!r} is no name of a parameter", allowed)


def _run(path: Path) -> ModuleType:
    try:
        source = path.read_text("utf-8")
    except FileNotFoundError:
        raise UsageError(f"{path}: no such file", "--effects-from takes a Python file that defines EFFECT") from None
    except (OSError, UnicodeDecodeError) as error:
        raise UsageError(f"{path}: cannot be read", str(error)) from None
    module = ModuleType(path.stem)
    module.__file__ = str(path)
    try:
        exec(compile(source, str(path), "exec"), module.__dict__)
    except (Exception, SystemExit) as error:
        raise UsageError(f"{path}{_line(error, path)}: {_said(error)}") from None
    return module


def _line(error: BaseException, path: Path) -> str:
    """`:12`, the last line of that file on the way to the error."""
    if isinstance(error, SyntaxError) and error.filename == str(path):
        return f":{error.lineno}"
    lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == str(path)]
    return f":{lines[-1]}" if lines else ""


def _said(error: BaseException) -> str:
    text = error.msg if isinstance(error, SyntaxError) else str(error)
    first = text.splitlines()[0] if text else ""
    return f"{type(error).__name__}: {first}" if first else type(error).__name__


def _effects_of(module: ModuleType, path: Path) -> list[Effect]:
    given = getattr(module, "EFFECTS", None)
    if given is None and hasattr(module, "EFFECT"):
        given = [module.EFFECT]
    if given is None:
        raise UsageError(f"{path}: defines no EFFECT", "write EFFECT = Effect(...), see dsd_cli/effects/gravity.py")
    found = list(given) if isinstance(given, list | tuple) else [given]
    for item in found:
        if not isinstance(item, Effect):
            raise UsageError(f"{path}: EFFECT is of type {type(item).__name__}", "it must be a dsd_cli.effects.Effect")
    return found


#: What a log of a small servo might contain.
_RANGES = Ranges(1.0, 3.0, 6.0, 0.5, 2.0, 1e-3, 10.0)


def _try_out(effect: Effect, path: Path) -> None:
    """One array per coefficient, for rows and for a single instant.

    Raises
    ------
    UsageError : says what came back instead, or what went wrong.
    """
    where = f"{path}: effect '{effect.id}'"
    values: dict[str, Any] = {p.name: [] if not p.numeric else _inside(p.lower, p.upper) for p in effect.parameters}
    rows = np.linspace(-1.0, 1.0, _ROWS)
    channels = Channels(1e-3 * np.arange(_ROWS), rows, rows[::-1].copy(), 0.5 * rows, np.full(_ROWS, 1e-3))
    instant = Channels(*(float(channel[1]) for channel in channels[:5]))
    try:
        coefficients, shape = effect.to_columns(values)
        columns, _ = effect.run(channels, shape)
        single, _ = effect.run(instant, shape)
        back = effect.from_columns(coefficients, shape)
        starts = [dict(start) for start in effect.starts(_RANGES)]
    except Exception as error:
        raise UsageError(f"{path}{_line(error, path)}: effect '{effect.id}': {_said(error)}") from None
    wanted = 1 if effect.role is Role.INPUT else len(coefficients)
    if len(columns) != wanted or len(single) != wanted:
        raise UsageError(
            f"{where}: columns returned {len(columns)} arrays", f"it must be {wanted}, one per coefficient"
        )
    for column in columns:
        if np.shape(column) != (_ROWS,):
            raise UsageError(f"{where}: a column has shape {np.shape(column)}", f"must be that of the rows, ({_ROWS},)")
    if any(np.ndim(column) for column in single):
        raise UsageError(f"{where}: a column is an array where the channels are numbers", "use NumPy functions only")
    _check_inverse(values, back, where)
    unknown = set(effect.needs) - set(Channels._fields)
    if unknown:
        raise UsageError(f"{where}: needs {', '.join(sorted(unknown))}", "channels are " + ", ".join(Channels._fields))
    if any(set(start) != set(shape) for start in starts):
        raise UsageError(
            f"{where}: starts must give a value for {', '.join(shape)}", "starts=lambda ranges: [{...}, ...]"
        )


def _check_inverse(values: Mapping[str, Any], back: Mapping[str, Any], where: str) -> None:
    same = set(values) == set(back) and all(
        values[name] == back[name] if isinstance(values[name], list) else np.isclose(values[name], back[name])
        for name in values
    )
    if not same:
        raise UsageError(f"{where}: join does not undo split", f"{dict(values)} became {dict(back)}")


def _inside(lower: float, upper: float) -> float:
    """A value within the bounds, neither 0 nor a bound if possible."""
    low, high = max(lower, -1.0), min(upper, 1.0)
    return float(low + 0.7 * (high - low)) if low < high else float(np.clip(0.7, lower, upper))
