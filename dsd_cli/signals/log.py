"""A measured (or simulated) log in memory."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
DHatSource = Literal["logged", "velocity", "position"]
Hold = Literal["held", "sampled"]

#: Metadata of a log whose d_hat another maker computed: in which way; it has been turned into that of this package.
D_HAT_MAKER = "d_hat_maker"

#: Canonical channel names, in the order in which files are written.
CHANNELS = (
    "t",
    "u",
    "d_hat",
    "position",
    "velocity",
    "reference",
    "true_delay",
    "true_inertia",
)


@dataclass(frozen=True)
class Log:
    """Read-only float64 channels of equal length.

    Sample k holds what was measured at t_k, and the u that acts from t_k to t_k+1 (zero-order hold), unless `u_hold`
    says that u too was measured, as a continuous signal at t_k.

    Attributes
    ----------
    channels : canonical name (see `CHANNELS`) -> array, shape (n,); SI units, u in the user's unit.
    sample_time : s.
    source : where the log came from, for messages.
    d_hat_source : what d_hat was computed from; `"position"` means that it averages two intervals.
    metadata : provenance (config, seed) as text.
    u_hold : "held": a drive holds u_k from t_k to t_k+1; "sampled": u is a continuous signal, u_k its value at t_k.

    Raises
    ------
    ValueError : channels of unequal length.
    """

    channels: Mapping[str, Array]
    sample_time: float
    source: str = "<memory>"
    d_hat_source: DHatSource = "logged"
    metadata: Mapping[str, str] = field(default_factory=dict)
    u_hold: Hold = "held"

    def __post_init__(self) -> None:
        frozen = {}
        for name, values in self.channels.items():
            frozen[name] = _frozen(values)
        if len({column.size for column in frozen.values()}) > 1:
            raise ValueError("channels of unequal length")
        object.__setattr__(self, "channels", MappingProxyType(frozen))

    def __getitem__(self, name: str) -> Array:
        return self.channels[name]

    def __contains__(self, name: str) -> bool:
        return name in self.channels

    def __len__(self) -> int:
        return next(iter(self.channels.values())).size if self.channels else 0


def _frozen(values: Array) -> Array:
    """A read-only copy; the array itself, or a part of one, where nobody can write to it: channels of another log."""
    if isinstance(values, np.ndarray) and values.dtype == np.float64 and values.flags.c_contiguous:
        owner = values if values.base is None else values.base
        if isinstance(owner, np.ndarray) and owner.base is None and not owner.flags.writeable:
            return values
    column = np.array(values, dtype=np.float64)
    column.flags.writeable = False
    return column


def with_channels(log: Log, **channels: Array) -> Log:
    """The log with these channels in place or added, shape (n,) each."""
    return replace(log, channels={**log.channels, **channels})
