"""NetCDF 3 (SciPy): variables along one dimension; version 4 is HDF5."""

from __future__ import annotations

import numpy as np

from dsd_cli.files.formats.base import InMemory, check_size
from dsd_cli.signals.log import Array


class NetcdfFile(InMemory):
    """Variables by their names, scaled as they say, NaN where they say that nothing is; see `Container`."""

    def __init__(self, path: str) -> None:
        from scipy.io import netcdf_file

        channels: dict[str, Array] = {}
        units: dict[str, str] = {}
        with netcdf_file(path, "r", mmap=False, maskandscale=True) as file:
            for name, variable in file.variables.items():
                if len(variable.dimensions) == 1 and variable.data.dtype.kind in "iuf":
                    check_size(path, 8.0 * variable.data.size)
                    channels[name] = np.ma.filled(np.ma.asarray(variable[:], dtype=np.float64), np.nan)
                    said = getattr(variable, "units", b"")
                    units[name] = said.decode("utf-8", "replace") if isinstance(said, bytes) else ""
        super().__init__(channels, units=units)
