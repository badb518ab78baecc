"""The sections of `dsd.toml` that describe a log, its observer and what `detect` shall distinguish."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

from dsd_cli.errors import UsageError
from dsd_cli.files.config.effect_values import NONE, EffectValues, check_complete, effect_values
from dsd_cli.files.config.rules import (
    LONGEST,
    Place,
    Rule,
    Section,
    axis,
    choice,
    flag,
    integer,
    key,
    number,
    read_section,
    shown,
    table,
    text,
)
from dsd_cli.files.csv_layout import CsvLayout


class Csv(Section):
    """[csv]: where the rows of a text file are; what is not given is found. Lines are counted from 1."""

    skip_rows: int | None = key(integer(0), "lines before the header that are not looked at", default=None)
    header: int | None = key(integer(0), "the line with the names of the columns; 0: there is none", default=None)
    units_row: int | None = key(integer(0), "the line with their units; 0: there is none", default=None)
    delimiter: str | None = key(
        choice(",", ";", "|", "tab", "blanks"), "what separates columns; any number of blanks is one", default=None
    )
    decimal: str | None = key(choice(".", ","), "the decimal sign", default=None)
    scaled: bool | None = key(
        flag(), "whether numbers have the factors and offsets of a row above in them already", default=None
    )

    @property
    def layout(self) -> CsvLayout:
        """As the reader takes it."""
        delimiter = {"tab": "\t", "blanks": " "}.get(self.delimiter or "", self.delimiter)
        return CsvLayout(self.skip_rows, self.header, self.units_row, delimiter, self.decimal, self.scaled)


class Observer(Section):
    """[observer]: the disturbance observer d_hat = sign Q { Jn a - u }, Q = 1/(tau s + 1)."""

    nominal_inertia: float = key(number(above=0), "nominal inertia Jn", "kg m2 or kg, per unit of u")
    time_constant: float = key(number(lower=0, upper=LONGEST), "time constant tau of Q; 0 is no filter", "s")
    sign: Literal[1, -1] = key(choice(1, -1), "-1 for logs whose d_hat is Q { u - Jn a }", default=1)
    filter: Literal["exact", "euler", "backward_euler", "bilinear", "auto"] = key(
        choice("exact", "euler", "backward_euler", "bilinear", "auto"),
        "how the maker of a logged d_hat stepped Q; auto finds it",
        default="exact",
    )
    u: Literal["previous", "newest", "mean", "auto"] = key(
        choice("previous", "newest", "mean", "auto"),
        "which u he paired with the last difference of the speed; auto finds it",
        default="previous",
    )


class Model(Section):
    """[model]: what the plant is believed to be."""

    inertia: float | None = key(number(above=0), "inertia J", "as nominal_inertia", default=None)
    delay: float = key(number(lower=0, upper=LONGEST), "input delay L, any real number", "s", default=0.0)
    rest_speed: float = key(
        number(lower=0), "speed up to which friction may hold the plant", "rad/s or m/s", default=0.0
    )
    effects: EffectValues = key(effect_values(), "physical effects with their values", default=NONE)

    def check(self, at: Place) -> None:
        check_complete(self.effects, at.child("effects"))


class States(Section):
    """[states]: the grid; each state is [model] with these values in place of its own."""

    delays: tuple[float, ...] = key(axis(number(lower=0, upper=LONGEST)), "candidate delays", "s")
    inertias: tuple[float, ...] = key(axis(number(above=0)), "candidate inertias", "as nominal_inertia")
    effects: EffectValues = key(effect_values(axes=True), "further axes: candidate values of effects", default=NONE)


class Initial(Section):
    """detector.initial: the state before the first sample, one of the grid."""

    delay: float = key(number(lower=0), "delay of the initial state", "s")
    inertia: float = key(number(above=0), "inertia of the initial state", "as nominal_inertia")


class SensorNoise(Section):
    """detector.sensor_noise: white noise of the sensor that d_hat was made from."""

    velocity: float = key(number(lower=0), "standard deviation of the velocity", "rad/s or m/s", default=0.0)
    position: float = key(
        number(lower=0),
        "standard deviation of the position; of an encoder its step / sqrt(12)",
        "rad or m",
        default=0.0,
    )


class Stay(Section):
    """detector.transition: stays with this probability, changes to each of the other states alike."""

    stay: float = key(number(lower=0, upper=1), "probability of staying in a state from one sample to the next")


class TransitionFile(Section):
    """detector.transition: a matrix A from a CSV file, row i = probabilities of leaving state i."""

    file: str = key(text(), "CSV file with the matrix A, relative to the config file")


Transition = Literal["uniform"] | Stay | TransitionFile


def _read_transition(value: Any, at: Place) -> Transition:
    if value == "uniform":
        return "uniform"
    if isinstance(value, Mapping) and len(value) == 1:
        if "stay" in value:
            return read_section(Stay, value, at)
        if "file" in value:
            return read_section(TransitionFile, value, at)
    raise at.wrong(value, _TRANSITIONS)


_TRANSITIONS = '"uniform", { stay = 0.99 } or { file = "A.csv" }'
_METHODS = ("dsd", "average", "imm", "viterbi", "smooth", "profile", "combination")


class Detector(Section):
    """[detector]: how the state is chosen, sample by sample."""

    method: Literal["dsd", "average", "imm", "viterbi", "smooth", "profile", "combination"] = key(
        choice(*_METHODS), "method", default="dsd"
    )
    window: int = key(integer(1), "window M of eq. 16", "samples", default=100)
    rho: float = key(number(above=0), "standard deviation rho of d_hat around its prediction", "unit of u", default=0.3)
    average: int = key(
        integer(1), 'N of eq. 8; above 1 it needs method = "average" or "combination"', "samples", default=1
    )
    transition: Transition = key(
        Rule(_TRANSITIONS, _read_transition, (Stay, TransitionFile)), "transition probabilities A", default="uniform"
    )
    initial: Initial | None = key(table(Initial), "state before the first sample", default=None)
    change: float = key(
        number(lower=0),
        'threshold of the test for changes of state (method = "profile"); 0 looks for none',
        "nats",
        default=20.0,
    )
    sensor_noise: SensorNoise | None = key(
        table(SensorNoise), "noise that the observer has differentiated, beside rho", default=None
    )
    observer_filter: bool = key(flag(), "predictions pass Q like the measurement; false is eq. 14", default=True)
    hold: float = key(
        number(lower=0),
        "lead that a new state needs over the last label; 0 is eq. 19, more is slower to follow a change",
        "nats",
        default=0.0,
    )
    output: Literal["d_hat", "derivative"] = key(
        choice("d_hat", "derivative"),
        "what the states predict: d_hat (eq. 14), or d(d_hat)/dt (eq. 6: dampings, without velocity; rho is per s)",
        default="d_hat",
    )
    confidence: float = key(
        number(lower=0),
        "lead over the best state of another delay (inertia) for `confident`; it must also explain its window "
        "(docs/how/beyond.md)",
        "nats",
        default=3.0,
    )

    def check(self, at: Place) -> None:
        if self.average > 1 and self.method not in ("average", "combination"):
            message = f"{at.file}: {at.path}.average = {self.average} contradicts {at.path}.method = "
            raise UsageError(message + shown(self.method), 'above 1 it needs method = "average" or "combination"')
