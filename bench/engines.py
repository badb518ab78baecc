"""Checkouts of `dsd` that are asked the same: each is a process of its own, with its own package and interpreter."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
SERVER = Path(__file__).with_name("engine_server.py")
#: s of CPU that one command may take.
LIMIT = 400


@dataclass(frozen=True)
class Engine:
    """A checkout, by the name that tables show."""

    name: str
    root: Path

    @classmethod
    def of(cls, text: str) -> Engine:
        """Of `NAME=PATH`.

        Raises
        ------
        SystemExit : there is no checkout at that path.
        """
        name, _, path = text.partition("=")
        root = Path(path or ".").expanduser().resolve()
        if not (root / "dsd_cli" / "__init__.py").is_file():
            sys.exit(f"--engine {text}: no checkout of dsd at {root} (wanted: NAME=PATH)")
        return cls(name, root)

    @property
    def commit(self) -> str:
        """The commit, with a + where files are changed; "" outside of git."""
        said = [self._git("rev-parse", "--short", "HEAD"), self._git("status", "--porcelain", "--", "dsd_cli")]
        return said[0] + ("+" if said[1] else "")

    def _git(self, *words: str) -> str:
        done = subprocess.run(["git", "-C", self.root, *words], capture_output=True, text=True, check=False)
        return done.stdout.strip()


class Asked:
    """A running engine."""

    def __init__(self, engine: Engine) -> None:
        own = engine.root / ".venv" / "bin" / "python"
        threads = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"), "1")
        environment = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"} | threads | {"NO_COLOR": "1"}
        self.process = subprocess.Popen(
            [str(own) if own.is_file() else sys.executable, str(SERVER), str(engine.root)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            cwd=engine.root,
            env=environment,
            text=True,
        )

    def run(self, *argv: object, cwd: Path, limit: int = LIMIT) -> dict[str, Any]:
        """{"code", "seconds", "out", "err"} of one command.

        Raises
        ------
        RuntimeError : the engine cannot be asked at all.
        """
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        job = {"argv": [str(word) for word in argv], "cwd": str(cwd), "limit": limit}
        self.process.stdin.write(json.dumps(job) + "\n")
        self.process.stdin.flush()
        line = self.process.stdout.readline()
        if not line:
            raise RuntimeError(f"the engine at {self.process.args[2]} ended")  # type: ignore[index]
        found: dict[str, Any] = json.loads(line)
        return found

    def close(self) -> None:
        """End it."""
        assert self.process.stdin is not None
        self.process.stdin.close()
        self.process.wait(timeout=30)
