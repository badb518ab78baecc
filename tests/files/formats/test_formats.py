"""Files of every format, as its own library writes them, are read as the numbers that went in."""

from pathlib import Path

import numpy as np
import pytest

from dsd_cli.files.tables_in import open_table
from tests.files.formats.makers import MAKERS, channels


def read(path: Path, names: dict[str, str]) -> tuple[dict[str, np.ndarray], list[str]]:
    table = open_table(path, names)
    batches = list(table.batches())
    return {name: np.concatenate([batch.columns[name] for batch in batches]) for name in names}, table.warnings


@pytest.mark.parametrize("maker", MAKERS, ids=lambda maker: maker.__name__)
def test_what_went_in_comes_out(maker, tmp_path: Path) -> None:
    data = channels()
    made = maker(tmp_path, data)
    found, _ = read(*made)
    np.testing.assert_allclose(found["t"] - found["t"][0], data["t"], rtol=0, atol=2e-9)
    for name in ("u", "velocity"):
        np.testing.assert_allclose(found[name], data[name], rtol=0, atol=1e-6 if maker.__name__ == "mdf" else 0)
