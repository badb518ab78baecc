"""`dsd` in a process of its own that need not load its libraries again: forked from one that has loaded them.

Loading them is half and more of what a test of a command costs. Arguments, folder, streams and exit code are those of
a process; where the environment is not the one in which the libraries were loaded, or anything else is asked for that
matters before that, `run` starts `python -m dsd_cli` afresh. What a start itself does is tested without this.
"""

from __future__ import annotations

import atexit
import fcntl
import gc
import io
import json
import os
import pkgutil
import pty
import socket
import struct
import subprocess
import sys
import termios
import threading
from collections.abc import Mapping, Sequence
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import Any, NoReturn

DSD = [sys.executable, "-m", "dsd_cli"]
ROOT = Path(__file__).parents[1]
#: Effects enough where a test does not ask which of the whole catalogue is found.
FEW = ("viscous_friction", "coulomb_friction", "constant_load", "quadratic_drag")
#: What commands load when they need it.
LATE = (
    *("pyarrow.csv", "pyarrow.parquet", "rich.console", "rich.table", "rich.progress", "matplotlib.figure"),
    *("matplotlib.backends.backend_agg", "scipy.linalg", "scipy.signal", "scipy.special", "scipy.optimize"),
)
#: Variables that are looked at when a command runs, those of the tests themselves, and those that a library sets in
#: the process of the tests which no command loads (hmmlearn, by scikit-learn).
AT_RUN = {
    "NO_COLOR",
    "COLUMNS",
    "PYTEST_CURRENT_TEST",
    "MIMALLOC_PURGE_DELAY",
    "KMP_DUPLICATE_LIB_OK",
    "KMP_INIT_AT_FORK",
}
_LONGEST = 1 << 17  # bytes of a request


def run(
    *arguments: object,
    cwd: Path,
    env: Mapping[str, str] | None = None,
    stdin: str | bytes | None = None,
    timeout: float = 600.0,
    effects: Sequence[str] = (),
) -> subprocess.CompletedProcess:
    """The command; text in and out unless the standard input is bytes.

    env : of the command; None is that of the tests. stdin : None is the null device. effects : all that it looks for,
    of what the model lacks, where the question is not which of the whole catalogue it is: a fit of each is most of
    what a diagnosis costs.
    """
    words, env = [str(argument) for argument in arguments], dict(os.environ if env is None else env)
    if _SERVER.serves(env):
        return _SERVER.run(words, cwd, env, stdin, timeout, effects)
    assert not effects, "a process that starts afresh looks for the whole catalogue"
    return subprocess.run(
        [*DSD, *words],
        input=stdin,
        stdin=subprocess.DEVNULL if stdin is None else None,
        capture_output=True,
        text=not isinstance(stdin, bytes),
        check=False,
        cwd=cwd,
        env=env,
        timeout=timeout,
    )


def on_terminal(*arguments: object, cwd: Path, columns: int, lines: int, effects: Sequence[str] = ()) -> bytes:
    """What the command, which must succeed, writes where it is on a terminal of that size; `effects` as in `run`."""
    master, slave = pty.openpty()
    fcntl.ioctl(slave, termios.TIOCSWINSZ, struct.pack("HHHH", lines, columns, 0, 0))
    plain = {name: value for name, value in os.environ.items() if name not in ("COLUMNS", "LINES", "NO_COLOR")}
    request = _request([*map(str, arguments)], cwd, {**plain, "TERM": "xterm-256color"}, effects)
    return _SERVER.on_terminal(request, slave, master)


def _lasting(env: Mapping[str, str]) -> dict[str, str]:
    return {name: value for name, value in env.items() if name not in AT_RUN}


