"""What `bench fuzz` runs: the number of a run decides its log, its config and its command."""

from __future__ import annotations

import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from bench import fuzz_commands
from dsd_cli.signals.log import Array

#: Values that somebody puts into a config by mistake or on purpose.
EXTREMES = (
    "0", "-1", "1", "1e-320", "1e-300", "1e-30", "1e30", "1e300", "1.7e308", "-1e300", "nan", "inf", "-inf",
    "9223372036854775807", "-9223372036854775808", "10000000000000000000000", "true", "[]", "[0]", "[1e300, -1e300]",
    "{}", '""', '"\\u001b[2J"', '"$x^{"', "2026-01-01", "[[1]]", "0.5", "100000", "3",
)  # fmt: skip
#: Nobody's page may have it as it is.
MARKUP = "<script>alert(1)</script>"
CELLS = (
    "", "nan", "inf", "-inf", "1e308", "-1e308", "1e400", "1e-320", "x", '"', '""', "\x1b[2J", "1_000", "0x10", "\r",
    "\0", "1,5", "é", "\xff", "9" * 400, "1e30", "-1e15", " 1 ", "2026-01-01T00:00:00", "\u202e", "#", "1e3", "-5e4",
    MARKUP, "[/x]", "$x^{", "{{}}",
)  # fmt: skip
CONFIG = """
[observer]
nominal_inertia = 1.0
time_constant = 0.002

[model]
inertia = 1.0
delay = 0.005

[model.effects.viscous_friction]
coefficient = 0.1

[states]
delays = [0.0, 0.005]
inertias = [0.5, 1.0]

[detector]
window = 20
rho = 0.1

[simulate]
duration = 0.2
sample_time = 0.001
noise = 0.01
reference = { kind = "step", time = 0.05, amplitude = 1.0 }
controller = { kind = "pd", kp = 20.0, kd = 5.0 }
"""
#: What a spoiled log goes through: every second one is labelled or compared.
COMMANDS = (*["detect"] * 6, *["compare"] * 4, *["observe"] * 2, *fuzz_commands.COMMANDS)
#: Rows of a log; those that look at it as a whole have something to say of longer ones only.
LENGTHS, LONGER = (1, 2, 5, 17, 40, 120, 400), (5, 120, 400, 800)
Change = Callable[[random.Random, list[str]], list[str]]


def keys() -> list[str]:
    """Every key of the config, dotted."""
    from dsd_cli.files.config import Config

    def inside(kind: Any, prefix: str) -> list[str]:
        found = []
        for name, spec in kind.keys.items():
            found.append(f"{prefix}{name}")
            for section in spec.rule.sections:
                found += inside(section, f"{prefix}{name}.")
        return found

    names = [name for name in inside(Config, "") if "." in name and not name.startswith("history")]
    return [*dict.fromkeys(names), "model.effects.viscous_friction.coefficient", "model.effects.gravity.phase"]


def matrix() -> list[tuple[str, str]]:
    """Every key with every extreme value."""
    return [(key, value) for key in keys() for value in EXTREMES]


def case(number: int, folder: Path) -> list[str]:
    """The arguments of a run; what it reads is put into the folder. The first runs are the matrix, in a mixed order."""
    rng = random.Random(number)
    (folder / "dsd.toml").write_text(CONFIG, encoding="utf-8")
    pairs = matrix()
    if number < len(pairs):
        key, value = pairs[number * 7919 % len(pairs)] if len(pairs) % 7919 else pairs[number]
        command = (
            "simulate"
            if key.startswith("simulate")
            else rng.choice(("detect", "detect", "simulate", "observe", "compare"))
        )
        _write_log(folder, rng, spoiled=False)
        return [*_command(rng, command), "--set", f"{key}={value}"]
    if rng.random() < 0.15:
        (folder / "dsd.toml").write_bytes(spoil(rng, CONFIG.encode()))
    command = rng.choice(COMMANDS)
    if command not in fuzz_commands.COMMANDS:
        _write_log(folder, rng, spoiled=True)
        return _command(rng, command)
    _write_log(folder, rng, spoiled=rng.random() < 0.5, lengths=LONGER, changes=(1, 1, 2))
    arguments = fuzz_commands.arguments(rng, command, folder)
    key, value = rng.choice(pairs)
    odd = rng.random() < 0.2 and command != "init" and "summary" not in arguments
    return [*arguments, "--set", f"{key}={value}"] if odd else arguments


