"""The section [signals] of `dsd.toml`: which column of a log is what, in which unit, and which of its rows are read."""

from __future__ import annotations

import math
from collections.abc import Mapping
from copy import copy
from typing import Any, ClassVar, Literal

from dsd_cli.files.config.rules import Place, Rule, Section, choice, factor, key, number, shown, span, text
from dsd_cli.files.csv_layout import CsvLayout
from dsd_cli.files.recognise import names_force
from dsd_cli.signals.units import POSITION, SHORTEST, VELOCITY, Units


def _column(default: str, meaning: str) -> Any:
    rule = Rule('a column name in quotes, "" for none', _read_column)
    return key(rule, f"column with {meaning}", default=default)


def _read_column(value: Any, at: Place) -> str | None:
    if not isinstance(value, str):
        raise at.wrong(value, 'a column name in quotes, "" for none')
    return value or None


def _control_input() -> Rule:
    """A column that must be there; "" is what `dsd init` leaves where it could not say which."""

    def read(value: Any, at: Place) -> str:
        if value == "":
            how = f"name it, for example --set {at.path}=NAME (dsd columns LOG lists them)"
            raise at.refused(value, f"no column given: {how}")
        return str(text().read(value, at))

    return Rule("a text", read)


def _between_rows() -> Rule:
    """A time that must be there; 0 is what `dsd init` leaves where it could not say how long it is."""
    whole = number(lower=SHORTEST)

    def read(value: Any, at: Place) -> float:
        if value == 0 and not isinstance(value, bool):
            raise at.refused(value, f"the time between rows is not given: say it, for example --set {at.path}=0.001")
        return float(whole.read(value, at))

    return Rule(whole.allowed, read)


def _unit() -> Rule:
    def read(value: Any, at: Place) -> str:
        if not isinstance(value, str) or len(value) > 20 or not value.isprintable():
            raise at.wrong(value, 'a short text in quotes, such as "N m"')
        return value.strip()

    return Rule("a short text", read)


def _edge() -> Rule:
    finite = number()

    def read(value: Any, at: Place) -> float:
        return value if isinstance(value, float) and math.isinf(value) else float(finite.read(value, at))

    return Rule("a number, or inf", read)


def _range(channel: str) -> Any:
    return key(
        span(), f"smallest and largest value of {channel} that there can be; other rows are dropped", default=None
    )


#: A unit that nothing says: the column is read as SI, and what depends on that is said so. A velocity follows the
#: position, once its unit is said.
UNKNOWN = "unknown"


