"""Which values of a model this log identifies: the band-limited force balance, linearised around the model."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsd_cli.effects import get_effect
from dsd_cli.errors import UsageError
from dsd_cli.identify.checks.balance import REST, in_phase, motion_columns, orthonormal, without
from dsd_cli.identify.checks.motion import Motion, asked_for, in_two_stages, motion_of
from dsd_cli.identify.checks.results import Parameter
from dsd_cli.identify.checks.scan import Scanned, View, block_starts
from dsd_cli.identify.checks.stretches import LowPass, Stretch
from dsd_cli.identify.checks.values import believable, delay_of
from dsd_cli.identify.fit.estimates import Grade, grade
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.plant.prediction import Frame
from dsd_cli.signals.log import Array, Log

#: Correlation from which two values cannot be told apart.
TIED = 0.98
#: A value of 0 is judged by the force that it stands for: this share of u.
_SMALL_FORCE = 0.05
_STEP = 1e-3
#: A value is bent where forces of the motion beside the model move it by more than so many standard errors.
_BENT = 3.0
#: A column below this share of u is none.
_NOTHING = 1e-9


@dataclass(frozen=True)
class _Value:
    """One value of a model: `name` as in `Parameter.name`."""

    name: str
    value: float
    unit: str

    def stepped(self, model: PlantModel) -> tuple[PlantModel, float]:
        """The model with this value a little changed, within its bounds, and by how much."""
        step = _STEP * (abs(self.value) if self.value else 1.0)
        try:
            return model.with_values({self.name: self.value + step}), step
        except UsageError:
            return model.with_values({self.name: self.value - step}), -step


def check_parameters(view: View, model: PlantModel | None, observer: ObserverSettings | None) -> tuple[Parameter, ...]:
    """Every number of the model; inertia and delay as the log has them where there is no model.

    Without a model, friction, weight and springs of any size stand beside them, and both are as unsure as they are
    apart from the scan over all delays: where u switches as friction turns, least squares about a delay leads astray.
    """
    scanned = believable(view) if model is None else None
    given = model if scanned is None else PlantModel(scanned.inertia, max(delay_of(scanned, view), 0.0))
    if given is None:
        return unknown_parameters(None)
    values = tuple(_values(given))
    rows = _rows(view, given, values, observer)
    if rows is None:
        return unknown_parameters(given)
    T = view.log.sample_time
    both = [_estimates(values, rows, others, T) for others in (rows.others[:, : 0 if model else None], rows.others)]
    lacks_force = 2.0 * both[1].rest < both[0].rest  # noise that comes back is left beside any force
    leaning = {name: value for one in reversed(both[lacks_force:]) for name, value in one.leaning.items()}
    alone, beside = (one.by_instruments if leaning else one.least_squares for one in both)
    if scanned is not None and not leaning:  # the scan leans as least squares do
        return tuple(_between(one, other, T) for one, other in zip(alone, _scanned(scanned, view), strict=True))
    found = tuple(
        replace(
            _bent(one, other, T, lacks_force),
            leaning=leaning.get(one.name),
            below_zero=one.value < -_BENT * one.std_error and other.value < 0.0,
        )
        for one, other in zip(alone, beside, strict=True)
    )
    return found if view.band is not None else tuple(_drifting(one) for one in found)


def _between(one: Parameter, scanned: Parameter, T: float) -> Parameter:
    """A value with what it is apart from the scan counted as its error."""
    error = math.hypot(one.std_error, abs(scanned.value - one.value))
    judged = grade(one.value, error, T) if one.name == "delay" else grade(abs(one.value), error)
    return replace(one, identified=judged, std_error=error)


def _bent(one: Parameter, beside: Parameter, T: float, lacks_force: bool) -> Parameter:
    """An inertia or a delay that takes the place of a force that the model lacks is wrong by what that moves it.

    `beside` : the same with friction, weight and springs of any size beside the model. All other values are such forces
    themselves. Noise that a controller answers moves least squares likewise, as the motion that such forces leave has a
    larger share of it; instruments it moves by chance alone.
    """
    if "." in one.name or not _moved(one, beside):
        return one
    moved = abs(beside.value - one.value)
    error = math.hypot(one.std_error, moved)
    judged = grade(one.value, error, T) if one.name == "delay" else grade(abs(one.value), error)
    told = None if judged == one.identified else beside.value
    return replace(one, identified=judged, std_error=error, beside=told, lacks_force=lacks_force)


def _moved(one: Parameter, beside: Parameter) -> bool:
    return abs(beside.value - one.value) > _BENT * beside.std_error


def _drifting(one: Parameter) -> Parameter:
    """A motion that was integrated from u and d_hat drifts: what looks at it is weak at best."""
    by_motion = "." in one.name and {"velocity", "position"} & set(get_effect(one.name.partition(".")[0]).needs)
    return replace(one, identified="weak") if by_motion and one.identified == "identified" else one


def unknown_parameters(model: PlantModel | None) -> tuple[Parameter, ...]:
    """The same where a log says nothing of them."""
    return tuple(_unknown(value) for value in _values(PlantModel() if model is None else model))


_INERTIA = "{u}/({v}/s)"


def _scanned(fit: Scanned, view: View) -> tuple[Parameter, ...]:
    return (
        Parameter("inertia", "weak", fit.inertia, fit.inertia_error, _INERTIA),
        Parameter("delay", "weak", delay_of(fit, view), fit.shift_error, "s"),
    )


def _values(model: PlantModel) -> Iterator[_Value]:
    yield _Value("inertia", model.inertia, _INERTIA)
    yield _Value("delay", model.delay, "s")
    for effect, parameters in model.effects.items():
        known = {p.name: p for p in get_effect(effect).parameters}
        for name, value in parameters.items():
            if known[name].numeric:
                yield _Value(f"{effect}.{name}", float(value), known[name].unit)


def _unknown(value: _Value) -> Parameter:
    return Parameter(value.name, "not", math.nan, math.inf, value.unit)


@dataclass(frozen=True)
class _Rows:
    """What the model leaves, shape (rows,), its slopes by the values, (rows, values), other forces of the motion,
    (rows, 6), both along the reference, (rows, values + 6), NaN where a log has none, and the deviation of u."""

    left: Array
    slopes: Array
    others: Array
    along: Array
    drive: float


def _rows(view: View, model: PlantModel, values: Sequence[_Value], observer: ObserverSettings | None) -> _Rows | None:
    """None: too few."""
    parts, offset = [], 0.0
    for s in view.stretches:
        motion = motion_of(s, view, observer)
        if motion is None:
            continue
        keep = LowPass(s.T, motion.cutoff)
        rows = keep.rows(s.t.size, int(model.delay / s.T) + 2)
        speed = motion.velocity[rows]
        moving = np.abs(speed) > REST * np.sqrt(np.mean(motion.velocity**2))
        if s.u is not None and moving.sum() > 2:
            at = offset + s.T * rows[moving]
            parts.append((*_stretch_rows(s, motion, keep, rows[moving], model, values), at))
        offset += s.T * s.t.size
    if not parts:
        return None
    *found, u, at = (np.concatenate(x) for x in zip(*parts, strict=True))
    if at.size < 4 * len(values):
        return None
    order = in_phase(at, view.cycle)
    left, slopes, others, along = (x[order] for x in found)
    return _Rows(left, slopes, others, along, float(np.std(u)))


def _stretch_rows(
    s: Stretch, motion: Motion, keep: LowPass, rows: NDArray[np.int64], model: PlantModel, values: Sequence[_Value]
) -> tuple[Array, ...]:
    assert s.u is not None
    found = _columns(s, motion, keep, rows, model, values)
    if s.reference is None:
        along = np.full((rows.size, found[1].shape[1] + found[2].shape[1]), np.nan)
    else:
        idle, asked = asked_for(s, model, keep)
        asked = replace(asked, noise=motion.noise)  # it turns as the motion does
        along = np.column_stack(_columns(idle, asked, keep, rows, model, values)[1:])
    return *found, along, keep.at(s.u, rows)


def _columns(
    s: Stretch, motion: Motion, keep: LowPass, rows: NDArray[np.int64], model: PlantModel, values: Sequence[_Value]
) -> tuple[Array, Array, Array]:
    """What the model leaves of u along a motion, its slopes by the values, other forces of that motion."""
    frame = Frame(Log(motion.channels(s), s.T))
    mean = 0.5 * (motion.acceleration + np.concatenate([motion.acceleration[:1], motion.acceleration[:-1]]))

    def left(one: PlantModel) -> Array:
        return np.asarray(one.motor_inertia * mean[rows] - keep.at(frame.net_force(one), rows))

    here = left(model)
    slopes = []
    for value in values:
        changed, step = value.stepped(model)
        slopes.append((left(changed) - here) / step)
    others = motion_columns(motion.velocity, motion.position, motion.sharp, motion.noise, keep, rows)
    return here, np.column_stack(slopes), others


class _Estimates(NamedTuple):
    """Values by least squares, their mean square `rest`, and by instruments; `leaning`: those of inertia and delay by
    least squares that differ from the instruments' by more than chance, and than an identified value may be off."""

    rest: float
    least_squares: tuple[Parameter, ...]
    by_instruments: tuple[Parameter, ...] = ()
    leaning: Mapping[str, float] = MappingProxyType({})


