"""A log made ready for identification: d_hat, and the motion that effects look at, each with its provenance.

Offline the whole log is at hand, so the speed may be smoothed without phase (a detector cannot do that). The smoothing
only removes what the noise of the channel itself explains: an exact log is left as it is. A position stays as logged:
what smoothing takes off its motion is the same in all of the log, and bends values by more than noise does.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from dsd_cli.effects.memory import Coupling
from dsd_cli.errors import DataError, TooShort
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.recordings.reconstruction import drift
from dsd_cli.identify.recordings.sensor import Sensor, check_signs, net_force, with_acceleration, with_counts
from dsd_cli.identify.recordings.smoothing import Smoothed, channel_noise, noise_of, regularised, smooth, widened
from dsd_cli.identify.recordings.spectrum import NOTHING_LOST, Lost, cycle_of, lost_motion
from dsd_cli.plant.model import ObserverSettings
from dsd_cli.plant.observer import observe_log
from dsd_cli.plant.prediction import Frame
from dsd_cli.signals.continuous import in_pieces
from dsd_cli.signals.log import D_HAT_MAKER, Array, Log, with_channels
from dsd_cli.signals.spread import rms
from dsd_cli.signals.updates import SUMMED


@dataclass(frozen=True)
class Recording:
    """One log, in stretches without gaps, on a regular clock.

    pieces : each with t, u (held), d_hat (sign of eq. 13), the motion that could be had, and "acceleration": as
        measured, a mean over the interval that ends at each sample or, from position, over both intervals beside it.
    speed_noise, position_noise : standard deviation of the noise of the speed, and of the position.
    logged_speed_noise : of a speed as logged, even where the position showed a quieter one; NaN where none was.
    walk : of a reconstructed speed, the standard deviation that noise of d_hat makes it wander by in 1 s; else 0.
    sensor : what the acceleration was measured by, and its noise.
    provenance : channel -> "logged", "smoothed", "from position", "reconstructed from u and d_hat" or "computed
        from velocity" (d_hat).
    missing : channel -> why it cannot be had.
    rest_speed : speed up to which the plant may be at rest, as far as the measurement can show.
    pushed : (effect, share of the inertia, coupling) of the load that "push" of the pieces drives (`fit.driven_load`);
        None where the motion drives every load. levels : (effect, column, coefficient) of forces in this log alone.
    taken_off : kinds of parts of u that did not act, or of rows in which more did, that are no more in it.
    lost : what a low-pass has taken from the motion before it was logged.
    """

    name: str
    pieces: tuple[Log, ...]
    provenance: Mapping[str, str]
    missing: Mapping[str, str]
    rest_speed: float
    speed_noise: float
    position_noise: float
    logged_speed_noise: float
    walk: float
    sensor: Sensor
    pushed: tuple[str, float, Coupling] | None = None
    levels: tuple[tuple[str, int, float], ...] = ()
    taken_off: tuple[str, ...] = ()
    lost: Lost = NOTHING_LOST

    @property
    def samples(self) -> int:
        """Rows in all pieces."""
        return sum(len(piece) for piece in self.pieces)

    @property
    def sample_time(self) -> float:
        """s."""
        return self.pieces[0].sample_time

    @cached_property
    def cycle(self) -> float:
        """s after which the motion of the longest piece repeats itself; infinite where it does not, or none is had."""
        longest = max(self.pieces, key=len)
        return cycle_of(longest["velocity"], self.sample_time) if "velocity" in longest else math.inf


@dataclass(frozen=True)
class Mended:
    """Recordings, and held-out ones, without what was wrong with them. said : what that was, one sentence each."""

    recordings: tuple[Recording, ...]
    holdout: tuple[Recording, ...]
    said: tuple[str, ...]


def prepare(log: Log, observer: ObserverSettings, restarts: Sequence[int] = (), rest_speed: float = 0.0) -> Recording:
    """The log in stretches, with d_hat and the motion.

    restarts : samples that do not continue the one before.
    rest_speed : `[model] rest_speed`; the larger of it and what the noise asks for is kept.

    Raises DataError : the log lacks u, or everything that d_hat could be had from, or no stretch is long enough.
    """
    if "u" not in log:
        raise DataError(f"{log.source}: no u", "set signals.u to the column with the control input")
    log, edges = in_pieces(log, restarts)
    parts = [_part(log, a, b) for a, b in pairwise(edges) if b - a >= SHORTEST]
    if not parts:
        raise TooShort(f"{log.source}: {len(log)} samples without a stretch of {SHORTEST}", "a longer log is needed")
    pieces = [regularised(part) for part in parts]
    provenance = {"u": "logged"}
    if "d_hat" in log:
        provenance["d_hat"] = "logged" if log.d_hat_source == "logged" else f"logged, made of {log.d_hat_source}"
        if D_HAT_MAKER in log.metadata:
            provenance["d_hat"] = f"logged, made with {log.metadata[D_HAT_MAKER]}"
        if observer.sign < 0:
            pieces = [with_channels(piece, d_hat=-piece["d_hat"]) for piece in pieces]
        check_signs(pieces, replace(observer, sign=1), log.source)
    else:
        pieces = [observe_log(piece, replace(observer, sign=1)) for piece in pieces]
        provenance["d_hat"] = f"computed from {pieces[0].d_hat_source}"
    pieces, sensor = with_acceleration(pieces, observer)
    pieces, noise, margin, missing = _with_motion(pieces, parts, observer, provenance)
    sensor = with_counts(sensor, pieces)
    provenance |= {"position": "integrated from velocity"} if SUMMED in log.metadata else {}
    creep = POLICY.creep_share * max((rms(p["velocity"]) for p in pieces if "velocity" in p), default=0.0)
    walk = _walk(pieces, observer) if "reconstructed" in provenance["velocity"] else 0.0
    lost = lost_motion([p["acceleration"] for p in pieces], log.sample_time, sensor.noise.end)
    noise = math.hypot(noise, walk, lost.speed)
    rest = max(rest_speed, POLICY.rest_deviations * noise, creep)
    pieces = [with_channels(p, turning=_turning(p, observer, rest, max(margin, lost.reach))) for p in pieces]
    pieces = [with_channels(p, **_limits_of_rest(p["speed_noise"], noise, rest)) for p in pieces]
    # of a position that is integrated, what one sample adds
    position_noise = noise_of(log["position"]) if "position" in log else noise * log.sample_time
    logged = noise_of(log["velocity"]) if "velocity" in log else math.nan
    return Recording(
        log.source, tuple(pieces), provenance, missing, rest, noise, position_noise, logged, walk, sensor, lost=lost
    )


def _limits_of_rest(by_sample: Array, noise: float, rest: float) -> dict[str, Array]:
    """ "rest_speed" and "speed_noise" of every sample: where a window of the smoothing had to end early there is more
    noise, and the window may have ended late by what it allows."""
    narrow = by_sample > _WIDER * by_sample.min()
    return {
        "rest_speed": np.where(narrow, np.maximum(rest, POLICY.windows_agree * by_sample), rest),
        "speed_noise": np.maximum(noise, by_sample),
    }


def _walk(pieces: Sequence[Log], observer: ObserverSettings) -> float:
    """White noise s on d_hat adds T s / Jn to the integrated speed at every sample; after 1 s, unit of speed."""
    noise = max(noise_of(p["d_hat"]) for p in pieces)
    return float(noise * np.sqrt(pieces[0].sample_time) / observer.nominal_inertia)


#: Logs are of one rate whose sample times are no further apart than this share.
_OTHER_RATE = 0.1


def check_one_rate(recordings: Sequence[Recording]) -> None:
    """Raises DataError where sample times differ."""
    first = recordings[0]
    for other in recordings[1:]:
        if abs(other.sample_time - first.sample_time) > _OTHER_RATE * first.sample_time:
            raise DataError(
                f"{other.name}: {other.sample_time:g} s between samples, {first.name} has {first.sample_time:g} s",
                "logs that go together are of one rate: give these one by one",
            )


#: The speed that forces go by, where it is not that by which direction and rest are known.
SHARP = "sharp_velocity"
#: Samples of the shortest stretch that is used.
SHORTEST = 50
#: Times the least noise of all samples, from which on the smoothing had to end early at one.
_WIDER = 1.01


def _part(log: Log, a: int, b: int) -> Log:
    channels = {name: x[a:b] for name, x in log.channels.items()}
    if "t" not in channels:
        channels["t"] = np.asarray(log.sample_time * np.arange(a, b), dtype=np.float64)
    return replace(log, channels=channels)


def _with_motion(
    pieces: list[Log], parts: Sequence[Log], observer: ObserverSettings, provenance: dict[str, str]
) -> tuple[list[Log], float, int, dict[str, str]]:
    """(pieces with the motion that can be had, noise of the speed, half width of its smoothing, what cannot be had).

    parts : the pieces before they were put on a regular clock.
    """
    logged = pieces[0].channels
    if "position" in logged and "velocity" not in logged:
        provenance |= {"velocity": "from position", "position": "logged"}
        return *_with_speed(pieces, _smoothed(pieces, parts, "position"), slopes=True), {}
    if "velocity" in logged:
        return _with_velocity(pieces, parts, provenance)
    return _reconstructed(pieces, observer, provenance)


def _smoothed(pieces: Sequence[Log], parts: Sequence[Log], name: str) -> list[Smoothed]:
    """A channel of every piece, smoothed by the noise that it had when it was logged."""
    found = []
    for piece, part in zip(pieces, parts, strict=True):
        known = channel_noise(piece[name], part[name], piece["white"]) if "white" in piece else None
        found.append(smooth(piece[name], piece["t"], known))
    return found


def _with_velocity(
    pieces: list[Log], parts: Sequence[Log], provenance: dict[str, str]
) -> tuple[list[Log], float, int, dict[str, str]]:
    """As `_with_motion` where the speed is logged; the slope of the position takes its place where that is quieter."""
    found = _smoothed(pieces, parts, "velocity")
    if "position" not in pieces[0]:
        provenance |= {"velocity": _word(found), "position": "integrated from velocity"}
        pieces, noise, width = _with_speed(pieces, found)
        return [with_channels(p, position=_integral(p["velocity"], p["t"])) for p in pieces], noise, width, {}
    slopes = _smoothed(pieces, parts, "position")
    quieter = max(s.slope_noise for s in slopes) < max(s.value_noise for s in found)
    provenance |= {"velocity": "from position" if quieter else _word(found), "position": "logged"}
    return *_with_speed(pieces, slopes if quieter else found, quieter), {}


def _with_speed(pieces: Sequence[Log], found: Sequence[Smoothed], slopes: bool = False) -> tuple[list[Log], float, int]:
    """(the pieces with what was smoothed, or its slopes, as their speed, its noise, half width of the smoothing)."""
    speeds = [(s.slope, s.slope_spread) if slopes else (s.value, s.value_spread) for s in found]
    sharp = [{SHARP: s.sharp} if slopes and s.sharp is not None else {} for s in found]
    parts = zip(pieces, speeds, sharp, strict=True)
    done = [with_channels(p, velocity=v, speed_noise=noise, **more) for p, (v, noise), more in parts]
    return done, max(s.slope_noise if slopes else s.value_noise for s in found), _widest(found)


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
    wide = widened(unclear, margin)
    change = np.diff(piece["velocity"], prepend=piece["velocity"][:1]) / frame.intervals
    raw = net_force(piece, observer) / observer.nominal_inertia
    noise = float(np.median(np.abs(raw - change))) * observer.nominal_inertia
    clear = piece.d_hat_source != "position" and noise < POLICY.clear_acceleration * rms(piece["u"])
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
        found = replace(found, value=found.value - drift(found.value, force, piece, _walk([piece], observer)))
        position = _integral(found.value, piece["t"])
        walk = found.value_noise * piece.sample_time * len(piece) / max(observer.time_constant, piece.sample_time)
        drifting |= walk * piece.sample_time * np.sqrt(len(piece)) > POLICY.most_drift * np.ptp(position)
        smoothings.append(found)
        done.append(with_channels(piece, velocity=found.value, position=position, speed_noise=found.value_spread))
    provenance["velocity"] = provenance["position"] = "reconstructed from u and d_hat"
    noise, margin = max(s.value_noise for s in smoothings), _widest(smoothings)
    if not drifting:
        return done, noise, margin, {}
    del provenance["position"]
    reason = "the log has no position, and one integrated from u and d_hat would drift away"
    done = [replace(p, channels={k: x for k, x in p.channels.items() if k != "position"}) for p in done]
    return done, noise, margin, {"position": reason}
