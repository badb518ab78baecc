"""The commands of `bench fuzz` that look at a log as a whole or change a config; fuzz_cases.py has the rest."""

from __future__ import annotations

import random
from pathlib import Path

import numpy as np

from dsd_cli.signals.log import Array

#: What somebody may ask to be added; the last ones cannot be.
EFFECTS = (
    "viscous_friction", "coulomb_friction", "stribeck_friction", "constant_load", "gravity", "stiffness", "cogging",
    "dead_zone", "saturation", "actuator_lag", "backlash", "flexible_coupling", "external_force",
    "periodic_disturbance", "inertia", "delay", "none", "[/x]", "",
)  # fmt: skip
#: A step that the config remembers, for `improve --history` and `--undo`.
HISTORY = """
[[history]]
effect = "viscous_friction"
date = 2026-01-02T03:04:05Z
logs = ["log.csv"]
rmse_before = 0.2
rmse_after = 0.1
heldout_rmse_before = 0.2
heldout_rmse_after = 0.1
values = { coefficient = 0.1 }
std_errors = { coefficient = 0.01 }
before = { inertia = 1.1, delay = 0.005 }
"""
RESULTS = "log,machine,date,config,command,status,reason,verdict,samples,rmse,value.inertia,error.inertia,key"
TEMPLATES = ("lab", "paper-step", "servo", "nothing")


def moving_log(rng: random.Random, rows: int) -> dict[str, Array]:
    """An axis (J = 1) with friction and a load, driven by steps of u: what the config believes, and what it lacks."""
    noise = np.random.default_rng(rng.randrange(1 << 30)).normal(size=(3, rows))
    viscous, dry, load = rng.choice((0.0, 0.1, 2.0)), rng.choice((0.0, 0.3)), rng.choice((0.0, 0.0, 0.5))
    T, speed, place, low = 1e-3, 0.0, 0.0, 0.0
    u = np.repeat(noise[0, : rows // 25 + 1], 25)[:rows]
    out = np.empty((3, rows))
    for k in range(rows):
        out[:, k] = low, speed, place
        force = load - viscous * speed - dry * np.sign(speed)
        acceleration = u[max(k - 5, 0)] + force
        low += T / (T + 2e-3) * (acceleration - u[k] - low)
        place += T * speed + 0.5 * T * T * acceleration
        speed += T * acceleration
    grain = rng.choice((0.0, 1e-6, 1e-3))
    return {
        "t": np.arange(rows) * T,
        "u": u,
        "d_hat": out[0] + 0.01 * noise[1],
        "velocity": out[1] + grain * noise[2],
        "position": np.round(out[2] / grain) * grain if grain else out[2],
    }


def arguments(rng: random.Random, command: str, folder: Path) -> list[str]:
    """The arguments of one of `COMMANDS`; what it reads beside the log and the config is put into the folder."""
    return _GIVEN[command](rng, folder)


def _form(rng: random.Random) -> list[str]:
    return rng.choice(([], [], ["--format", "json"]))


def _picture(rng: random.Random) -> list[str]:
    return ["--plot", "out.png"] if rng.random() < 0.05 else []


def _out(rng: random.Random) -> list[str]:
    return ["-o", rng.choice(("out.toml", "out.toml", "dsd.toml", "-"))]


def _check(rng: random.Random, folder: Path) -> list[str]:
    return ["check", "log.csv", *rng.choice(([], ["--strict"])), *_form(rng), *_picture(rng)]


def _init(rng: random.Random, folder: Path) -> list[str]:
    to = rng.choice((["-o", "out.toml"], ["-o", "-"], ["-o", "dsd.toml"], ["--force"]))
    what = ["--template", rng.choice(TEMPLATES)] if rng.random() < 0.1 else ["log.csv"]
    return ["init", *what, *to]


def _tune(rng: random.Random, folder: Path) -> list[str]:
    return ["tune", "log.csv", *rng.choice(([], _out(rng))), *_form(rng), *_picture(rng)]


def _diagnose(rng: random.Random, folder: Path) -> list[str]:
    return ["diagnose", "log.csv", *_form(rng), *_picture(rng)]


def _add(rng: random.Random, folder: Path) -> list[str]:
    return ["add", "log.csv", rng.choice(EFFECTS), *_out(rng), *_form(rng), *_picture(rng)]


def _improve(rng: random.Random, folder: Path) -> list[str]:
    if rng.random() < 0.3:
        with (folder / "dsd.toml").open("a", encoding="utf-8", errors="surrogateescape") as file:
            file.write(HISTORY)
    if rng.random() < 0.2:
        return ["improve", *rng.choice((["--history"], ["--undo"], ["--undo", *_out(rng)])), *_form(rng)]
    given = rng.choice(([], _out(rng), ["--from-prior"], ["--hold"]))
    return ["improve", "log.csv", "--auto", *given, *_form(rng), *_picture(rng)]


def _report(rng: random.Random, folder: Path) -> list[str]:
    return ["report", "log.csv", "-o", rng.choice(("out.html", "out.html", "-"))]


def _fleet(rng: random.Random, folder: Path) -> list[str]:
    """Several logs in one process, or what `fleet summary` makes of a table."""
    if rng.random() < 0.4:
        kinds = ("none", "unknown", "viscous_friction", "not confident", "\x1b[2J", "")
        rows = [
            f"{i}.csv,m{i % 2},2026-01-{i + 1:02d},dsd.toml,diagnose,{rng.choice(('done', 'done', 'failed'))},,"
            f"{rng.choice(kinds)},{rng.choice(('100', '', 'x'))},{rng.choice(('0.1', 'nan', '-inf', '1e308'))},"
            f"{rng.choice(('1.0', '1e308', ''))},{rng.choice(('0.1', '0', 'inf'))},k{i}"
            for i in range(rng.choice((0, 1, 3, 12)))
        ]
        (folder / "results.csv").write_text("\n".join([RESULTS, *rows]) + "\n", encoding="utf-8")
        return ["fleet", "summary", "results.csv", *_form(rng), *_picture(rng)]
    (folder / "other.csv").write_bytes((folder / "log.csv").read_bytes()[: rng.choice((0, 40, 1000, 100_000))])
    (folder / "list.txt").write_text("log.csv\n# a comment\nother.csv\nother.csv\n", encoding="utf-8")
    logs = rng.choice((["log.csv"], ["log.csv", "other.csv", "missing.csv"], ["*.csv"], ["--list", "list.txt"]))
    command = rng.choice(("detect", "compare", "diagnose"))
    return ["fleet", command, *logs, "-o", rng.choice(("out.csv", "out.csv", "out.parquet")), "--workers", "1"]


_GIVEN = {
    "check": _check,
    "init": _init,
    "tune": _tune,
    "diagnose": _diagnose,
    "add": _add,
    "improve": _improve,
    "report": _report,
    "fleet": _fleet,
}
COMMANDS = tuple(_GIVEN)
