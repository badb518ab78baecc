"""Logs of machines with hidden effects, made without the package that is to find them; NumPy only.

`run(cases)` integrates all cases at once. Each machine is a plant in fine steps under a P-PI position loop that sees
only measured signals; the log starts after the loop has settled. Row k holds what was measured at t_k and the command
that is held from t_k to t_(k+1) and acts on the plant `delay` seconds later.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from tests.oracle.machine_laws import PLANT_VALUES, Values, random_walk
from tests.oracle.machine_motion import Motion, injection, reference
from tests.oracle.machine_plant import Plant

Array = NDArray[np.float64]

SETTLE = 0.6  # s of running that are not logged
SPEED_FILTER = 0.002  # s, of the speed that a loop with only an encoder differentiates
SENSINGS = {
    "all": ("u", "velocity", "position", "d_hat"),
    "velocity": ("u", "velocity", "position"),
    "position": ("u", "position"),
    "d_hat": ("u", "d_hat"),
}


@dataclass(frozen=True)
class Case:
    """One machine, what is believed about it and how it is run and measured. SI, rotary."""

    hidden: tuple[tuple[str, Values], ...]  # effects the belief lacks; "inertia" and "delay" repeat the true value
    inertia: float  # kg m2, true, of all masses together
    delay: float  # s, true
    believed_inertia: float
    believed_delay: float
    nominal_inertia: float  # Jn of the observer
    observer_time_constant: float  # s
    motion: Motion
    base: tuple[tuple[str, Values], ...] = ()  # effects that are there and believed
    sample_time: float = 0.001
    duration: float = 10.0
    channels: str = "all"  # a key of SENSINGS
    d_hat_noise: float = 0.0  # N m, white, added to a d_hat that is logged
    velocity_noise: float = 0.0  # rad/s, white
    encoder_step: float = 0.0  # rad; 0 is a perfect encoder
    feedforward: float = 0.9  # share of J a_reference that the controller adds
    command_limit: float = np.inf  # N m, the controller's own limit, seen in the logged u
    seed: int = 0


@dataclass(frozen=True)
class Recording:
    """A log and the truth about it; the rms values are in N m of d_hat, over the whole log."""

    channels: dict[str, Array]  # "t" and only what this sensing logs
    truth: Case
    noise_floor: float  # d_hat of the measured against d_hat of the exact motion, same u
    hidden_rms: float  # d_hat that the believed model cannot explain given the exact motion
    drive_rms: float  # of the command u
    tracking_rms: float = field(default=0.0)  # rad, position against reference

    @property
    def ratio(self) -> float:
        """Error of the believed model over error of the true one: 1.05 means that the true law gains 5 %."""
        return float(np.hypot(self.hidden_rms, self.noise_floor) / self.noise_floor) if self.noise_floor else np.inf


@dataclass
class _Trace:
    """Rows of all lanes, settling included: (rows, lanes)."""

    t: Array
    u: Array
    q: Array
    v: Array
    q_seen: Array
    v_seen: Array
    base: Array  # mean force of the base effects from this row to the next
    wanted: Array


def run(cases: Sequence[Case]) -> list[Recording]:
    """One recording per case, in order; cases of the same sample time and duration are integrated together."""
    groups: dict[tuple[float, float], list[int]] = {}
    for i, case in enumerate(cases):
        groups.setdefault((case.sample_time, case.duration), []).append(i)
    made: dict[int, Recording] = {}
    for members in groups.values():
        batch = [cases[i] for i in members]
        trace = _closed_loop(batch)
        d_hats = _d_hats(batch, trace)
        made |= {i: _recording(batch[lane], trace, d_hats, lane) for lane, i in enumerate(members)}
    return [made[i] for i in range(len(cases))]


def plant_of(batch: Sequence[Case], times: Array) -> Plant:
    """The true machines of a batch; `times` are those of the rows, negative while settling."""
    effects = [{name: dict(p) for name, p in (*c.base, *c.hidden) if name not in PLANT_VALUES} for c in batch]
    for case, lane in zip(batch, effects, strict=True):
        assert len(lane) == len([n for n, _ in (*case.base, *case.hidden) if n not in PLANT_VALUES]), "an id twice"
        if "random_load" in lane:
            lane["random_load"]["path"] = random_walk(lane["random_load"]["rms"], times, case.seed)
        elif any("random_load" in other for other in effects):
            lane["random_load"] = {"path": np.zeros(len(times))}
    plant = Plant(
        np.array([c.inertia for c in batch]),
        np.array([c.delay for c in batch]),
        effects,
        [[name for name, _ in c.base] for c in batch],
        batch[0].sample_time,
        len(times),
        max(10, round(batch[0].sample_time / 1e-4)),
    )
    for i, (law, values, mask) in enumerate(plant.forces):
        if "path" in values:
            plant.forces[i] = law, {"path": np.ascontiguousarray(values["path"].T)}, mask
    return plant


def bandwidth(case: Case) -> float:
    """Speed-loop bandwidth (rad/s) that the true dead times and resonances of the machine allow."""
    hidden = dict(case.hidden)
    dead_time = case.delay + 1.5 * case.sample_time + (SPEED_FILTER if case.channels == "position" else 0.0)
    dead_time += 0.5 * hidden.get("actuator_lag", {}).get("time_constant", 0.0)
    allowed = min(60.0, 0.4 / dead_time)
    if "flexible_coupling" in hidden:
        p = hidden["flexible_coupling"]
        resonance = 2 * np.pi * p["frequency"]
        if resonance * dead_time > 0.8:  # the loop would feed the resonance
            allowed = min(allowed, 0.8 * p["damping"] * resonance / p["load_share"])
    return min(allowed, 40.0) if "backlash" in hidden else allowed


def _closed_loop(batch: Sequence[Case]) -> _Trace:
    """P-PI loop on measured signals; the command is held for a sample."""
    T = batch[0].sample_time
    settle = round(SETTLE / T)
    rows = settle + round(batch[0].duration / T)
    times = (np.arange(rows) - settle) * T
    plans = [reference(c.motion, times, c.duration, c.seed) for c in batch]
    wanted, speeds, ramps = (np.array([p[i] for p in plans]).T for i in range(3))
    extra = np.array([injection(c.motion, times, c.duration, c.seed) for c in batch]).T
    extra += ramps * np.array([c.feedforward * c.inertia for c in batch])
    sensors, trace = _Sensors(batch, rows), np.zeros((7, rows, len(batch)))
    plant, wc = plant_of(batch, times), np.array([bandwidth(c) for c in batch])
    gain = wc * np.array([c.inertia for c in batch])
    limit = np.array([c.command_limit for c in batch])
    integral = np.zeros(len(batch))
    u_all, q_all, v_all, qs, vs, base, _ = trace
    for row in range(rows):
        q, v = plant.measured()
        q_seen, v_seen, v_loop = sensors.read(row, q, v)
        error = speeds[row] + wc / 5 * (wanted[row] - q_seen) - v_loop
        wish = gain * error + integral + extra[row]
        u = np.clip(wish, -limit, limit)
        integral += np.where(u == wish, gain * wc / 6 * T * error, 0.0)
        u_all[row], q_all[row], v_all[row], qs[row], vs[row] = u, q, v, q_seen, v_seen
        base[row] = plant.step(row, times[row], u)
    return _Trace(times, u_all, q_all, v_all, qs, vs, base, wanted)


class _Sensors:
    """Encoder steps and noise of every lane; the speed the loop gets."""

    def __init__(self, batch: Sequence[Case], rows: int) -> None:
        self.T = batch[0].sample_time
        self.steps = np.array([c.encoder_step for c in batch])
        self.phase = np.array([np.random.default_rng([c.seed, 14]).uniform() for c in batch])
        noise = [np.random.default_rng([c.seed, 15]).normal(size=rows) * c.velocity_noise for c in batch]
        self.noise = np.array(noise).T
        self.encoder_only = np.array([c.channels == "position" for c in batch])
        self.keep = np.exp(-self.T / SPEED_FILTER)
        self.last, self.speed = np.zeros(len(batch)), np.zeros(len(batch))

    def read(self, row: int, q: Array, v: Array) -> tuple[Array, Array, Array]:
        """Position and velocity as logged, velocity as the loop has it."""
        safe = np.where(self.steps > 0.0, self.steps, 1.0)
        seen = np.where(self.steps > 0.0, (np.round(q / safe + self.phase) - self.phase) * safe, q)
        raw = (seen - self.last) / self.T if row else np.zeros_like(q)
        self.last = seen
        self.speed = self.keep * self.speed + (1.0 - self.keep) * raw
        noisy = v + self.noise[row]
        return seen, noisy, np.where(self.encoder_only, self.speed, noisy)


def _d_hats(batch: Sequence[Case], trace: _Trace) -> dict[str, Array]:
    """d_hat as measured, of the exact motion by the same formula, and what the believed model leaves of it."""
    T = batch[0].sample_time
    nominal = np.array([c.nominal_inertia for c in batch])
    believed = nominal / np.array([c.believed_inertia for c in batch])
    p = np.exp(-T / np.array([c.observer_time_constant for c in batch]))
    from_encoder = np.array([c.channels == "position" for c in batch])
    exact_only = np.array([c.channels == "d_hat" for c in batch])
    seen = nominal * np.where(from_encoder, bend(trace.q_seen, T), slope(trace.v_seen, T))
    seen = np.where(exact_only, nominal * slope(trace.v, T), seen)
    exact = nominal * np.where(from_encoder, bend(trace.q, T), slope(trace.v, T))
    drive = mean_drive(trace.u, np.array([c.believed_delay for c in batch]), T)
    known = believed * np.vstack([np.zeros(len(batch)), (drive + trace.base)[:-1]])
    noise = [np.random.default_rng([c.seed, 16]).normal(size=len(trace.t)) * c.d_hat_noise for c in batch]
    last_u = np.vstack([np.zeros(len(batch)), trace.u[:-1]])
    subtracted = np.where(from_encoder, 0.5 * (last_u + np.vstack([np.zeros(len(batch)), last_u[:-1]])), last_u)
    return {
        "measured": low_pass(seen - subtracted, p) + np.array(noise).T,
        "exact": low_pass(exact - subtracted, p),
        "hidden": low_pass(nominal * slope(trace.v, T) - known, p),
    }


def slope(values: Array, sample_time: float) -> Array:
    """Backward difference over time; 0 in the first row."""
    return np.vstack([np.zeros_like(values[:1]), np.diff(values, axis=0)]) / sample_time


def bend(values: Array, sample_time: float) -> Array:
    """Second backward difference over time squared; 0 in the first two rows."""
    return np.vstack([np.zeros_like(values[:2]), np.diff(values, n=2, axis=0)]) / sample_time**2


def low_pass(raw: Array, p: Array) -> Array:
    """d_k = p d_(k-1) + (1 - p) raw_k for every lane, from 0."""
    out, state = np.empty_like(raw), np.zeros(raw.shape[1])
    for k, row in enumerate(raw):
        state = p * state + (1.0 - p) * row
        out[k] = state
    return out


def mean_drive(u: Array, delay: Array, sample_time: float) -> Array:
    """Exact mean over [t_k, t_(k+1)) of the held command, `delay` seconds late; 0 before the first row."""
    whole = np.floor(delay / sample_time + 1e-12).astype(int)
    late = delay / sample_time - whole
    padded = np.vstack([np.zeros((int(whole.max()) + 1, u.shape[1])), u])
    newest = np.arange(len(u))[:, None] + int(whole.max()) + 1 - whole[None, :]
    new, old = np.take_along_axis(padded, newest, axis=0), np.take_along_axis(padded, newest - 1, axis=0)
    return (1.0 - late) * new + late * old


def _recording(case: Case, trace: _Trace, d_hats: dict[str, Array], lane: int) -> Recording:
    log = trace.t > -0.5 * case.sample_time
    rows = {name: values[log, lane] for name, values in d_hats.items()}
    every = {"u": trace.u, "velocity": trace.v_seen, "position": trace.q_seen, "d_hat": d_hats["measured"]}
    return Recording(
        {"t": trace.t[log]} | {name: every[name][log, lane].copy() for name in SENSINGS[case.channels]},
        case,
        noise_floor=rms(rows["measured"] - rows["exact"]),
        hidden_rms=rms(rows["hidden"]),
        drive_rms=rms(trace.u[log, lane]),
        tracking_rms=rms((trace.q - trace.wanted)[log, lane]),
    )


def rms(values: Array) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(values**2)))
