"""A log of several joints whose channels are called alike: which belong together, and which joint moves."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from dsd_cli.errors import DataError
from dsd_cli.files.first_look import FirstLook
from dsd_cli.files.recognise import Recognised, recognise
from dsd_cli.files.tables_in import open_table

#: What shows that a joint moves, best first.
MOTION = ("velocity", "position", "d_hat")
#: Rows that are looked at.
ROWS = 200_000
_TOKEN = re.compile(r"[^\W\d_]+|\d+|[\W_]+")


def joint_that_moves(path: str, look: FirstLook) -> tuple[FirstLook, list[str]]:
    """The look with the channels of the joint that moves most, and what was chosen; as it is where there is one joint.

    Raises
    ------
    DataError : the rows cannot be read.
    """
    joints = joints_of(look.columns, look.found)
    if len(joints) < 2:
        return look, []
    columns = {}
    for label in joints:
        others = {column for other, theirs in joints.items() if other != label for column in theirs}
        columns[label] = tuple(column for column in look.columns if column not in others)
    looks = {label: recognise(mine, look.units) for label, mine in columns.items()}
    complete = [one for one in MOTION if all(one in found for found in looks.values())]
    looks = {label: found for label, found in looks.items() if "u" in found}
    if not complete or len(looks) < 2:
        return look, []
    channel = complete[0]
    moves = _moves(path, {label: found[channel].column for label, found in looks.items()})
    best = max(looks, key=lambda label: moves[label])
    listed = ", ".join(f"{label} {moves[label]:.3g}" for label in looks)
    why = f"it moves most (standard deviation of {channel}: {listed}); another is yours to name"
    found = {name: one for name, one in looks[best].items() if name in look.found}
    return replace(look, found=found, columns=columns[best]), [f"joint {best} of {len(looks)}: {why}"]


def joints_of(columns: Sequence[str], found: Mapping[str, Recognised]) -> dict[str, set[str]]:
    """Joint -> its columns: names that are alike but for the joint's, both for u and for what moves.

    >>> joints_of(["effort/a", "effort/b", "speed/a", "speed/b"], ...)  # {"a": {"effort/a", "speed/a"}, "b": ...}
    """
    if "u" not in found:
        return {}
    labels = _middles([found["u"].column, *found["u"].equals])
    motion = [found[channel].column for channel in MOTION if channel in found]
    known = set(columns)
    joints: dict[str, set[str]] = {label: set() for label in labels}
    for column in columns:
        for label in labels:
            if any(_swapped(column, label, other) & known for other in labels if other != label):
                joints[label].add(column)
    shown = {
        label: mine for label, mine in joints.items() if any(_in_family(one, labels, label, mine) for one in motion)
    }
    return shown if len(shown) > 1 else {}


def _in_family(column: str, labels: Sequence[str], label: str, mine: set[str]) -> bool:
    """Whether that column, or its counterpart of another joint, is among those of the joint `label`."""
    return column in mine or any(_swapped(column, other, label) & mine for other in labels if other != label)


def _middles(names: Sequence[str]) -> list[str]:
    """What differs between names that begin and end alike, in whole words; nothing where one has no such word."""
    split = [_TOKEN.findall(name) for name in names]
    if len(split) < 2:
        return []
    shortest = min(len(tokens) for tokens in split)
    begin = 0
    while begin < shortest and len({tokens[begin] for tokens in split}) == 1:
        begin += 1
    end = 0
    while end < shortest - begin and len({tokens[-1 - end] for tokens in split}) == 1:
        end += 1
    found = ["".join(tokens[begin : len(tokens) - end]) for tokens in split]
    return found if all(found) else []


def _swapped(column: str, label: str, other: str) -> set[str]:
    """The name with `label` replaced by `other`, at each place where it stands as whole words."""
    tokens, words = _TOKEN.findall(column), _TOKEN.findall(label)
    return {
        "".join([*tokens[:at], other, *tokens[at + len(words) :]])
        for at in range(len(tokens) - len(words) + 1)
        if tokens[at : at + len(words)] == words
    }


def _moves(path: str, columns: Mapping[str, str]) -> dict[str, float]:
    """Label -> standard deviation of its column over the first rows; 0 without values."""
    try:
        return _spread(path, columns)
    except DataError:  # groups with different numbers of rows cannot be read side by side without their stamps
        return {label: _spread(path, {label: column})[label] for label, column in columns.items()}


def _spread(path: str, columns: Mapping[str, str]) -> dict[str, float]:
    parts: dict[str, list[np.ndarray]] = {label: [] for label in columns}
    rows = 0
    for batch in open_table(path, columns).batches():
        for label in columns:
            parts[label].append(batch.columns[label])
        rows += batch.rows
        if rows >= ROWS:
            break
    out = {}
    for label, found in parts.items():
        values = np.concatenate(found) if found else np.empty(0)
        values = values[np.isfinite(values)]
        out[label] = float(np.std(values)) if values.size else 0.0
    return out
