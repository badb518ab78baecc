"""NumPy's .npz and .npy (and .npy with records); nothing is unpickled."""

from __future__ import annotations

from typing import Any

import numpy as np

from dsd_cli.files.formats.base import (
    InMemory,
    check_size,
    columns_of,
    lists_in,
    named_by,
    only_one,
    sample_times_said,
)
from dsd_cli.signals.log import Array


class NumpyFile(InMemory):
    """Arrays by their names, columns by an array of names beside them; a .npy without records is `data`."""

    def __init__(self, path: str) -> None:
        loaded: Any = np.load(path, allow_pickle=False)
        channels: dict[str, Array] = {}
        single: dict[str, Any] = {}
        texts: list[list[str]] = []
        if isinstance(loaded, np.ndarray):
            channels = columns_of("" if loaded.dtype.names else "data", loaded)
        else:
            skipped = []
            with loaded:
                check_size(path, sum(info.file_size for info in loaded.zip.infolist()))
                for name in loaded.files:
                    try:
                        values = loaded[name]
                        channels |= columns_of(name, values)
                    except ValueError:  # an array of Python objects
                        skipped.append(name)
                        continue
                    texts += lists_in(values)
                    single |= {name: values.item()} if values.size == 1 else {}
        units: dict[str, str] = {}
        super().__init__(named_by(channels, texts, units), units=units)
        self.sample_time = only_one(sample_times_said(single))
