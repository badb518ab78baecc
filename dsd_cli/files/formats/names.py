"""Which channels of which groups a config means, and what stamps them."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple

from dsd_cli.errors import DataError
from dsd_cli.files.formats.base import CLOCK, Group
from dsd_cli.files.table_source import choose_columns


class Place(NamedTuple):
    """A channel of a group."""

    group: Group
    channel: str

    @property
    def full(self) -> str:
        return self.group.full(self.channel)


def places(groups: Sequence[Group]) -> list[Place]:
    """Every channel, the stamps that a file keeps by itself included."""
    found = []
    for group in groups:
        found += [Place(group, channel) for channel in group.units]
        if group.clock and CLOCK not in group.units:
            found.append(Place(group, CLOCK))
    return found


def chosen_places(
    source: str, groups: Sequence[Group], columns: Mapping[str, str], optional: Collection[str]
) -> dict[str, Place]:
    """Canonical name -> channel, without the time; a name in several groups is that of the group of u.

    Raises
    ------
    DataError : a needed channel is missing, or is in several groups.
    """
    all_places = places(groups)
    home: Group | None = None
    named: dict[str, Place] = {}
    # u first: the others go by its group
    for canonical in sorted((c for c in columns if c != "t"), key=lambda c: c != "u"):
        found = matches(all_places, columns[canonical])
        near = [place for place in found if place.group is home]
        if len(found) > 1 and len(near) == 1:
            found = near
        if len(found) > 1 and canonical not in optional:
            listed = ", ".join(place.full for place in found[:6])
            raise DataError(
                f'{source}: {len(found)} channels are called "{columns[canonical]}"', f"write which: {listed}"
            )
        if len(found) == 1:
            named[canonical] = found[0]
            home = found[0].group if canonical == "u" else home
    wanted = {c: named[c].full if c in named else column for c, column in columns.items() if c != "t"}
    channels = (place for place in all_places if place.channel in place.group.units)  # the file's own stamps are no u
    kept = choose_columns(source, list(dict.fromkeys(place.full for place in channels)), wanted, optional)
    return {canonical: named[canonical] for canonical in kept if canonical in named}


def matches(all_places: Sequence[Place], text: str) -> list[Place]:
    """Channels of that full name, else those whose full name ends with it."""
    text = text.strip("/")
    exact = [place for place in all_places if place.full == text]
    return exact or [place for place in all_places if place.full.endswith(f"/{text}")]


def stamps_of(source: str, groups: Sequence[Group], of: Place, time: str) -> Place:
    """What stamps the rows of this channel.

    The channel called `time` in its own group or in a group around it; else the one channel that has this name and as
    many rows.

    Raises
    ------
    DataError : there is none.
    """
    all_places, rows = places(groups), of.group.rows
    named = [place for place in matches(all_places, time) if place.group.rows == rows]
    base = time.strip("/").rpartition("/")[2]
    around = of.group.name
    while True:
        here = [
            place
            for place in all_places
            if place.group.rows == rows and place.group.name == around and place.channel == base
        ]
        if here and (not named or around == of.group.name or here[0] in named):
            return next((place for place in here if place.group is of.group), here[0])
        if not around:
            break
        around = around.rpartition("/")[0]
    if len({place.full for place in named}) == 1:
        return named[0]
    if matches(all_places, time):
        raise DataError(
            f'{source}: no time for {of.full}: "{time}" is not in its group, or has not its {rows:,} rows',
            "set [signals] time to the name that the time has in every group",
        )
    choose_columns(source, list(dict.fromkeys(place.full for place in all_places)), {"t": time}, ())
    raise AssertionError("unreachable: there is no such column")
