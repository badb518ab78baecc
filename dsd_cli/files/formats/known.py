"""Which format a file has, by its content, and what it takes to read it."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from dsd_cli.errors import DataError, UsageError, how_to_install

if TYPE_CHECKING:
    from dsd_cli.files.formats.base import Container, Group
    from dsd_cli.signals.log import Array

#: Bytes that tell every format.
HEAD_BYTES = 4096


class Format(NamedTuple):
    """`kind` for people, `module` and `opener` here, the `libraries` it needs and the extra that installs them."""

    kind: str
    module: str
    opener: str
    libraries: Sequence[str] = ()
    extra: str = ""


NUMPY = Format("a NumPy file", "numpy_file", "NumpyFile")
ARROW = Format("an Arrow file", "arrow_ipc", "ArrowFile")
MAT = Format("a MAT file", "mat", "MatFile")
NETCDF = Format("NetCDF 3", "netcdf", "NetcdfFile")
MAT73 = Format("a MAT file of version 7.3", "hdf5", "Hdf5File", ("h5py",), "hdf5")
HDF5 = Format("HDF5", "hdf5", "Hdf5File", ("h5py",), "hdf5")
MDF = Format("MDF", "mdf", "MdfFile", ("asammdf",), "mf4")
TDMS = Format("TDMS", "tdms", "TdmsFile", ("nptdms",), "tdms")
MCAP = Format("MCAP", "mcap_file", "McapFile", ("mcap",), "mcap")
BAG = Format("a ROS bag", "ros_bag", "RosBag", ("rosbags",), "ros")
SQLITE = Format("an SQLite database", "sqlite_file", "SqliteFile")
JSON = Format("JSON", "json_file", "JsonFile")
CODESYS = Format("a trace of CODESYS", "codesys", "CodesysTrace")
OCTAVE = Format("text of Octave's save", "octave_text", "OctaveText")
SCOPE = Format("text of a scope", "scope", "ScopeFile")
PAIRS = Format("lines of names with values", "pairs", "PairsFile")
TELEPLOT = Format("samples for Teleplot", "pairs", "TeleplotFile")
#: What only the rows say, and so nobody asks until a column is missing.
LONG = Format("a table with a row for each value", "long_form", "LongFile")

FORMATS = (
    *(NUMPY, ARROW, MAT, NETCDF, MAT73, HDF5, MDF, TDMS, MCAP, BAG, SQLITE),
    *(JSON, CODESYS, OCTAVE, SCOPE, PAIRS, TELEPLOT),
)

_MAGIC = (
    (b"\x93NUMPY", NUMPY),
    (b"ARROW1", ARROW),
    (b"FEA1", ARROW),
    (b"\xff\xff\xff\xff", ARROW),
    (b"MATLAB 7.3", MAT73),
    (b"MATLAB 5.0", MAT),
    (b"\x89HDF\r\n\x1a\n", HDF5),
    (b"CDF\x01", NETCDF),
    (b"CDF\x02", NETCDF),
    (b"MDF     ", MDF),
    (b"# Created by Octave", OCTAVE),
    (b"UnFinMF ", MDF),
    (b"TDSm", TDMS),
    (b"\x89MCAP0\r\n", MCAP),
    (b"#ROSBAG V", BAG),
    (b"SQLite format 3\0", SQLITE),
)
#: Names of bags end so, of ROS 2 databases of SQLite.
_BAGS = (".bag", ".db3")


def format_of(path: str | Path, head: bytes) -> Format | None:
    """The format of a file that begins with `head` (`HEAD_BYTES`), or of a folder; None: none of these."""
    from dsd_cli.files.formats.pairs import are_pairs, is_teleplot
    from dsd_cli.files.formats.scope import is_scope

    if is_bag(path):
        return BAG
    if any(head[at : at + 8] == b"\x89HDF\r\n\x1a\n" for at in (512, 1024, 2048)):
        return MAT73 if head.startswith(b"MATLAB") else HDF5  # some call themselves 5.0
    for magic, found in _MAGIC:
        if head.startswith(magic) and (found is not BAG or Path(path).suffix.lower() in _BAGS):
            return BAG if found is SQLITE and Path(path).suffix.lower() in _BAGS else found
    if head.startswith(b"PK\x03\x04") and _holds_arrays(path):
        return NUMPY
    # version 4 has no mark but a small type number, of a thousand and more where the high bytes come first
    if Path(path).suffix.lower() == ".mat" and (
        head[1:4] in (b"\0\0\0", b"\x03\0\0") or (head[:2] == b"\0\0" and head[2:3] in (b"\3", b"\4"))
    ):
        return MAT
    text = head.removeprefix(b"\xef\xbb\xbf").lstrip()
    if [cell.strip() for cell in text.partition(b"\n")[0].split(b";")] == [b"[key]", b"[value]"]:
        return CODESYS
    if text[:1] in (b"{", b"[") and not text.startswith(b"{'"):  # the latter is how Python prints it
        return PAIRS if are_pairs(head) else None if _is_units_first(text) else JSON  # `[   1.250] axis: q=1.25 tau=2`
    if is_teleplot(head):
        return TELEPLOT
    if is_scope(path, head):
        return SCOPE
    return PAIRS if are_pairs(head) else None


def _is_units_first(first: bytes) -> bool:
    """Whether a text that begins with a bracket is a table whose first column is called so, `[s],[V]`."""
    return (
        first[:1] == b"["
        and first[1:].lstrip()[:1] not in (b"{", b"[", b"]", b'"', b"-", b"n", b"")[:-1]
        and not (first[1:].lstrip()[:1].isdigit())
    )


def is_bag(path: str | Path) -> bool:
    """Whether it is the folder that `ros2 bag record` writes."""
    try:
        return (Path(path) / "metadata.yaml").is_file()
    except (OSError, ValueError):
        return False


def _holds_arrays(path: str | Path) -> bool:
    import zipfile

    try:
        with zipfile.ZipFile(path) as archive:
            return any(name.endswith(".npy") for name in archive.namelist())
    except (zipfile.BadZipFile, NotImplementedError):  # cut off, or of a version that there is not
        return Path(path).suffix.lower() == ".npz"
    except OSError:
        return False


def open_container(path: str | Path, found: Format, scaled: bool | None = None) -> Container:
    """A file of that format; `scaled`: see `Scaling`, of a text of a scope.

    Raises
    ------
    UsageError : a library that it needs is not installed.
    DataError : it cannot be read, or has nothing in it that could be a channel.
    """
    missing = [library for library in found.libraries if find_spec(library) is None]
    if missing:
        raise UsageError(f"{path}: is {found.kind}, and {missing[0]} is not installed", how_to_install(found.extra))
    from dsd_cli.files.formats.base import understanding

    with understanding(str(path), found.kind):
        opener = getattr(import_module(f"dsd_cli.files.formats.{found.module}"), found.opener)
        opened: Container = opener(str(path), scaled) if found is SCOPE else opener(str(path))
    if not opened.groups:
        raise DataError(f"{path}: no channel with numbers in it", "; ".join(opened.notes))
    return _Understood(opened, str(path), found.kind)


class _Understood:
    """A container whose library may find out late, in a row, that it cannot read the file."""

    def __init__(self, container: Container, name: str, kind: str) -> None:
        self.groups, self.metadata, self.notes = container.groups, container.metadata, container.notes
        self.sample_time: float | None = getattr(container, "sample_time", None)
        self._container, self._name, self._kind = container, name, kind

    def read(self, group: Group, channels: Sequence[str], start: int, rows: int) -> dict[str, Array]:
        from dsd_cli.files.formats.base import understanding

        with understanding(self._name, self._kind):
            return self._container.read(group, channels, start, rows)
