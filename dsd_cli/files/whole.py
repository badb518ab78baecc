"""Files that appear whole or not at all, whatever ends the process.

A file is written beside its target under a hidden name, `.<target>.<pid>.tmp`, and takes the target's name when it is
complete. The writer holds a lock on it: one that can be locked was left by a process that was killed, and goes.
"""

from __future__ import annotations

import contextlib
import os
import stat
import zlib
from collections.abc import Iterable, Iterator
from pathlib import Path

from dsd_cli.errors import DataError, UsageError

STREAM = "-"
#: Names up to this length, in bytes, are part of the temporary name; of others, and of odd ones, a checksum is.
_LONGEST = 100
#: Files that have neither taken their name nor been given up; what is left of them when a command ends goes.
_UNFINISHED: set[WholeFile] = set()


class WholeFile:
    """Write to `path`, then `commit` or `abort`. A device or a FIFO is never replaced: `path` is the thing itself.

    Raises
    ------
    DataError : it cannot be written.
    """

    def __init__(self, target: str | Path) -> None:
        self.target = self.path = Path(os.path.realpath(target))
        self._lock = -1
        mode = _mode(self.target)
        self.replaces = mode is None or stat.S_ISREG(mode)
        if not self.replaces:
            return
        _UNFINISHED.add(self)
        try:
            remove_left_over(self.target)
            self._create(0o666 if mode is None else stat.S_IMODE(mode), exact=mode is not None)
        except OSError as error:
            self.abort()
            raise cannot_be_written(target, error) from None
        except BaseException:
            self.abort()
            raise

    def _create(self, mode: int, exact: bool) -> None:
        """A new file: never through a link that somebody has put there. `exact`: the mode of the file it replaces."""
        stem = _stem(self.target)
        for attempt in range(100):
            self.path = self.target.with_name(f".{stem}.{os.getpid()}{f'-{attempt}' if attempt else ''}.tmp")
            with contextlib.suppress(FileExistsError):
                self._lock = os.open(self.path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode)
                _locked(self._lock)
                if exact:
                    os.fchmod(self._lock, mode)
                return
        raise FileExistsError(17, "its temporary names are taken")

    def commit(self) -> None:
        """Take the target's name."""
        if self.replaces and self in _UNFINISHED:
            os.replace(self.path, self.target)
            self._forget()

    def abort(self) -> None:
        """Leave nothing behind; after `commit` it does nothing."""
        if self in _UNFINISHED:
            if self.path != self.target:
                self.path.unlink(missing_ok=True)
            self._forget()

    def _forget(self) -> None:
        _UNFINISHED.discard(self)
        if self._lock >= 0:
            os.close(self._lock)
            self._lock = -1


def write_whole(target: str | Path, content: bytes) -> None:
    """The content, whole or not at all; into a device or a FIFO as it is.

    Raises
    ------
    DataError : it cannot be written.
    """
    file = WholeFile(target)
    try:
        with open(file.path, "wb") as stream:
            stream.write(content)
        file.commit()
    except BrokenPipeError:
        raise
    except OSError as error:
        raise cannot_be_written(target, error) from None
    finally:
        file.abort()


def sweep() -> None:
    """Take away what an interrupted command has not finished."""
    for file in list(_UNFINISHED):
        with contextlib.suppress(OSError):
            file.abort()


def cannot_be_written(target: str | Path, error: OSError) -> DataError:
    """One line for what the system says, in its own words also where Arrow wraps them."""
    return DataError(f"{target}: cannot be written ({os.strerror(error.errno) if error.errno else error})")


def remove_left_over(target: Path) -> None:
    """Remove what a process that was killed has left beside the target."""
    begin = f".{_stem(target)}."
    with contextlib.suppress(OSError), os.scandir(target.parent) as entries:
        for entry in entries:
            middle = entry.name[len(begin) : -len(".tmp")]
            if not (entry.name.startswith(begin) and entry.name.endswith(".tmp") and _is_ours(middle)):
                continue
            with contextlib.suppress(OSError):
                fd = os.open(entry.path, os.O_WRONLY | os.O_NOFOLLOW)
                try:
                    _locked(fd)  # fails while its writer lives
                    os.unlink(entry.path)
                finally:
                    os.close(fd)


def _is_ours(middle: str) -> bool:
    return all(part.isdecimal() for part in middle.split("-"))


def _locked(fd: int) -> None:
    try:
        import fcntl
    except ImportError:  # where there are no such locks, nothing left over is told from what is being written
        return
    fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)


@contextlib.contextmanager
def only_one(folder: Path) -> Iterator[None]:
    """No other process that asks for the same is in this block; where there are no locks it is just run."""
    try:
        import fcntl
    except ImportError:
        yield
        return
    fd = os.open(folder, os.O_RDONLY)
    try:
        with contextlib.suppress(OSError):  # a file system without locks
            fcntl.flock(fd, fcntl.LOCK_EX)
        yield
    finally:
        os.close(fd)


def _stem(target: Path) -> str:
    name = target.name
    return name if name.isascii() and len(name) <= _LONGEST else f"{zlib.crc32(os.fsencode(name)):08x}"


def _mode(target: Path) -> int | None:
    try:
        return target.stat().st_mode
    except FileNotFoundError:
        return None
    except (OSError, ValueError) as error:
        raise DataError(f"{target}: cannot be written ({getattr(error, 'strerror', None) or error})") from None


def check_target(path: str | Path, inputs: Iterable[str | Path]) -> Path:
    """The path, if a file can be written there without harm to the inputs.

    Raises
    ------
    UsageError : it is one of the inputs.
    DataError : it is a directory or a disk, or its folder is not there or cannot be written to.
    """
    target = Path(path)
    mode = _mode(target)
    for source in inputs:
        if os.path.realpath(target) == os.path.realpath(source) or (
            mode is not None and stat.S_ISREG(mode) and is_same(target, source)
        ):
            raise UsageError(f"{path}: is the input", "write to another file")
    if mode is not None and not stat.S_ISREG(mode):
        if stat.S_ISDIR(mode):
            raise DataError(f"{path}: is a directory")
        if not (stat.S_ISCHR(mode) or stat.S_ISFIFO(mode)):
            raise DataError(f"{path}: is no file, no FIFO and no stream")
        return target
    folder = Path(os.path.realpath(target)).parent
    if not folder.is_dir():
        raise DataError(f"{path}: no such folder {folder}")
    if not os.access(folder, os.W_OK | os.X_OK):
        raise DataError(f"{path}: the folder {folder} cannot be written to")
    return target


def is_same(path: str | Path, other: str | Path) -> bool:
    """Whether both names are of one file that is there; - is none."""
    try:
        return STREAM not in (str(path), str(other)) and os.path.samefile(path, other)
    except (OSError, ValueError):
        return False