def _estimates(values: Sequence[_Value], rows: _Rows, others: Array, T: float) -> _Estimates:
    """With `others` beside the model, shape (rows, m).

    Hausman's test (1978): least squares is the surer of both and right unless noise comes back through a controller;
    instruments are right in any loop. Their difference scatters by what each block pulls at it, and by no less than
    the one is less sure than the other.
    """
    basis = orthonormal(others) if others.shape[1] else others
    slopes = without(basis, rows.slopes)
    left = without(basis, rows.left)
    found, pulls = _judged(values, left, slopes, slopes, rows.drive, T)
    rest = float(np.mean(without(orthonormal(slopes), left) ** 2))
    if not np.isfinite(rows.along).all():
        return _Estimates(rest, found)
    along = rows.along[:, : len(values) + others.shape[1]]
    right, pulled = _judged(values, *in_two_stages(rows.left, rows.slopes, others, along), rows.drive, T)
    leaning = {}
    for one, by, spread in zip(found, right, np.linalg.norm(pulled - pulls, axis=0).tolist(), strict=True):
        moved, step = abs(by.value - one.value), T if one.name == "delay" else math.nan
        chance = max(spread, math.sqrt(max(by.std_error**2 - one.std_error**2, 0.0)))
        if "." not in one.name and moved > _BENT * chance and grade(abs(by.value), moved, step) != "identified":
            leaning[one.name] = one.value
    return _Estimates(rest, found, right, leaning)


