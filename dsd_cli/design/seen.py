"""A planned motion as the sensor of a log would show it: its noise, its counts, and what is made of them."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from dsd_cli.design.inverse import Path, as_recording
from dsd_cli.errors import DataError
from dsd_cli.identify.fit.band import Band, passed_variance
from dsd_cli.identify.recordings.recording import Recording, prepare
from dsd_cli.plant.model import ObserverSettings
from dsd_cli.signals.encoder import encoder_step
from dsd_cli.signals.log import Array, Log, with_channels

#: Seed of the sensor's noise.
_SEED = 20261123


def as_seen(template: Recording, path: Path, u: Array, rest_speed: float, draw: int = 0) -> Recording | None:
    """The log of that motion at the samples of the template, prepared as every log is: how far its speed is known, and
    where the axis may rest or turn. None where the template had neither position nor speed, or its acceleration by a
    logged d_hat, or the motion is too short. draw : of the sensor's noise."""
    if template.sensor.noise.kind == "d_hat":
        return None
    step, random = template.sample_time, np.random.default_rng(_SEED + draw)
    count = int(path.times[-1] / step) + 1
    held = np.minimum((np.arange(count) * step / path.step + 1e-9).astype(int), len(u) - 1)
    channels = {"t": step * np.arange(count), "u": u[held]}
    if template.provenance.get("position") == "logged":
        channels["position"] = _counted(_at(path, path.position, channels["t"]), template, random)
    if math.isfinite(template.logged_speed_noise):
        heard = template.logged_speed_noise * random.standard_normal(count)
        channels["velocity"] = _at(path, path.velocity, channels["t"]) + heard
    if len(channels) == 2:
        return None
    log = Log(channels, step, "plan", u_hold=template.pieces[0].u_hold)
    try:  # d_hat is had from this observer's own inverse: any will do
        return prepare(log, ObserverSettings(1.0, 10.0 * step), rest_speed=rest_speed)
    except DataError:
        return None


def as_logged(template: Recording, path: Path, u: Array, rest_speed: float, draw: int = 0) -> Recording:
    """The same; what had no sensor of its own, by the noise of the template's acceleration alone."""
    seen = as_seen(template, path, u, rest_speed, draw)
    if seen is not None:
        return seen
    fine = path.resampled(template.sample_time)
    log = as_recording(template, fine, np.interp(fine.times, path.times, u), rest_speed)
    (piece,) = log.pieces
    noise = template.sensor.noise.made(len(piece), np.random.default_rng(_SEED + draw))
    return replace(log, pieces=(with_channels(piece, acceleration=piece["acceleration"] + noise),))


def times_white(seen: Recording, path: Path, band: Band, whitening: Array) -> float:
    """By how much more noise of the acceleration there is in whitened rows than white noise of the sensor would leave.

    Where a motion crosses the counts of an encoder more slowly than the band ends, these are no white noise but forces
    in the band.
    """
    (piece,) = seen.pieces
    step, t = piece.sample_time, piece["t"]
    if seen.sensor.two_intervals:
        exact = np.pad(np.diff(_at(path, path.position, t), 2) / step**2, 1, mode="edge")
    else:
        velocity = _at(path, path.velocity, t)
        exact = np.diff(velocity, prepend=velocity[:1]) / step
    rows = band.rows(piece["acceleration"] - exact, 0)
    if len(rows) < len(whitening):
        return 1.0
    white = np.convolve(rows, whitening, "same")
    return float(np.mean(white**2)) / max(passed_variance(whitening, band, seen.sensor.noise), 1e-300)


def _at(path: Path, x: Array, t: Array) -> Array:
    from scipy.interpolate import make_interp_spline

    return np.asarray(make_interp_spline(path.times, x, k=3)(t))


def _counted(q: Array, template: Recording, random: np.random.Generator) -> Array:
    """A position by the template's encoder, its edges anywhere within a count, or with the noise of its sensor."""
    if not (step := max(encoder_step(p["position"]) for p in template.pieces)) > 0.0:
        return q + template.position_noise * random.standard_normal(len(q))
    edge = random.uniform()
    return np.asarray(step * (np.round(q / step + edge) - edge))