class _Server:
    """One process for all tests of a worker, started when it is first needed, which ends with the tests."""

    def __init__(self) -> None:
        self._mine, self._env, self._lock = None, _lasting(os.environ), threading.Lock()

    def serves(self, env: Mapping[str, str]) -> bool:
        """Whether the libraries were loaded in that environment."""
        return hasattr(socket, "send_fds") and _lasting(env) == self._env

    def _started(self) -> socket.socket:
        if self._mine is None:
            self._mine, its = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
            command = [sys.executable, "-m", "tests.warm", str(its.fileno())]
            begun = subprocess.Popen(
                command, cwd=ROOT, pass_fds=[its.fileno()], stdin=subprocess.DEVNULL, env=self._env
            )
            its.close()
            atexit.register(begun.wait)
            atexit.register(self._mine.close)
        return self._mine

    def run(
        self,
        words: Sequence[str],
        cwd: Path,
        env: Mapping[str, str],
        stdin: str | bytes | None,
        timeout: float,
        effects: Sequence[str],
    ) -> subprocess.CompletedProcess:
        """One command after the other."""
        with self._lock:
            server, said = self._started(), [b"", b""]
            pipes = [os.pipe(), os.pipe()]
            its_in, mine_in = os.pipe() if stdin is not None else (os.open(os.devnull, os.O_RDONLY), -1)
            request = _request(words, cwd, env, effects)
            socket.send_fds(server, [request], [its_in, *(its for _, its in pipes)])
            for its in (its_in, *(its for _, its in pipes)):
                os.close(its)
            threads = [threading.Thread(target=_read, args=(said, i, mine)) for i, (mine, _) in enumerate(pipes)]
            if stdin is not None:
                content = stdin if isinstance(stdin, bytes) else stdin.encode()
                threads.append(threading.Thread(target=_write, args=(content, mine_in)))
            for thread in threads:
                thread.start()
            child = int(server.recv(64))
            server.settimeout(timeout)
            try:
                code = int(server.recv(64))
            except TimeoutError:
                os.kill(child, 9)
                server.settimeout(None)
                server.recv(64)
                raise subprocess.TimeoutExpired([*DSD, *words], timeout) from None
            for thread in threads:
                thread.join()
        text = not isinstance(stdin, bytes)
        out, err = (io.TextIOWrapper(io.BytesIO(x)).read() if text else x for x in said)
        return subprocess.CompletedProcess([*DSD, *words], code, out, err)

    def on_terminal(self, request: bytes, slave: int, master: int) -> bytes:
        """All that a command that succeeds writes to a terminal, which is closed then."""
        written = list[bytes]()
        with self._lock:
            server = self._started()
            socket.send_fds(server, [request], [slave] * 3)
            os.close(slave)
            with suppress(OSError):  # what Linux says when nobody holds the other side any more
                while part := os.read(master, 1 << 16):
                    written.append(part)
            os.close(master)
            server.recv(64)
            code = int(server.recv(64))
        assert code == 0, b"".join(written).decode()
        return b"".join(written)


def _request(words: Sequence[str], cwd: Path, env: Mapping[str, str], effects: Sequence[str]) -> bytes:
    asked = {"words": words, "cwd": os.path.abspath(cwd), "env": dict(env), "effects": effects}
    return json.dumps(asked).encode()


def _read(said: list[bytes], i: int, pipe: int) -> None:
    with open(pipe, "rb") as stream:
        said[i] = stream.read()


def _write(content: bytes, pipe: int) -> None:
    with suppress(BrokenPipeError), open(pipe, "wb") as stream:  # a command need not read to the end
        stream.write(content)


_SERVER = _Server()


def serve(number: int) -> None:
    """Load everything, then fork for every request until the tests have ended."""
    import dsd_cli

    for found in pkgutil.walk_packages(dsd_cli.__path__, "dsd_cli."):
        if not found.name.endswith("__main__"):
            import_module(found.name)
    for name in LATE:
        import_module(name)
    gc.collect()
    gc.freeze()
    with socket.socket(fileno=number) as tests:
        while True:
            request, streams, *_ = socket.recv_fds(tests, _LONGEST, 3)
            if not request:
                return
            child = os.fork()
            if child == 0:
                _become(json.loads(request), streams)
            for stream in streams:
                os.close(stream)
            tests.send(str(child).encode())
            tests.send(str(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])).encode())


def _become(request: dict[str, Any], streams: Sequence[int]) -> NoReturn:
    """The command, as if it had just begun."""
    from dsd_cli.__main__ import main
    from dsd_cli.identify.fit import testability

    if request["effects"]:
        whole = testability.catalogue()
        testability.catalogue = lambda: {name: whole[name] for name in request["effects"]}
    for number, stream in enumerate(streams):
        os.dup2(stream, number)
    os.closerange(3, 1 + max(streams, default=3) + 1)
    os.chdir(request["cwd"])
    os.environ.clear()
    os.environ.update(request["env"])
    sys.argv = ["dsd", *request["words"]]
    sys.stdin = sys.__stdin__ = open(0, encoding="utf-8", closefd=False)  # noqa: SIM115
    for number, name in ((1, "stdout"), (2, "stderr")):
        stream = io.TextIOWrapper(
            open(number, "wb", closefd=False),  # noqa: SIM115
            "utf-8",
            "strict" if number == 1 else "backslashreplace",
            line_buffering=number == 2,
        )
        setattr(sys, name, stream)
        setattr(sys, f"__{name}__", stream)
    main()


if __name__ == "__main__":
    serve(int(sys.argv[1]))