def _judged(
    values: Sequence[_Value], left: Array, slopes: Array, hat: Array, drive: float, T: float
) -> tuple[tuple[Parameter, ...], Array]:
    """Least squares around the model; errors that are correlated within a block are counted.

    hat : what instruments explain of the slopes, shape (rows, values); without instruments these themselves. Also by
    how much each block pulls at each value, shape (blocks, values).
    """
    sizes = np.sqrt(np.mean(slopes**2, axis=0))
    weights = np.array([value.value or 1.0 for value in values])
    seen = sizes * np.abs(weights) > _NOTHING * max(drive, 1e-300)
    found: dict[int, Parameter] = {}
    columns = np.flatnonzero(seen).tolist()
    starts = block_starts(left.size)
    pulls = np.zeros((len(starts), len(values)))
    if columns:
        x, h = slopes[:, columns] / sizes[columns], hat[:, columns] / sizes[columns]
        inverse = np.linalg.inv(h.T @ h / left.size + 1e-12 * np.eye(len(columns)))
        change = -inverse @ (h.T @ left) / left.size
        rest = left + x @ change
        pulls[:, columns] = np.add.reduceat(h * rest[:, None], starts) / left.size @ inverse / sizes[columns]
        plain = np.diag(inverse) * float(np.mean(rest**2)) / left.size / sizes[columns] ** 2
        errors = np.sqrt(np.maximum(np.sum(pulls[:, columns] ** 2, axis=0), plain))
        scale = np.sqrt(np.diag(inverse))
        correlation = inverse / np.outer(scale, scale)
        for i, column in enumerate(columns):
            tied = [values[other].name for j, other in enumerate(columns) if j != i and abs(correlation[i, j]) > TIED]
            value = values[column].value + float(change[i]) / float(sizes[column])
            grade = _grade(values[column], value, float(errors[i]), _SMALL_FORCE * drive / float(sizes[column]), T)
            found[column] = Parameter(
                values[column].name, grade, value, float(errors[i]), values[column].unit, tuple(tied)
            )
    return tuple(found.get(i) or _unknown(value) for i, value in enumerate(values)), pulls


def _grade(value: _Value, fitted: float, error: float, small: float, T: float) -> Grade:
    if value.name == "delay":
        return grade(fitted, error, T)
    size = 1.0 if value.unit == "rad" else abs(fitted) if value.value else max(abs(fitted), small)
    return grade(size, error)