class Signals(Section):
    """[signals]: which column of the log is what. `None` is a channel that shall not be looked for."""

    time: str | None = _column("t", "the time of the sample")
    sample_time: float | None = key(
        _between_rows(), "time between samples, for logs without a time column", "s", default=None
    )
    time_unit: Literal["s", "ms", "us", "ns", "100ns"] = key(
        choice("s", "ms", "us", "ns", "100ns"), "unit of the time column", default="s"
    )
    u: str = key(_control_input(), "column with the control input", default="u")
    d_hat: str | None = _column("d_hat", "the observed disturbance, in the unit of u")
    velocity: str | None = _column("velocity", "the velocity")
    position: str | None = _column("position", "the position")
    reference: str | None = _column("reference", "the reference")
    true_delay: str | None = _column("true_delay", "the true delay of a simulated log")
    true_inertia: str | None = _column("true_inertia", "the true inertia of a simulated log")
    u_sign: Literal[1, -1] = key(choice(1, -1), "-1 turns the sign of the control input", default=1)
    u_scale: float = key(
        number(above=0), "factor: what the columns u and d_hat hold, times this, is in the unit of u", default=1.0
    )
    u_offset: float = key(
        number(), "what the column u holds where u is 0, in its own unit; taken off before all else", default=0.0
    )
    velocity_offset: float = key(
        number(), "what the column velocity holds at rest, in its own unit; taken off before all else", default=0.0
    )
    velocity_scale: float = key(
        factor(), "factor: what the column velocity holds, times this, is rad/s or m/s; negative turns it", default=1.0
    )
    position_scale: float = key(
        factor(), "factor: what the columns position and reference hold, times this, is rad or m", default=1.0
    )
    u_unit: str = key(_unit(), "unit of u (with its factor), such as N, N m or A; names it in every result", default="")
    position_unit: str = key(
        choice("", *POSITION),
        'unit of the columns position and reference; they are read as rad or m, and taken as that if "unknown"',
        default="",
    )
    velocity_unit: str = key(
        choice("", *VELOCITY),
        'unit of the column velocity; it is read as rad/s or m/s; "unknown": that of the position, per s',
        default="",
    )
    counts_per_turn: float | None = key(number(above=0), "counts to a turn, for counts of a rotary axis", default=None)
    counts_per_metre: float | None = key(number(above=0), "counts to a metre, of a linear one", default=None)
    u_hold: Literal["held", "sampled"] = key(
        choice("held", "sampled"),
        "how u lives between samples: held by a drive until the next one, or sampled from a continuous signal",
        default="held",
    )
    u_shift: float = key(
        number(lower=-1e4, upper=1e4),
        "moves u in time; below 0 where it was logged that much later than it acted",
        "s",
        default=0.0,
    )
    u_filter: float = key(
        number(lower=0.0, upper=1e4),
        "time constant of a first-order low-pass that u was logged behind, which is undone; 0: none",
        "s",
        default=0.0,
    )
    start: float = key(_edge(), "rows before this time are not read (--from)", "s", default=-math.inf)
    end: float = key(_edge(), "rows after this time are not read (--to)", "s", default=math.inf)
    u_range: tuple[float, float] | None = _range("u")
    d_hat_range: tuple[float, float] | None = _range("d_hat")
    velocity_range: tuple[float, float] | None = _range("velocity")
    position_range: tuple[float, float] | None = _range("position")
    outlier_factor: float = key(
        number(lower=10),
        "a row is dropped where a channel is more than this many times what it reached in 8 of 64 rows so far "
        "(at least one unit)",
        default=1e5,
    )

    layout: ClassVar[CsvLayout] = CsvLayout()

    def __init__(self, **values: Any) -> None:
        if values.get("sample_time") is not None:
            values.setdefault("time", None)
        if values.get("counts_per_turn") or values.get("counts_per_metre"):
            values |= _in_counts(values)
        super().__init__(**values)

    def check(self, at: Place) -> None:
        if self.time is not None and self.sample_time is not None:
            raise at.child("sample_time").wrong(
                self.sample_time, f"left out, or {at.child('time').path} is: one of them"
            )
        if self.time is None and self.sample_time is None:
            raise at.missing("sample_time", 'time = "" says there is no time column, then sample_time (s) is needed')
        self._check_units(at)
        if not self.start < self.end:
            raise at.child("end").wrong(self.end, f"after {at.child('start').path} = {self.start:g}")
        columns = self.columns()
        for channel, column in columns.items():
            twin = next(c for c in columns if columns[c] == column)
            if twin != channel:
                raise at.child(channel).wrong(column, f"another column: {at.child(twin).path} has it already")

    def in_layout(self, layout: CsvLayout) -> Signals:
        """The same, for text files that are laid out as [csv] says."""
        if layout == self.layout:
            return self
        other = copy(self)
        other.__dict__["layout"] = layout
        return other

    def applied(self, written: Mapping[str, Any]) -> dict[str, Any]:
        """[signals] for a log that these have been applied to: its columns are called as ours, in s and SI units."""
        kept = {k: v for k, v in written.items() if k not in _READING and (k not in _COLUMNS or v == "")}
        si = self.units.position
        unit = {"position_unit": si, "velocity_unit": f"{si}/s"} if si else {}
        return kept | ({"position_unit": UNKNOWN} if self.units.assumed else unit)

    def columns(self) -> dict[str, str]:
        """Column of the file by channel (`time` and the rest), without those that shall not be looked for."""
        names = {name: getattr(self, name) for name in self.keys if name in _COLUMNS}
        return {channel: column for channel, column in names.items() if column is not None}

    def factors(self) -> dict[str, float]:
        """What a channel's column is multiplied by when a log is read, without those that are 1.

        d_hat is a force in the unit of u, so that it shares u's scale; its sign is [observer] sign's business.
        """
        position = self.position_scale * self._factor(POSITION, self.position_unit)
        of_velocity = abs(position) if self.velocity_unit == UNKNOWN else self._factor(VELOCITY, self.velocity_unit)
        found = {
            "u": self.u_sign * self.u_scale,
            "d_hat": self.u_scale,
            "velocity": self.velocity_scale * of_velocity,
            "position": position,
            "reference": position,
        }
        return {channel: value for channel, value in found.items() if value != 1.0}

    def offsets(self) -> dict[str, float]:
        """What is taken off a channel's column, in its own unit, without those that are 0."""
        found = {"u": self.u_offset, "velocity": self.velocity_offset}
        return {channel: value for channel, value in found.items() if value != 0.0}

    def _factor(self, table: Mapping[str, tuple[str, float]], unit: str) -> float:
        if unit.startswith("counts"):
            turn = self.counts_per_turn
            return 2.0 * math.pi / turn if turn else 1.0 / (self.counts_per_metre or 1.0)
        return table[unit][1] if unit else 1.0

    @property
    def units(self) -> Units:
        """What tables and pictures call the units."""
        named = [POSITION[self.position_unit][0] if self.position_unit else ""]
        named += [VELOCITY[self.velocity_unit][0] if self.velocity_unit else ""]
        named += ["rad"] if self.counts_per_turn else ["m"] if self.counts_per_metre else []
        position = next(filter(None, named), "")
        open_ones = UNKNOWN in (self.position_unit, self.velocity_unit) and abs(self.position_scale) == 1.0
        return Units(self.u_unit, position, open_ones and not position, not self.u_unit and names_force(self.u))

    def _units_text(self) -> str:
        named = {name: getattr(self, f"{name}_unit") for name in ("position", "velocity")}
        return " and ".join(f"{name}_unit is {shown(unit)}" for name, unit in named.items() if unit)

    def _check_units(self, at: Place) -> None:
        for name in ("position", "velocity"):
            unit, scale = getattr(self, f"{name}_unit"), getattr(self, f"{name}_scale")
            if unit not in ("", UNKNOWN) and abs(scale) != 1.0:
                raise at.child(f"{name}_scale").wrong(scale, f"1 or -1: {name}_unit = {shown(unit)} has its factor")
            if unit.startswith("counts") and not (self.counts_per_turn or self.counts_per_metre):
                raise at.missing("counts_per_turn", f"{name}_unit = {shown(unit)} needs it, or counts_per_metre")
        if self.counts_per_turn and self.counts_per_metre:
            raise at.child("counts_per_metre").wrong(self.counts_per_metre, "left out: counts_per_turn is given")
        used = any(unit.startswith("counts") for unit in (self.position_unit, self.velocity_unit))
        if not used and (self.counts_per_turn or self.counts_per_metre):
            name = "counts_per_turn" if self.counts_per_turn else "counts_per_metre"
            raise at.child(name).wrong(getattr(self, name), f"left out: {self._units_text()}, not counts")
        kinds = {POSITION.get(self.position_unit, ("",))[0], VELOCITY.get(self.velocity_unit, ("",))[0]} - {""}
        if len(kinds) > 1:
            found = f"position_unit is {shown(self.position_unit)}"
            raise at.child("velocity_unit").wrong(self.velocity_unit, f"of the same kind: {found}")


def _in_counts(values: Mapping[str, Any]) -> dict[str, str]:
    """What the counts of an encoder are the unit of, where nothing else says it: the position, else the velocity."""
    position, velocity = values.get("position_unit", ""), values.get("velocity_unit", "")
    if values.get("position", "") is None:
        return {"velocity_unit": "counts/s"} if velocity in ("", UNKNOWN) else {}
    open_one = position == UNKNOWN or (position == "" and not velocity.startswith("counts"))
    return {"position_unit": "counts"} if open_one else {}


#: Keys of [signals] that say how a column is read, and those that name one.
_READING = (
    *("sample_time", "time_unit", "u_sign", "u_scale", "u_offset", "u_shift", "u_filter"),
    *("velocity_scale", "velocity_offset", "position_scale"),
    *("position_unit", "velocity_unit", "counts_per_turn", "counts_per_metre"),
)
COLUMNS = ("time", "u", "d_hat", "velocity", "position", "reference")
_COLUMNS = (*COLUMNS, "true_delay", "true_inertia")
