"""Values of [model] put in place in the text of a config: changed, added under a header of their own, or taken out."""

from __future__ import annotations

import tomllib
from collections.abc import Collection, Mapping, Sequence

from dsd_cli.files.config.rules import Place, read_section
from dsd_cli.files.config.signals import Signals
from dsd_cli.files.config.toml_text import Path, Statement, inline, leaves, statements
from dsd_cli.signals.units import Units

#: Keys of [signals] that name units.
_UNITS = ("u_unit", "position_unit", "velocity_unit", "counts_per_turn", "counts_per_metre")


def with_raws(text: str, wanted: Mapping[Path, str], keep_header: bool = True) -> str:
    """The text with exactly these leaves in [model]."""
    all_of_it, placed = statements(text), set()  # type: tuple[list[Statement], set[Path]]
    gone, pieces = set(), {}  # type: tuple[set[int], dict[int, str]]
    arrays = _arrays_as_they_are(text, all_of_it, wanted)
    placed |= arrays
    for i, s in enumerate(all_of_it):
        if s.path[:1] != ("model",) or any(s.path[: len(path)] == path for path in arrays):
            continue
        below = {path[len(s.path) :]: raw for path, raw in wanted.items() if path[: len(s.path)] == s.path}
        if s.kind == "=" and (below or (len(s.path) < 3 and s.raw(text).startswith("{"))):
            placed |= {(*s.path, *path) for path in below}
            pieces[i] = text[s.start : s.value[0]] + _new_raw(s.raw(text), below) + text[s.value[1] : s.end]
        elif (
            s.kind == "="
            or (len(s.path) >= 3 and not below)
            or (s.path == ("model",) and _is_bare(text, all_of_it, i, wanted) and (below or not keep_header))
        ):
            gone |= _with_its_comments(all_of_it, i)
    missing = {path: raw for path, raw in wanted.items() if path not in placed}
    _insert(text, all_of_it, pieces, missing)
    return without(text, all_of_it, gone, pieces)


def _is_bare(text: str, all_of_it: Sequence[Statement], i: int, wanted: Mapping[Path, str]) -> bool:
    """Whether a header stands alone and has nothing of its own below it: `[model]` as `_insert` writes it."""
    if text[all_of_it[i].start : all_of_it[i].end].strip() != "[model]":
        return False
    for s in all_of_it[i + 1 :]:
        if s.kind in ("[", "[["):
            break
        if s.kind == "#":  # below our values it belongs to what follows
            return all_of_it[i + 1].kind == "="
        if s.path in wanted:
            return False
    return True


def _arrays_as_they_are(text: str, all_of_it: Sequence[Statement], wanted: Mapping[Path, str]) -> set[Path]:
    """Leaves written as [[...]] tables whose value is still right."""
    old = leaves(tomllib.loads(text))
    arrays = {s.path for s in all_of_it if s.kind == "[[" and s.path in wanted}
    return {path for path in arrays if old[path] == tomllib.loads(f"x = {wanted[path]}")["x"]}


def _new_raw(raw: str, below: Mapping[Path, str]) -> str:
    """The value that stood there, if it is still right; inline tables are written anew."""
    new = below[()] if () in below else inline(below)
    return raw if tomllib.loads(f"x = {raw}") == tomllib.loads(f"x = {new}") else new


def _with_its_comments(all_of_it: Sequence[Statement], i: int) -> set[int]:
    """A header and the blank line above it; or an assignment of an effect and the comment lines down to it."""
    gone = {i}
    if all_of_it[i].kind == "[":
        return gone | ({i - 1} if i and all_of_it[i - 1].kind == "" else set())
    above = i - 1
    while len(all_of_it[i].path) >= 4 and above >= 0 and all_of_it[above].kind == "#":
        gone.add(above)
        above -= 1
    return gone


def _insert(text: str, all_of_it: Sequence[Statement], pieces: dict[int, str], missing: Mapping[Path, str]) -> None:
    """Put what [model] lacks behind its parts, each under its own header."""
    end = newline(text)
    scalars = "".join(f"{path[-1]} = {raw}{end}" for path, raw in missing.items() if len(path) == 2)
    blocks = _effect_blocks({path: raw for path, raw in missing.items() if len(path) > 2}, end, _units(text))
    header = next((i for i, s in enumerate(all_of_it) if s.kind == "[" and s.path == ("model",)), None)
    dotted = next((i for i, s in enumerate(all_of_it) if s.kind == "=" and s.path[:1] == ("model",)), None)
    if scalars and header is not None:
        _add(text, all_of_it, pieces, header, scalars, end)
    elif scalars and dotted is not None and not any(s.kind != "=" for s in all_of_it[:dotted] if s.path):
        _add(text, all_of_it, pieces, dotted, "".join(f"model.{x}{end}" for x in scalars.splitlines()), end)
    elif scalars:
        blocks = f"{end}[model]{end}{scalars}" + blocks
    if blocks:
        _add(text, all_of_it, pieces, _last_of_model(all_of_it), blocks, end)


def _add(text: str, all_of_it: Sequence[Statement], pieces: dict[int, str], i: int, more: str, end: str) -> None:
    """`more` behind statement i, on a line of its own; i = -1 is the end of an empty text."""
    here = pieces.get(i, text[all_of_it[i].start : all_of_it[i].end] if i >= 0 else "")
    pieces[max(i, 0)] = here + (end if here and not here.endswith("\n") else "") + more


def _last_of_model(all_of_it: Sequence[Statement]) -> int:
    """The last line that belongs to [model]: comments after its last key do, unless a header follows them directly."""
    headers = [i for i, s in enumerate(all_of_it) if s.kind in ("[", "[[") and s.path[0] == "model"]
    if not headers:
        return len(all_of_it) - 1
    last = headers[-1]
    for i, s in enumerate(all_of_it[last + 1 :], last + 1):
        if s.kind in ("[", "[["):
            break
        if s.kind == "=":
            last = i
    below = last + 1
    while below < len(all_of_it) and all_of_it[below].kind == "#":
        below += 1
    directly = below < len(all_of_it) and all_of_it[below].kind in ("[", "[[")
    return last if directly else below - 1


def _units(text: str) -> Units:
    """As [signals] names them; nothing else of the config needs to be right here."""
    written = tomllib.loads(text).get("signals", {})
    return read_section(Signals, {k: v for k, v in written.items() if k in _UNITS}, Place("", "signals")).units


def _effect_blocks(missing: Mapping[Path, str], end: str, units: Units) -> str:
    """`[model.effects.<id>]` with one comment per parameter."""
    from dsd_cli.effects import get_effect

    lines: list[str] = []
    for effect_id in dict.fromkeys(path[2] for path in missing):
        lines += ["", f"[model.effects.{effect_id}]"]
        for p in get_effect(effect_id).parameters:
            raw = missing.get(("model", "effects", effect_id, p.name))
            if raw is not None:
                unit = f" [{units.words(p.unit)}]" if p.unit else ""
                lines += [f"# {p.meaning}{unit}", f"{p.name} = {raw}"]
    return "".join(line + end for line in lines)


def without(
    text: str, all_of_it: Sequence[Statement], gone: Collection[int], pieces: Mapping[int, str] | None = None
) -> str:
    """The text without some statements, and with others replaced."""
    new = pieces or {}
    if not all_of_it:
        return "".join(new.values())
    kept = (new.get(i, text[s.start : s.end]) for i, s in enumerate(all_of_it) if i not in gone)
    return "".join(kept)


def newline(text: str) -> str:
    """The line end of this file."""
    return "\r\n" if "\r\n" in text else "\n"
