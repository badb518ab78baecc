"""A log made ready for identification: d_hat, and the motion that effects look at, each with its provenance.

Offline the whole log is at hand, so speed and position may be smoothed without phase (a detector cannot do that). The
smoothing only removes what the noise of the channel itself explains: an exact log is left as it is.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from dsd_cli.errors import DataError
from dsd_cli.identify.recordings.reconstruction import drift
from dsd_cli.identify.recordings.smoothing import Smoothed, smooth
from dsd_cli.plant.filtering import poles_of
from dsd_cli.plant.model import ObserverSettings
from dsd_cli.plant.observer import observe_log
from dsd_cli.plant.prediction import Frame
from dsd_cli.signals.log import Array, Log

#: Speeds within this many standard deviations of the speed's noise may be rest.
REST_DEVIATIONS = 3.0
#: A plant that sticks creeps: up to this share of its rms speed it is at rest.
CREEP = 1e-3
#: The measured acceleration is clear if its noise, as a force, is below this share of the rms of u.
CLEAR = 0.12
#: Standard errors by which signs must be clear before they are believed, where so many rows count as one.
CLEAR_SIGNS, CORRELATED = 8.0, 50.0
#: A reconstructed position whose drift is expected to exceed this share of its range is none.
MOST_DRIFT = 0.2


@dataclass(frozen=True)
class Recording:
    """One log, in stretches without gaps.

    Attributes
    ----------
    pieces : each with t, u, d_hat (sign of eq. 13) and the motion that could be had.
    provenance : channel -> "logged", "smoothed", "from position", "reconstructed from u and d_hat" or "computed
        from velocity" (d_hat).
    missing : channel -> why it cannot be had.
    rest_speed : speed up to which the plant may be at rest, as far as the measurement can tell.
    """

    name: str
    pieces: tuple[Log, ...]
    provenance: Mapping[str, str]
    missing: Mapping[str, str]
    rest_speed: float

    @property
    def samples(self) -> int:
        """Rows in all pieces."""
        return sum(len(piece) for piece in self.pieces)

    @property
    def sample_time(self) -> float:
        """s."""
        return self.pieces[0].sample_time


def shifted(recording: Recording, speed: float) -> Recording:
    """A reconstructed motion with that added to its speed, rad/s or m/s."""
    pieces = []
    for piece in recording.pieces:
        changed = {"velocity": piece["velocity"] + speed}
        if "position" in piece:
            changed["position"] = piece["position"] + speed * (piece["t"] - piece["t"][0])
        pieces.append(_with(piece, **changed))
    return replace(recording, pieces=tuple(pieces))


def prepare(log: Log, observer: ObserverSettings, restarts: Sequence[int] = (), rest_speed: float = 0.0) -> Recording:
    """The log in stretches, with d_hat and the motion.

    Parameters
    ----------
    restarts : samples that do not continue the one before.
    rest_speed : `[model] rest_speed`; the larger of it and what the noise asks for is kept.

    Raises
    ------
    DataError : the log lacks u, or everything that d_hat could be had from, or no stretch is long enough.
    """
    if "u" not in log:
        raise DataError(f"{log.source}: no u", "set signals.u to the column with the control input")
    edges = [0, *(at for at in restarts if 0 < at < len(log)), len(log)]
    pieces = [_part(log, a, b) for a, b in pairwise(edges) if b - a >= _SHORTEST]
    if not pieces:
        raise DataError(f"{log.source}: {len(log)} samples without a stretch of {_SHORTEST}", "a longer log is needed")
    provenance = {"u": "logged"}
    if "d_hat" in log:
        provenance["d_hat"] = "logged" if log.d_hat_source == "logged" else f"computed from {log.d_hat_source}"
        if observer.sign < 0:
            pieces = [_with(piece, d_hat=-piece["d_hat"]) for piece in pieces]
    else:
        settings = replace(observer, sign=1)
        pieces = [observe_log(piece, settings) for piece in pieces]
        provenance["d_hat"] = f"computed from {pieces[0].d_hat_source}"
    if "d_hat" in log:
        _check_signs(pieces, replace(observer, sign=1), log.source)
    pieces, noise, margin, missing = _with_motion(pieces, observer, provenance)
    creep = CREEP * max((float(np.sqrt(np.mean(p["velocity"] ** 2))) for p in pieces if "velocity" in p), default=0.0)
    rest = max(rest_speed, REST_DEVIATIONS * noise, creep)
    pieces = [_with(p, turning=_turning(p, observer, rest, margin)) for p in pieces]
    return Recording(log.source, tuple(pieces), provenance, missing, rest)


#: Samples of the shortest stretch that is used.
_SHORTEST = 50


def _part(log: Log, a: int, b: int) -> Log:
    channels = {name: x[a:b] for name, x in log.channels.items()}
    if "t" not in channels:
        channels["t"] = np.asarray(log.sample_time * np.arange(a, b), dtype=np.float64)
    return replace(log, channels=channels)


def _with(log: Log, **channels: Array) -> Log:
    return replace(log, channels={**log.channels, **channels})


def _with_motion(
    pieces: list[Log], observer: ObserverSettings, provenance: dict[str, str]
) -> tuple[list[Log], float, int, dict[str, str]]:
    """(pieces with the motion that can be had, noise of the speed, half width of its smoothing, what cannot be had)."""
    logged = pieces[0].channels
    if "position" in logged and "velocity" not in logged:
        found = [smooth(piece["position"], piece["t"]) for piece in pieces]
        provenance |= {"velocity": "from position", "position": _word(found)}
        done = [_with(p, velocity=s.slope, position=s.value) for p, s in zip(pieces, found, strict=True)]
        return done, max(s.slope_noise for s in found), _widest(found), {}
    if "velocity" in logged:
        found = [smooth(piece["velocity"], piece["t"]) for piece in pieces]
        provenance["velocity"] = _word(found)
        pieces = [_with(p, velocity=s.value) for p, s in zip(pieces, found, strict=True)]
        if "position" not in logged:
            provenance["position"] = "integrated from velocity"
            pieces = [_with(p, position=_integral(p["velocity"], p["t"])) for p in pieces]
        else:
            provenance["position"] = "logged"
        return pieces, max(s.value_noise for s in found), _widest(found), {}
    return _reconstructed(pieces, observer, provenance)


def _widest(found: Sequence[Smoothed]) -> int:
    return max(s.half_width for s in found)


def _turning(piece: Log, observer: ObserverSettings, rest_speed: float, margin: int) -> Array:
    """Acceleration of the intervals that start, stop or turn, and of `margin` beside them; else NaN.

    The smoothing that made the speed has spread each start and stop over so many samples. Where the measured
    acceleration is mostly noise that of the smoothed speed is taken: friction that explained noise, within its budget,
    would turn noise into force.
    """
    frame = Frame(piece)
    unclear = np.isfinite(frame.motion(rest_speed).acceleration)
    wide = np.convolve(unclear, np.ones(2 * margin + 1), "same") > 0.5
    change = np.diff(piece["velocity"], prepend=piece["velocity"][:1]) / frame.intervals
    raw = net_force(piece, observer) / observer.nominal_inertia
    noise = float(np.median(np.abs(raw - change))) * observer.nominal_inertia
    clear = piece.d_hat_source != "position" and noise < CLEAR * float(np.sqrt(np.mean(piece["u"] ** 2)))
    return np.where(wide, raw if clear else change, np.nan)


def _word(found: Sequence[Smoothed]) -> str:
    return "smoothed" if any(s.half_width for s in found) else "logged"


def _integral(x: Array, t: Array) -> Array:
    """Trapezoids, from 0."""
    return np.concatenate([[0.0], np.cumsum(0.5 * (x[1:] + x[:-1]) * np.diff(t))])


def _reconstructed(
    pieces: list[Log], observer: ObserverSettings, provenance: dict[str, str]
) -> tuple[list[Log], float, int, dict[str, str]]:
    """Motion from Jn a = Q^-1 d_hat + u.

    White noise s on d_hat becomes tau s / Jn on the speed (Q^-1 is proper in the speed) and a random walk of T s / Jn
    per sample. The speed at the start, and a slow drift, are found by `reconstruction.drift`.
    """
    done, smoothings, drifting = [], [], False
    for piece in pieces:
        force = net_force(piece, observer)
        intervals = Frame(piece).intervals
        speed = np.cumsum(force * intervals) / observer.nominal_inertia
        found = smooth(speed, piece["t"])
        found = replace(found, value=found.value - drift(found.value, force, piece))
        position = _integral(found.value, piece["t"])
        walk = found.value_noise * piece.sample_time * len(piece) / max(observer.time_constant, piece.sample_time)
        drifting |= walk * piece.sample_time * np.sqrt(len(piece)) > MOST_DRIFT * np.ptp(position)
        smoothings.append(found)
        done.append(_with(piece, velocity=found.value, position=position))
    provenance["velocity"] = provenance["position"] = "reconstructed from u and d_hat"
    noise, margin = max(s.value_noise for s in smoothings), _widest(smoothings)
    if not drifting:
        return done, noise, margin, {}
    del provenance["position"]
    reason = "the log has no position, and one integrated from u and d_hat would drift away"
    done = [replace(p, channels={k: x for k, x in p.channels.items() if k != "position"}) for p in done]
    return done, noise, margin, {"position": reason}


def _check_signs(pieces: Sequence[Log], observer: ObserverSettings, name: str) -> None:
    """A logged d_hat must be Q { Jn a } - Q u with the a of the logged motion.

    Raises
    ------
    DataError : a sign is wrong, as far as noise lets it be seen.
    """
    if not any(channel in pieces[0] for channel in ("velocity", "position")):
        return
    d_hat, force, drive = (np.concatenate(parts) for parts in zip(*(_sides(p, observer) for p in pieces), strict=True))
    x = np.stack([force, drive])
    (g, h), *_ = np.linalg.lstsq(x.T, d_hat, rcond=None)
    variance = CORRELATED * float(np.mean((d_hat - g * force - h * drive) ** 2))
    errors = np.sqrt(np.maximum(variance * np.diag(np.linalg.pinv(x @ x.T)), 1e-300))
    if (g > 0.0 > h) or min(abs(g) / errors[0], abs(h) / errors[1]) < CLEAR_SIGNS:
        return
    if g < 0.0 < h:
        raise DataError(f"{name}: d_hat has the other sign than its velocity or position", "set observer.sign")
    wrong = "velocity or position" if g < 0.0 else "u"
    raise DataError(f"{name}: {wrong} has the other sign than the other channels", f"turn the sign of {wrong}")


def _sides(piece: Log, observer: ObserverSettings) -> tuple[Array, Array, Array]:
    """(d_hat, Q { Jn a } from the motion, Q u), without the samples in which they settle."""
    motion = {name: x for name, x in piece.channels.items() if name != "d_hat"}
    if piece.d_hat_source == "position" and "position" in motion:
        motion.pop("velocity", None)
    bare = replace(piece, channels=motion, d_hat_source="logged")
    observed = observe_log(bare, observer)
    frame = Frame(observed)
    drive = frame.seen(frame.mean_u(piece["u"], 0.0), observer)
    first = min(int(5.0 * observer.time_constant / piece.sample_time) + 3, len(piece) // 2)
    return piece["d_hat"][first:], (observed["d_hat"] + drive)[first:], drive[first:]


def net_force(piece: Log, observer: ObserverSettings) -> Array:
    """Jn a, mean over the interval that ends at each sample, from d_hat and u: Q undone, shape (n,).

    Where d_hat averages two intervals (from position) so does this. The first sample is 0.
    """
    frame = Frame(piece)
    d_hat = piece["d_hat"]
    poles = poles_of(frame.intervals.tolist(), observer.time_constant)
    raw = np.zeros(len(d_hat))
    raw[1:] = (d_hat[1:] - poles[1:] * d_hat[:-1]) / (1.0 - poles[1:])
    u = frame.seen(frame.mean_u(piece["u"], 0.0), None)
    total = raw + u
    total[0] = 0.0
    return np.asarray(total)