def _command(rng: random.Random, command: str) -> list[str]:
    log = "log.csv"
    match command:
        case "simulate":
            return ["simulate", "-o", rng.choice(("out.csv", "out.parquet", "-"))]
        case "observe":
            return ["observe", log, "-o", rng.choice(("out.csv", "out.parquet", "-"))]
        case "compare":
            return ["compare", log, *rng.choice(([], ["--format", "json"], ["--horizon", "simulation"]))]
    to = rng.choice(([], ["-o", "out.csv"], ["-o", "out.parquet"], ["--format", "json"], ["--format", "jsonl"]))
    method = rng.choice(("dsd", "dsd", "dsd", "average", "imm", "viterbi", "smooth"))
    return ["detect", log, *to, "--set", f"detector.method={method}"]


def _write_log(
    folder: Path,
    rng: random.Random,
    spoiled: bool,
    lengths: tuple[int, ...] = LENGTHS,
    changes: tuple[int, ...] = (1, 1, 2, 5, 50),
) -> None:
    rows = rng.choice(lengths)
    columns = fuzz_commands.moving_log(rng, 2 * rows) if rng.random() < 0.3 else _noise(rng, rows)
    for name in rng.sample(("d_hat", "velocity", "position"), rng.randrange(3)):
        del columns[name]
    lines = [
        ",".join(columns),
        *(",".join(map(repr, row)) for row in zip(*(c.tolist() for c in columns.values()), strict=True)),
    ]
    if not spoiled:
        (folder / "log.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
        return
    for _ in range(rng.choice(changes)):
        lines = rng.choice(CHANGES)(rng, lines)
    content = rng.choice(("\n", "\n", "\n", "\r\n", "\r")).join(lines).encode("utf-8", "surrogateescape")
    content += rng.choice((b"\n", b"", b"\0"))
    (folder / "log.csv").write_bytes(spoil(rng, content) if rng.random() < 0.2 else content)


def _noise(rng: random.Random, rows: int) -> dict[str, Array]:
    """Channels that have nothing to do with each other."""
    noise = np.random.default_rng(rng.randrange(1 << 30)).normal(size=(4, rows))
    columns = {"t": np.arange(rows) * 1e-3, "u": noise[0], "d_hat": 0.1 * noise[1]}
    return columns | {"velocity": np.cumsum(noise[2]) * 1e-2, "position": np.cumsum(noise[3]) * 1e-4}


def _cell(rng: random.Random, lines: list[str]) -> list[str]:
    at = rng.randrange(len(lines))
    cells = lines[at].split(",")
    cells[rng.randrange(len(cells))] = rng.choice(CELLS)
    return [*lines[:at], ",".join(cells), *lines[at + 1 :]]


def _line(rng: random.Random, lines: list[str]) -> list[str]:
    at = rng.randrange(len(lines))
    new = rng.choice(
        ([], [lines[at]] * 2, [""], ["#"], [lines[at][: len(lines[at]) // 2]], [lines[at] + ",1"], lines[:1])
    )
    return [*lines[:at], *new, *lines[at + 1 :]] or [""]


def _order(rng: random.Random, lines: list[str]) -> list[str]:
    a, b = sorted(rng.randrange(len(lines) + 1) for _ in range(2))
    return rng.choice((lines[:a] + lines[b:], lines[:b] + lines[a:], lines[:1] + lines[:0:-1])) or [""]


def _column(rng: random.Random, lines: list[str]) -> list[str]:
    """One column all the same, or all of one odd cell."""
    at, cell = rng.randrange(max(lines[0].count(","), 1)), rng.choice((*CELLS, "0", "1"))
    out = lines[:1]
    for line in lines[1:]:
        cells = line.split(",")
        if at < len(cells):
            cells[at] = cell
        out.append(",".join(cells))
    return out


CHANGES: tuple[Change, ...] = (_cell, _cell, _cell, _cell, _line, _line, _order, _column)


def spoil(rng: random.Random, content: bytes) -> bytes:
    """A few bytes other than they were, or the file cut."""
    data = bytearray(content)
    for _ in range(rng.choice((1, 3, 20))):
        if data:
            data[rng.randrange(len(data))] = rng.randrange(256)
    return bytes(data[: rng.randrange(len(data) + 1)] if rng.random() < 0.3 else data)
