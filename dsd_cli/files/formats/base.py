"""What every format of recordings gives: groups of channels that were sampled together."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from dsd_cli.errors import DataError, DsdError
from dsd_cli.files.names_in import IN_BRACKETS, bracketed
from dsd_cli.signals.clock import FASTEST, SLOWEST
from dsd_cli.signals.log import Array

#: Metadata: when the recording began, ISO 8601.
RECORDED = "recorded"
#: The name of the stamps that a file keeps by itself, beside its channels.
CLOCK = "t"
#: A matrix with fewer rows than columns, and so many of these, has its signals in its rows.
LONG = 64
#: A matrix with more columns is a picture, or made to fill the memory, and no channels.
MOST_COLUMNS = 1000


@dataclass(frozen=True, eq=False)
class Group:
    """Channels with the same number of rows, and stamps where the file keeps them.

    Attributes
    ----------
    name : "" for channels that belong to nothing.
    rows : of every channel.
    units : channel -> unit as the file says it ("" for none), in the order of the file.
    clock : the file itself stamps the rows, in s; they are read as the channel `CLOCK`.
    """

    name: str
    rows: int
    units: Mapping[str, str]
    clock: bool = False
    handle: Any = None

    def full(self, channel: str) -> str:
        """`group/channel`."""
        return f"{self.name}/{channel}" if self.name else channel


class Container(Protocol):
    """A file that is open for reading.

    Attributes
    ----------
    groups : in the order of the file, those with rows and numbers.
    metadata : provenance; `RECORDED` where the file knows it.
    notes : one sentence each on what the user should know.
    """

    groups: Sequence[Group]
    metadata: dict[str, str]
    notes: list[str]

    def read(self, group: Group, channels: Sequence[str], start: int, rows: int) -> dict[str, Array]:
        """Rows from `start` on as float64, shape (<= rows,); NaN where there is no value, times in s."""


@contextmanager
def understanding(name: str, kind: str) -> Iterator[None]:
    """Whatever a library says about a file becomes one line.

    Raises
    ------
    DataError : the library cannot read it.
    """
    try:
        yield
    except DsdError:
        raise
    except MemoryError:
        told = "is it whole? else take a shorter log"
        raise DataError(f"{name}: there is not enough memory to read it as {kind}", told) from None
    except Exception as error:  # each library has its own kinds, and bare ones of struct, zlib and NumPy besides
        said = (str(error).strip().splitlines() or [""])[0].rstrip(".")
        what = f"{type(error).__name__}: {said}" if said else type(error).__name__
        raise DataError(f"{name}: cannot be read as {kind} ({what})", "is it whole? write it again") from None


def numbers(values: Any) -> Array | None:
    """Values of any kind as float64, times in s; None where they are no numbers."""
    array = np.ma.filled(values.astype(float), np.nan) if isinstance(values, np.ma.MaskedArray) else np.asarray(values)
    if array.dtype.kind in "mM":
        missing = np.isnat(array)
        ticks = array.astype("datetime64[ns]" if array.dtype.kind == "M" else "timedelta64[ns]").astype(np.int64)
        whole, rest = np.divmod(ticks, 1_000_000_000)
        return np.where(missing, np.nan, whole + rest / 1e9)
    if array.dtype.kind in "biuf":
        return np.ascontiguousarray(array, dtype=np.float64)
    return None


def check_size(path: str, size: float) -> None:
    """Refuse what unpacks to more bytes than the machine has memory: a small file can hold very much of nothing.

    Raises
    ------
    DataError : it does.
    """
    try:
        memory = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):  # where nobody says
        return
    if size > memory > 0:
        raise DataError(
            f"{path}: unpacks to {size / 1e9:,.0f} GB, and there are {memory / 1e9:,.0f} GB of memory",
            "write it in pieces, or as Parquet, which is read piece by piece",
        )


#: A field of a struct from so many numbers on is a channel: fewer are gains, or a matrix, of a controller.
FEWEST = 20
#: What a single number is called that is the s between samples: as in an iddata, in what a simulator was set to, by
#: PicoScope.
_SAMPLE_TIMES = {"ts", "dt", "sampletime", "sample_time", "tsample", "timestep", "time_step", "tinterval"}
#: And their number in a second; as `fs` at least this, and not beside what else is called so: static friction.
_RATES = {f"{word}{_}{of}" for word in ("sample", "sampling") for _ in ("", "_") for of in ("rate", "frequency")}
_SHORT_RATE, _SLOWEST_SHORT, _OF_FRICTION = "fs", 50.0, {"fc", "fv", "vs"}


def sample_times_said(values: Mapping[str, Any]) -> set[float]:
    """s between samples that single numbers beside channels say, or how many are in a second."""
    found, called = set[float](), {str(name).lower() for name in values}
    for name, value in ((str(name).lower(), value) for name, value in values.items()):
        if isinstance(value, bool) or not isinstance(value, int | float) or not 0.0 < value <= 1.0 / FASTEST:
            continue
        rate = name in _RATES or (name == _SHORT_RATE and value >= _SLOWEST_SHORT and called.isdisjoint(_OF_FRICTION))
        step = float(value) if name in _SAMPLE_TIMES else 1.0 / value if rate else math.nan
        found |= {step} if FASTEST <= step <= SLOWEST else set()
    return found


def only_one(said: set[float]) -> float | None:
    """The number that all say, a rounded rate beside its step, too; None where they differ, or there is none."""
    return min(said) if said and max(said) - min(said) < 1e-6 * min(said) else None


def lies_in_rows(shape: tuple[int, ...]) -> bool:
    """Whether a matrix has its samples along its columns: there are many, and more than rows."""
    return shape[1] >= LONG and shape[1] > shape[0]


def columns_of(name: str, values: Any) -> dict[str, Array]:
    """The channels in one array: itself, the columns of a matrix as `name/1`, `name/2`, ..., the fields of records.

    A row vector counts as a column, and so do the rows of a wide matrix. Of more dimensions (samples, robots, joints),
    or of Simulink's 1 x 1 x N, the samples are along the longest, and the others number the channels: `name/1/2`. What
    holds no numbers gives nothing.
    """
    array = np.asarray(values) if not isinstance(values, np.ma.MaskedArray) else values
    if array.dtype.names:
        found: dict[str, Array] = {}
        for part in array.dtype.names:
            found |= columns_of(f"{name}/{part}" if name else part, array[part])
        return found
    if array.ndim > 1 and 1 in array.shape:
        array = np.atleast_1d(array.squeeze())
    if array.ndim == 2 and lies_in_rows(array.shape):
        array = array.T
    if array.ndim > 2:
        array = np.moveaxis(array, int(np.argmax(array.shape)), 0)
    if array.ndim == 0 or (array.ndim > 1 and math.prod(array.shape[1:]) > MOST_COLUMNS):
        return {}
    if (column := numbers(array)) is None:
        return {}
    return {
        "/".join([name, *(str(k + 1) for k in at)]): np.ascontiguousarray(column[:, *at])
        for at in np.ndindex(column.shape[1:])
    }


def lists_in(value: Any) -> list[list[str]]:
    """The lists of texts in what a file holds, at any depth: what the columns of a matrix beside them are called."""
    if isinstance(value, Mapping):
        return [one for part in value.values() for one in lists_in(part)]
    if isinstance(value, np.ndarray):
        value = value.tolist() if value.ndim == 1 and value.dtype.kind in "OUS" else []
    if not isinstance(value, list) or not value or not all(isinstance(one, str | bytes) for one in value):
        return []
    return [[one.decode("utf-8", "replace") if isinstance(one, bytes) else one for one in value]]


def named_by(
    channels: Mapping[str, Array], texts: Sequence[Sequence[str]], units: dict[str, str] | None = None
) -> dict[str, Array]:
    """The columns of a matrix, `data/1`, ..., by what a list of as many texts beside it calls them, `data/angle`.

    As they are where several matrices have so many columns, or several lists so many different texts. units : channel
    -> unit, where those that stand in brackets in the texts are put in.
    """
    columns: dict[str, list[str]] = {}
    for full in channels:
        stem, _, at = full.rpartition("/")
        if stem and at.isdigit():
            columns.setdefault(stem, []).append(full)
    lists = [{IN_BRACKETS.sub("", one).strip(): [*bracketed(one), ""][0] for one in said} for said in texts]
    paired = zip(lists, texts, strict=True)
    lists = [said for said, all_of in paired if len(said) == len(all_of) and not any("/" in x or not x for x in said)]
    for stem, mine in columns.items():
        fit = [said for said in lists if len(said) == len(mine)]
        if len(fit) == 1 and [len(one) for one in columns.values()].count(len(mine)) == 1:
            called = dict(zip(mine, fit[0], strict=True))
            channels = {f"{stem}/{called[full]}" if full in called else full: x for full, x in channels.items()}
            (units if units is not None else {}).update({f"{stem}/{name}": unit for name, unit in fit[0].items()})
    return dict(channels)


def grouped(channels: Mapping[str, Array], units: Mapping[str, str] | None = None) -> list[Group]:
    """Channels in memory, named `group/channel`, as groups of the same name and number of rows."""
    parts: dict[tuple[str, int], dict[str, str]] = {}
    for full, values in channels.items():
        group, _, name = full.rpartition("/")
        parts.setdefault((group, values.size), {})[name] = (units or {}).get(full, "")
    return [Group(group, rows, names) for (group, rows), names in parts.items() if rows]


class InMemory:
    """A format whose library reads whole files; see `Container`. sample_time : s between rows, if it says so."""

    sample_time: float | None = None

    def __init__(
        self,
        channels: Mapping[str, Array],
        metadata: dict[str, str] | None = None,
        units: Mapping[str, str] | None = None,
    ) -> None:
        self.groups: Sequence[Group] = grouped(channels, units)
        self.metadata = metadata or {}
        self.notes: list[str] = []
        self._channels = channels

    def read(self, group: Group, channels: Sequence[str], start: int, rows: int) -> dict[str, Array]:
        return {name: self._channels[group.full(name)][start : start + rows] for name in channels}
