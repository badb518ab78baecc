"""A log of several joints whose channels are called alike: which belong together, and which joint moves."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from itertools import product
from shlex import quote

import numpy as np

from dsd_cli.errors import DataError
from dsd_cli.files.first_look import FirstLook
from dsd_cli.files.names_in import IN_BRACKETS
from dsd_cli.files.recognise import Recognised, recognise
from dsd_cli.files.tables_in import open_table
from dsd_cli.files.words import ASKED, MEASURED

#: What shows that a joint moves, best first.
MOTION = ("velocity", "position", "d_hat")
#: Rows that are looked at, and joints that a line lists.
ROWS, LISTED = 200_000, 8
#: LeftHip is two words.
_TOKEN = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+|[^\W\d_]|[\W_]+")

_NO_JOINTS = ASKED | MEASURED


def other_joints(path: str, look: FirstLook, told: Collection[str] = ()) -> tuple[set[str], list[str]]:
    """The columns of all joints but one, and which: that of the columns that were `told`, else what moves most.

    Raises
    ------
    DataError : the rows cannot be read.
    """
    joints = joints_of(look.columns, look.found)
    named = [label for label, columns in joints.items() if columns & set(told)]
    away = {label: set().union(*(joints[other] for other in joints if other != label)) for label in joints}
    looks = {label: recognise([one for one in look.columns if one not in away[label]], look.units) for label in joints}
    moves: dict[str, float] = {}
    if named:
        if len(named) == len(joints):  # what the user named is of all: it is no choice between joints
            return set(), []
        best, why = named[0], "as you say"
    else:
        shared = max(MOTION, key=lambda one: sum(one in found for found in looks.values()))
        moving = {label: found[shared].column for label, found in looks.items() if shared in found}
        if not moving:
            return set(), []
        moves = _moves(path, moving)
        best = max(moves, key=lambda label: moves[label])
        most = sorted(moves, key=lambda label: -moves[label])[:LISTED]
        listed = ", ".join(f"{label} {moves[label]:.3g}" for label in moves if label in most) + ", ..." * (
            len(moves) > LISTED
        )
        why = f"it moves most (standard deviation of {shared}: {listed})"
        if len(moving) < 2:
            why = f"it alone has a {shared}"
    nearest = sorted(looks, key=lambda label: -moves.get(label, 0.0))
    others = [looks[label]["u"].column for label in nearest if label != best and "u" in looks[label]]
    another = f"; for another one: --force --u {quote(others[0])}" if others else ""
    mine = set().union(*(joints[label] for label in named or [best]))
    columns = set().union(*joints.values()) - mine - set(told)
    return columns, [f"joint {' and '.join(named or [best])} of {len(joints)}: {why}{another}"]


#: A group of a file that is a trial of several, by its name and number: demo_0, "run 2".
_TRIAL = re.compile(
    r"(?:^|(?<=/))(?:demo|trial|episode|run|rep|take|traj|trajectory|rollout|experiment|test|session)[ _-]?\d+(?=/)",
    re.I,
)


def other_trials(columns: Collection[str], told: Collection[str] = ()) -> tuple[set[str], list[str]]:
    """The columns of all trials but one, that of those that were `told`, else the first, and which.

    Each has the same channels once more, those of all its joints: a number of a trial is none of a joint.
    """
    trials: dict[str, dict[str, str]] = {}
    for column in columns:
        if found := _TRIAL.search(column):
            trials.setdefault(column[: found.end()], {})[column[: found.start()] + column[found.end() :]] = column
    first = next(iter(trials.values()), {})
    alike = {label: mine for label, mine in trials.items() if mine.keys() == first.keys()}
    if len(alike) < 2:
        return set(), []
    best = next((label for label, mine in alike.items() if not set(told).isdisjoint(mine.values())), next(iter(alike)))
    why = "as you say" if best != next(iter(alike)) else "the first; name columns of another one to take that"
    away = {column for label, mine in alike.items() if label != best for column in mine.values()}
    return away, [f"{best} of {len(alike)} trials: {why}"]


def joints_of(columns: Sequence[str], found: Mapping[str, Recognised]) -> dict[str, set[str]]:
    """Joint -> its columns: names that are alike but for the joint's, both for u and for what moves.

    >>> joints_of(["effort/a", "effort/b", "speed/a", "speed/b"], ...)  # {"a": {"effort/a", "speed/a"}, "b": ...}
    """
    best: dict[str, set[str]] = {}
    motion = [found[channel].column for channel in MOTION if channel in found]
    for channel in ("u", *MOTION) if "u" in found else ():
        for labels in _families([found[channel].column, *found[channel].equals]) if channel in found else ():
            joints = _joints(columns, labels, motion)
            of_u = channel == "u" or any(found["u"].column in mine for mine in joints.values())
            best = joints if of_u and len(joints) > len(best) else best
        if best:
            break
    return best


def _joints(columns: Sequence[str], labels: Sequence[str], motion: Sequence[str]) -> dict[str, set[str]]:
    """The same of joints with these labels, and of those with other numbers that move; {}: less than two do."""
    if not any(_put(one, label, label) for one in motion for label in labels):
        return {}
    if all(map(str.isdigit, labels)):
        labels = [*dict.fromkeys([*labels, *(x for one in motion for x in _numbers(one, labels, columns))])]
    known = set(columns)
    joints: dict[str, set[str]] = {label: set() for label in labels}
    for column, label in product(columns, labels):
        if any(_put(column, label, other) & known for other in labels if other != label):
            joints[label].add(column)
    for label, column in _single(columns, joints):
        joints[label].add(column)
    moving = {label for label in labels if any(_in_family(one, labels, label, joints[label]) for one in motion)}
    if len(moving) < 2:
        return {}
    return joints if all(map(str.isdigit, labels)) else {label: joints[label] for label in labels if label in moving}


def _single(columns: Sequence[str], joints: Mapping[str, Collection[str]]) -> list[tuple[str, str]]:
    """(joint, column) of columns that only one joint has: called after it where what is alike for all joints is.

    J2.Vel beside J1.Pos and J2.Pos, also where there is no J1.Vel.
    """
    places = {label: set().union(*(_around(one, label) for one in mine)) for label, mine in joints.items()}
    shared = set().union(*places.values())
    found = []
    for column in set(columns).difference(*joints.values()):
        mine = [label for label in joints if _around(column, label) & shared]
        found += [(mine[0], column)] if len(mine) == 1 else []
    return found


def _around(column: str, label: str) -> set[tuple[bool, str]]:
    """What stands before a label in a name, and what behind it, without units: where either is alike, so is the place
    of the label."""
    name = IN_BRACKETS.sub("", column).strip()
    tokens, words = _TOKEN.findall(name), _TOKEN.findall(label)
    at_all = [at for at in range(len(tokens) - len(words) + 1) if tokens[at : at + len(words)] == words]
    before = {(True, "".join(tokens[:at])) for at in at_all}
    return before | {(False, "".join(tokens[at + len(words) :])) for at in at_all}


def _numbers(column: str, labels: Sequence[str], columns: Sequence[str]) -> list[str]:
    """The numbers of columns that are called as this one is but for a number that is one of the labels."""
    tokens = _TOKEN.findall(column)
    parts = [("".join(tokens[:at]), "".join(tokens[at + 1 :])) for at, one in enumerate(tokens) if one in labels]
    found = (re.fullmatch(f"{re.escape(a)}(\\d+){re.escape(b)}", one) for a, b in parts for one in columns)
    return [one[1] for one in found if one]


def apart(columns: Collection[str], one: str, other: str) -> str:
    """The counterpart of `one` that is of the joint of `other`, where their names make them of two; "": they do not."""
    of_one, of_other = (_TOKEN.findall(name) for name in (one, other))
    for a, b in product(of_one, of_other):
        mine = _put(one, a, b) & set(columns) - {one, other}
        if not mine or a.lower() in _NO_JOINTS or not _put(other, b, a) & set(columns) - {one, other}:
            continue
        left = set(_TOKEN.findall(min(mine))) ^ set(of_other)  # the quantities: m2 and enc4 differ in 2 and 4
        if not all(word.isdigit() or word.lower() in _NO_JOINTS for word in left):
            return min(mine)
    return ""


def numbered_as(column: str, columns: Collection[str]) -> tuple[str, ...]:
    """Columns that are called as this one is but for numbers; a number alone is what no header names, and no joint."""
    called = re.sub(r"\d+", "0", column)
    return tuple(one for one in columns if one != column and re.sub(r"\d+", "0", one) == called != "0")


def _in_family(column: str, labels: Sequence[str], label: str, mine: set[str]) -> bool:
    """Whether that column, or its counterpart of another joint, is among those of the joint `label`."""
    return column in mine or any(_put(column, other, label) & mine for other in labels if other != label)


def _families(names: Sequence[str]) -> Iterator[list[str]]:
    """What differs, in whole words, between the first name and others that begin and end as it does, longest first.

    A number differs by numbers only: of Torque1 in Torque2, and not in TorqueSm1.
    """
    split = [_TOKEN.findall(name) for name in names]
    size = len(split[0])
    for same in range(size - 1, -1, -1):
        for begin in range(same + 1):
            end = same - begin
            of_first = split[0][:begin] + split[0][size - end :]
            alike = [one for one in split if len(one) > same and one[:begin] + one[len(one) - end :] == of_first]
            labels = ["".join(one[begin : len(one) - end]) for one in alike]
            labels = [one for one in labels if one.isdigit() or not labels[0].isdigit()]
            if len(labels) > 1:
                yield labels


def _put(column: str, label: str, other: str) -> set[str]:
    """The name with `other` in the place of `label`, at each place where that stands as whole words."""
    if label not in column:
        return set()
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
