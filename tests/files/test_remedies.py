"""Keys of [signals] that a remedy says: a config takes them, and its columns are then multiplied by that more."""

from itertools import product
from typing import Any

import pytest

from dsd_cli.errors import DsdError
from dsd_cli.files.config import load_config
from dsd_cli.files.config.remedies import keys_that_multiply

CONFIG = "[signals]\n{}\n[observer]\nnominal_inertia = 1.0\ntime_constant = 0.01\n"
WRITTEN: list[dict[str, Any]] = [
    {},
    {"u_sign": -1},
    {"velocity_scale": 0.5, "position_scale": -2.0},
    {"velocity_unit": "rpm"},
    {"velocity_unit": "rpm", "velocity_scale": -1},
    {"position_unit": "deg", "velocity_unit": "unknown"},
    {"position_unit": "unknown", "velocity_unit": "unknown", "velocity_scale": 3.0},
    {"position_unit": "mm", "velocity_unit": "m/s"},
    {"position_unit": "counts", "counts_per_turn": 4096},
    {"position_unit": "counts", "velocity_unit": "counts/s", "counts_per_metre": 1e6},
    {"position_unit": "turn", "velocity_unit": "counts/s", "counts_per_turn": 1000},
]
MORE = [
    {"velocity": -1.0},
    {"velocity": -0.0125},
    {"position": 57.3},
    {"position": -80.0, "velocity": 2.0},
    {"u": -1.0},
]


def factors(folder, written: dict[str, Any], keys: list[str] = ()) -> dict[str, float]:
    path = folder / "dsd.toml"
    lines = (f"{key} = {value!r}".replace("'", '"') for key, value in written.items())
    path.write_text(CONFIG.format("\n".join(lines)), encoding="utf-8")
    found = load_config(path, [key.replace(" = ", "=") for key in keys]).signals.factors()
    return {channel: found.get(channel, 1.0) for channel in ("u", "velocity", "position")}


@pytest.mark.parametrize(("written", "more"), [*product(WRITTEN, MORE)], ids=str)
def test_the_config_takes_them_and_they_multiply_by_as_much(written, more, tmp_path) -> None:
    before = factors(tmp_path, written)
    signals = load_config(tmp_path / "dsd.toml").signals
    try:
        after = factors(tmp_path, written, keys_that_multiply(signals, more))
    except DsdError as error:
        pytest.fail(f"{keys_that_multiply(signals, more)}: {error}")
    for channel, value in before.items():
        assert after[channel] == pytest.approx(value * more.get(channel, 1.0), rel=1e-5), channel


def test_a_unit_stays_where_only_the_sign_is_wrong(tmp_path) -> None:
    factors(tmp_path, {"velocity_unit": "rpm"})
    signals = load_config(tmp_path / "dsd.toml").signals
    assert keys_that_multiply(signals, {"velocity": -1.0}) == ["signals.velocity_scale = -1"]
