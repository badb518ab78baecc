"""Loggers that write a value only where it changed: what is read back is what a logger of every loop has."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from dsd_cli.files.table_source import Batch
from dsd_cli.files.tables_in import open_table

LOOP, ROWS, STEP = 0.02, 900, 0.01
NAMES = {"t": "Timestamp", "u": "volts", "position": "pos", "velocity": "vel"}
Event = tuple[float, str, float]


def loops(volts: str) -> dict[str, np.ndarray]:
    """A rod that rests three times, its encoder in steps; u by the table below, or none of these rests known to it."""
    t = np.arange(ROWS) * LOOP
    moving = (t % 6.0) < 4.0
    phase = np.where(moving, t % 6.0, 4.0)
    pos = np.round(2.0 * np.sin(0.5 * np.pi * phase) ** 2 * np.sign(phase - 2.0 + 1e-9) / STEP) * STEP
    levels = {
        "uneven": np.array([0.0, 3.1, -2.2, 0.7, 0.0, -4.5, 1.4])[np.searchsorted([1.3, 2.1, 5.0, 5.4, 9.9, 14.0], t)],
        "even": np.where((t // 1.0) % 2.0 > 0.5, 2.0, -2.0),
        "stairs": np.floor(t / 1.5) * 0.25,
        "loop": np.where(moving, np.round(np.sin(2.7 * t), 2), 0.0),
    }
    return {"volts": levels[volts], "pos": pos, "vel": np.round(np.gradient(pos, LOOP), 6)}


def events(log: dict[str, np.ndarray], later: float, alive: int = 10**9) -> list[Event]:
    """What such a logger writes, `later` s from channel to channel, and at each so many loops after the last."""
    found = []
    for at, (name, x) in enumerate(log.items()):
        last = 0
        for k in range(ROWS):
            if k == 0 or x[k] != x[last] or k - last >= alive:
                found.append((k * LOOP + at * later, name, float(x[k])))
                last = k
    return sorted(found)


def written(path: Path, form: str, found: Sequence[Event]) -> Path:
    if form == "long":
        lines = ["Timestamp,Key,Value", *(f"{t:.6f},{name},{x!r}" for t, name, x in found)]
    else:
        lines, row = ["Timestamp,volts,pos,vel"], dict.fromkeys(("volts", "pos", "vel"), "")
        for at, (t, name, x) in enumerate(found):
            row[name] = repr(x)
            if at + 1 == len(found) or found[at + 1][0] > t:
                lines.append(f"{t:.6f},{','.join(row.values())}")
                row = row if form == "filled" else dict.fromkeys(row, "")
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def read(path: Path, u_hold: str = "held") -> tuple[dict[str, np.ndarray], str]:
    table = open_table(path, NAMES, u_hold=u_hold)
    parts: list[Batch] = list(table.batches())
    return {name: np.concatenate([one.columns[name] for one in parts]) for name in NAMES}, " ".join(table.warnings)


@pytest.mark.parametrize("volts", ["uneven", "even", "stairs", "loop"])
@pytest.mark.parametrize(("form", "later"), [("rows", 0.0), ("rows", 4e-5), ("long", 0.0), ("filled", 4e-5)])
def test_what_did_not_change_is_as_it_was(volts: str, form: str, later: float, tmp_path: Path) -> None:
    log = loops(volts)
    there = events(log, later)
    found, said = read(written(tmp_path / "log.csv", form, there))
    whole = np.isfinite(np.column_stack(list(found.values()))).all(axis=1)
    loop = np.rint((found["t"] - later) / LOOP).astype(int)
    assert np.count_nonzero(whole) > 0.95 * there[-1][0] / LOOP
    np.testing.assert_allclose(found["t"], loop * LOOP, atol=2.1 * later + 1e-6)
    for name, column in (("position", "pos"), ("velocity", "vel")):
        np.testing.assert_allclose(found[name][whole], log[column][loop[whole]], atol=0.01 * np.ptp(log[column]))
    np.testing.assert_allclose(found["u"][whole], log["volts"][loop[whole]], atol=0.01 * np.ptp(log["volts"]))
    assert "only where" in said


def test_a_sign_of_life_is_no_sample_of_its_own(tmp_path: Path) -> None:
    found, said = read(written(tmp_path / "log.csv", "rows", events(loops("uneven"), 0.0, alive=50)))
    assert found["t"].size > 0.95 * ROWS
    assert "only where" in said


def test_a_control_input_that_was_measured_is_not_held(tmp_path: Path) -> None:
    """It keeps its own stamps, as slow as they are, also where it is said that it was sampled."""
    t = np.arange(4000) * 1e-3
    slow = [(float(k), "volts", float(np.sin(3.0 * k))) for k in t[::20]]
    moved = [(k, name, x) for k in t.tolist() for name, x in (("pos", 2.0 * k + 0.3), ("vel", k**2))]
    found, said = read(written(tmp_path / "log.csv", "rows", sorted(slow + moved)))
    np.testing.assert_allclose(found["t"], t[::20])
    assert "only where" not in said
    steps = written(tmp_path / "steps.csv", "rows", events(loops("uneven"), 0.0))
    assert "only where" not in read(steps, "sampled")[1]


def test_rows_that_arrive_in_bursts_are_no_changes(tmp_path: Path) -> None:
    """As a computer stamps what it reads from a port: u is new in all of them, and an encoder that creeps in some."""
    k = np.arange(1200)
    t = (k // 10) * 0.02 + (k % 10) * 1e-4
    q = np.round(0.04 * k) * STEP
    lines = [f"{a:.6f},{b:.6f},{c:.6f},{c:.6f}" for a, b, c in zip(t, np.sin(0.1 * k), q, strict=True)]
    (tmp_path / "log.csv").write_text("\n".join(["Timestamp,volts,pos,vel", *lines]) + "\n", encoding="utf-8")
    found, said = read(tmp_path / "log.csv")
    np.testing.assert_allclose(found["t"], t, atol=1e-6)
    assert said == ""


def test_samples_of_noise_that_were_lost_are_no_changes(tmp_path: Path) -> None:
    """Noise is nowhere farther off than from one sample to the next, also over a hole, and has no value twice."""
    rng, t = np.random.default_rng(3), np.arange(3000) * 1e-3
    u, d_hat = np.sin(9.0 * t), 0.1 * np.sin(3.0 * t) + 0.02 * rng.standard_normal(t.size)
    lost = np.zeros(t.size, dtype=bool)
    for begin in rng.integers(10, 2980, 55):
        lost[begin : begin + 8] = True
    cells = [f"{a!r},{b!r}" for a, b in zip(u.tolist(), d_hat.tolist(), strict=True)]
    lines = [f"{k:.3f},{',' if gone else row}" for k, gone, row in zip(t, lost, cells, strict=True)]
    (tmp_path / "log.csv").write_text("\n".join(["t,u,d_hat", *lines]) + "\n", encoding="utf-8")
    table = open_table(tmp_path / "log.csv", {"t": "t", "u": "u", "d_hat": "d_hat"})
    parts: list[Batch] = list(table.batches())
    found = np.concatenate([one.columns["d_hat"] for one in parts])
    assert np.count_nonzero(np.isfinite(found)) == np.count_nonzero(~lost)
    assert not any("only where" in one for one in table.warnings)


def test_values_that_come_in_pairs_are_not_read_at_the_pace_within_them(tmp_path: Path) -> None:
    """A million rows and more would be made of a thousand values."""
    t = np.repeat(np.arange(500) * 0.04, 2) + np.tile([0.0, 2e-6], 500)
    q = np.random.default_rng(5).normal(size=t.size).cumsum()
    found = [(float(k), "pos", float(x)) for k, x in zip(t, q, strict=True)]
    found += [(k + 1e-3, "vel", x) for k, _, x in found]
    found += [(0.1 + 1.7 * k, "volts", float(k % 3)) for k in range(12)]
    read_, _ = read(written(tmp_path / "log.csv", "rows", sorted(found)))
    assert read_["t"].size < 10 * t.size
