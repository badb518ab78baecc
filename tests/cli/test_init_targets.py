"""`dsd init` on consoles of motor controllers: the target that they print is no control input."""

from pathlib import Path

import numpy as np
import pytest

from dsd_cli.files.config import load_config
from tests.cli.rig import done, dsd

#: A gimbal motor in voltage mode, its PI speed loop at 1 kHz, printed every 10 ms: ohm, N m/A, kg m2, s.
OHM, KT, J, T, EVERY = 10.0, 0.06, 1.5e-4, 1e-3, 10
COLUMNS = {"t": "1", "target": "2", "u": "3", "v": "4", "q": "5"}


def printed(loop: str, seed: int, rows: int = 12_000) -> np.ndarray:
    """t, target (speed, or position in a loop around it), voltage, speed behind a low-pass, position in counts."""
    rng = np.random.default_rng(seed)
    lasts, levels = rng.integers(500, 2000, 40), rng.uniform(-1.0, 1.0, 40)
    target = np.repeat(levels * (20.0 if loop == "speed" else 6.0), lasts)[:rows]
    w = q = filtered = integral = 0.0
    out = []
    for k in range(rows):
        counted = 2.0 * np.pi * np.round(q / 2.0 / np.pi * 16_384) / 16_384
        wanted = target[k] if loop == "speed" else np.clip(15.0 * (target[k] - counted), -20.0, 20.0)
        integral = np.clip(integral + 5.0 * (wanted - filtered) * T, -6.0, 6.0)
        u = np.clip(0.2 * (wanted - filtered) + integral, -6.0, 6.0)
        out.append((k * T, target[k], u, filtered, counted))
        for _ in range(4):
            friction = 2e-5 * w + 5e-4 * np.tanh(w / 0.02)
            w += T / 4 * (3.0 * KT * (u - KT * w) / OHM - friction) / J
            q += T / 4 * w
        filtered += (w - filtered) * T / (0.005 + T)
    return np.array(out)[::EVERY]


@pytest.fixture(scope="module", params=["speed", "position"])
def console(request, tmp_path_factory) -> tuple[str, Path]:
    """With the voltage, and without it."""
    folder = tmp_path_factory.mktemp("console")
    table = printed(request.param, 300201)
    np.savetxt(folder / "with.txt", table, fmt="%.4f", delimiter="\t")
    np.savetxt(folder / "without.txt", table[:, [0, 1, 3, 4]], fmt="%.4f", delimiter="\t")
    return request.param, folder


def test_the_measured_speed_and_the_voltage_are_found_beside_a_target(console):
    loop, folder = console
    done("init", "with.txt", "--force", cwd=folder)
    signals = load_config(folder / "dsd.toml").signals
    assert (signals.u, signals.velocity, signals.position) == (COLUMNS["u"], COLUMNS["v"], COLUMNS["q"])
    assert loop == "speed" or signals.reference == COLUMNS["target"]


def test_a_target_is_no_control_input(console):
    """It is followed with the gain 1, step by step, which no torque is."""
    loop, folder = console
    ran = dsd("init", "without.txt", "--force", cwd=folder)
    assert ran.returncode == 1
    asked = "which column is the control input" if loop == "speed" else "this log has no control input"
    assert asked in ran.stderr.splitlines()[-1]
    if loop == "speed":
        assert '"2" goes as the motion does: it was asked for, or measured again' in ran.stderr


@pytest.mark.parametrize(
    ("cells", "why"),
    [("3", '"u" is 3 in all rows'), ("", '"u" has no number in any row'), ("on", '"u" holds no numbers')],
)
def test_a_log_whose_u_says_nothing_is_told_so(cells: str, why: str, tmp_path: Path) -> None:
    t = 0.001 * np.arange(1000)
    rows = "".join(f"{a:.3f},{cells},{np.sin(9.0 * a):.6f}\n" for a in t)
    (tmp_path / "a.csv").write_text(f"t,u,position\n{rows}")
    last = dsd("init", "a.csv", cwd=tmp_path).stderr.splitlines()[-1]
    assert f"this log has no control input that changes: {why}; dsd needs one" in last


def test_a_control_input_that_rests_with_the_axis_is_no_target(tmp_path):
    """Both are 0 in three rows of five; u, in its own unit, varies about as much as the speed."""
    t = np.arange(12_000) * 1e-3
    a = np.where(t % 2.5 < 1.0, 2.0 * np.pi * np.sin(2.0 * np.pi * t), 0.0)  # a move in 1 s, then rest
    v, drive = np.cumsum(a) * 1e-3, 0.2 * a + np.sign(np.where(np.abs(a) > 0.0, 1.0, 0.0))
    rng = np.random.default_rng(300400)
    channels = np.column_stack([t, drive + 1e-3 * rng.normal(size=t.size), np.cumsum(v) * 1e-3, v])
    assert 0.5 < np.var(channels[:, 1]) / np.var(v) < 2.0
    np.savetxt(tmp_path / "log.csv", channels, fmt="%.7f", delimiter=",")
    ran = dsd("init", "log.csv", "--force", cwd=tmp_path)
    assert "was asked for" not in ran.stdout + ran.stderr
