"""The words of a formula: bases, each times one shape of one channel at most.

A term is written once, as NumPy text over v, q, u, t and its shapes; what is searched and what the law file has are
that text, from fixed names alone.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from dsd_cli.effects import Effect, Parameter, Role
from dsd_cli.effects.general import inertia_columns


class Base(NamedTuple):
    """What a term is made of: force per coefficient as NumPy text (the level, of friction: the plant owns its sign, and
    sticking), symbol and words for people, channels, unit of its coefficient."""

    name: str
    role: Role
    law: str
    symbol: str
    words: str
    needs: tuple[str, ...]
    unit: str


_V, _Q, _VQ = ("velocity",), ("position",), ("velocity", "position")
BASES = {
    base.name: base
    for base in (
        Base("dry", Role.FRICTION, "0.0 * v + 1.0", "sgn v", "dry friction", _V, "{u}"),
        Base("viscous", Role.APPLIED, "-v", "v", "damping", _V, "{u}/({v})"),
        Base("force", Role.APPLIED, "0.0 * t + 1.0", "1", "a force", (), "{u}"),
        Base("drag", Role.APPLIED, "-v * np.abs(v)", "|v| v", "drag with the square of the speed", _V, "{u}/({v})^2"),
        Base("root", Role.APPLIED, "-np.sign(v) * np.sqrt(np.abs(v))", "sqrt|v| sgn v",
             "friction with the root of the speed", _V, "{u}/({v})^0.5"),
        Base("asymmetry", Role.APPLIED, "-np.abs(v)", "|v|", "damping that differs by direction", _V, "{u}/({v})"),
        Base("spring", Role.APPLIED, "-q", "q", "a spring", _Q, "{u}/({q})"),
        Base("square", Role.APPLIED, "-(q**2)", "q^2", "a force with the square of the position", _Q, "{u}/({q})^2"),
        Base("cubic", Role.APPLIED, "-(q**3)", "q^3", "a spring that hardens", _Q, "{u}/({q})^3"),
        Base("gain", Role.APPLIED, "u", "u", "a change of u's gain", ("u",), ""),
        Base("size", Role.APPLIED, "np.abs(u)", "|u|", "a gain of u that differs by its sign", ("u",), ""),
        Base("load", Role.FRICTION, "np.abs(u) + 0.0 * v", "|u| sgn v", "friction in proportion to u",
             ("velocity", "u"), ""),
        Base("inertia", Role.APPLIED, "", "a", "an inertia", _VQ, "{u}/({v}/s)"),
    )
}  # fmt: skip


class Modulation(NamedTuple):
    """What a base is multiplied by: NumPy text over x and its parameters (two texts: a sine and a cosine), their slopes
    over x (for an inertia), how it is said; `of` the bases it goes with, by the letter of the channel."""

    name: str
    law: tuple[str, ...]
    slope: tuple[str, ...]
    symbol: str
    words: str
    parameters: tuple[str, ...]
    of: dict[str, tuple[str, ...]]


_ALONE = tuple(name for name in BASES if name not in ("inertia", "gain"))
_OVER_Q = ("dry", "viscous", "force", "gain", "inertia")
_OVER_T = ("dry", "viscous", "gain")
_BUMP = "((x - place) / width) ** 2"
MODULATIONS = {
    one.name: one
    for one in (
        Modulation("alone", ("1.0",), ("0.0",), "", "", (), {"": _ALONE}),
        Modulation("linear", ("x",), ("1.0 + 0.0 * x",), "{x}", "in proportion to {x}", (),
                   {"q": ("dry", "viscous", "gain", "inertia"), "t": _OVER_T}),
        Modulation("sine", ("np.sin(n * x)", "np.cos(n * x)"), ("n * np.cos(n * x)", "-n * np.sin(n * x)"),
                   "sin({n} {x} + {phase})", "that swings over {x}, {n} rad per unit", ("n",), {"q": _OVER_Q}),
        Modulation("lorentz", (f"1.0 / (1.0 + {_BUMP})",),
                   (f"-2.0 * (x - place) / width**2 / (1.0 + {_BUMP}) ** 2",),
                   "/(1 + (({x} - {place})/{width})^2)", "near {x} = {place} (width {width})", ("place", "width"),
                   {"q": _OVER_Q}),
        Modulation("gauss", (f"np.exp(-({_BUMP}))",), (f"-2.0 * (x - place) / width**2 * np.exp(-({_BUMP}))",),
                   "exp(-(({x} - {place})/{width})^2)", "near {x} = {place} (width {width})", ("place", "width"),
                   {"q": _OVER_Q}),
        Modulation("tanh", ("np.tanh((x - place) / width)",), ("(1.0 - np.tanh((x - place) / width) ** 2) / width",),
                   "tanh(({x} - {place})/{width})", "that changes over at {x} = {place} (width {width})",
                   ("place", "width"), {"q": _OVER_Q}),
        Modulation("beyond", ("np.maximum(x - place, 0.0)",), ("1.0 * (x > place)",), "max({x} - {place}, 0)",
                   "beyond {x} = {place}", ("place",), {"q": _OVER_Q, "u": ("force",), "t": _OVER_T}),
        Modulation("below", ("np.maximum(place - x, 0.0)",), ("-1.0 * (x < place)",), "max({place} - {x}, 0)",
                   "below {x} = {place}", ("place",), {"q": _OVER_Q, "u": ("force",)}),
        Modulation("inverse", ("1.0 / (x - place) ** 2",), ("-2.0 / (x - place) ** 3",), "/({x} - {place})^2",
                   "with the inverse square of the way from {x} = {place}", ("place",), {"q": ("dry", "force")}),
        Modulation("decay", ("np.exp(-np.abs(x) / scale)",), ("0.0 * x",), "exp(-|{x}|/{scale})",
                   "that fades with {x} (to 37 % at {scale})", ("scale",),
                   {"v": ("dry", "viscous"), "t": _OVER_T}),
        Modulation("bell", ("np.exp(-((x / scale) ** 2))",), ("0.0 * x",), "exp(-({x}/{scale})^2)",
                   "that fades with {x} (to 37 % at {scale})", ("scale",), {"v": ("dry", "viscous")}),
        Modulation("peak", ("1.0 / (1.0 + (x / scale) ** 2)",), ("0.0 * x",), "/(1 + ({x}/{scale})^2)",
                   "that falls off beyond {x} = {scale}", ("scale",), {"v": ("dry", "viscous")}),
        Modulation("level", ("np.tanh(x / scale)",), ("0.0 * x",), "tanh({x}/{scale})",
                   "that levels off beyond {x} = {scale}", ("scale",), {"v": ("force",), "u": ("force",)}),
    )
}  # fmt: skip

#: Letter -> channel, and the unit of the letter.
CHANNELS = {"v": "velocity", "q": "position", "u": "u", "t": "t"}
UNITS = {"v": "{v}", "q": "{q}", "u": "{u}", "t": "s"}
_MEANINGS = {
    "n": "periods: rad per unit of the channel",
    "place": "where it is",
    "width": "how wide it is",
    "scale": "over which it changes",
}


@dataclass(frozen=True)
class Kind:
    """A term without numbers: a base, a modulation and its channel ("" for none)."""

    base: str
    modulation: str = "alone"
    over: str = ""

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of its shapes."""
        return MODULATIONS[self.modulation].parameters

    @property
    def of_u(self) -> bool:
        """Whether it looks at u."""
        return "u" in (*BASES[self.base].needs, self.over)

    @property
    def needs(self) -> tuple[str, ...]:
        """Channels."""
        over = CHANNELS.get(self.over, "t")
        return tuple(dict.fromkeys([*BASES[self.base].needs, *([over] if over != "t" else [])]))

    @property
    def unit(self) -> str:
        """Of its coefficients."""
        base, modulation = BASES[self.base].unit or "1", self.modulation
        over = UNITS.get(self.over, "")
        power = {"linear": f"/({over})", "beyond": f"/({over})", "below": f"/({over})", "inverse": f"*({over})^2"}
        unit = base + power.get(modulation, "")
        return "" if unit == "1" else unit

    def laws(self) -> tuple[str, ...]:
        """NumPy text of each column over v, q, u, t; for an inertia of what it adds to J."""
        own, shapes = BASES[self.base].law, MODULATIONS[self.modulation].law
        over = [text.replace("x", self.over) if self.over else text for text in map(_guarded, shapes)]
        over = [text.replace("e\0p", "exp").replace("ma\0imum", "maximum") for text in over]
        if self.base == "inertia":
            return tuple(over)
        return tuple(own if text == "1.0" else f"({own}) * ({text})" for text in over)

    def slopes(self) -> tuple[str, ...]:
        """The slope of `laws` of an inertia over q."""
        texts = [_guarded(text).replace("x", self.over) for text in MODULATIONS[self.modulation].slope]
        return tuple(text.replace("e\0p", "exp").replace("ma\0imum", "maximum") for text in texts)


def _guarded(text: str) -> str:
    """Names of NumPy that have an x in them are no channel."""
    return text.replace("exp", "e\0p").replace("maximum", "ma\0imum")


def kinds(channels: tuple[str, ...]) -> Iterator[Kind]:
    """All terms over these channels of a log."""
    for modulation in MODULATIONS.values():
        for over, bases in modulation.of.items():
            for base in bases:
                kind = Kind(base, modulation.name, over)
                if all(name in channels for name in kind.needs):
                    yield kind


def body_of(kind: Kind, indent: str = "    ") -> list[str]:
    """The lines of a function `columns` of an effect file."""
    lines = ["v, q, u, t = channels.velocity, channels.position, channels.u, channels.t"]
    lines += [f'{name} = shape["{name}"]' for name in kind.parameters]
    laws = ", ".join(kind.laws())
    if kind.base == "inertia":
        slopes = ", ".join(kind.slopes())
        return [indent + line for line in [*lines, f"return inertia_columns(channels, ({laws},), ({slopes},), state)"]]
    return [indent + line for line in [*lines, f"return ({laws},)"]]


@lru_cache(maxsize=256)
def effect_of(kind: Kind) -> Effect:
    """The effect of one term, made of the text that its file has."""
    memory = kind.base == "inertia"
    head = "def columns(channels, shape, state=None):" if memory else "def columns(channels, shape):"
    space: dict[str, Any] = {"np": np, "inertia_columns": inertia_columns}
    exec("\n".join([head, *body_of(kind)]), space)  # fixed texts of this file alone
    count = len(kind.laws())
    linear = ("coefficient",) if count == 1 else ("sine", "cosine")
    parameters = [Parameter(name, kind.unit, "strength") for name in linear]
    parameters += [
        Parameter(name, unit_of(kind, name), _MEANINGS[name], 1e-9 if name != "place" else -np.inf, linear=False)
        for name in kind.parameters
    ]
    return Effect(
        id="_".join(filter(None, ("learnt", kind.base, kind.modulation.replace("alone", ""), kind.over))),
        role=BASES[kind.base].role,
        law=" + ".join(kind.laws()),
        summary="A term of a formula.",
        pattern="a law that was learnt",
        parameters=tuple(parameters),
        needs=kind.needs,
        columns=space["columns"],
        memory=memory,
    )


def unit_of(kind: Kind, parameter: str) -> str:
    """Of a shape."""
    unit = UNITS.get(kind.over, "")
    return f"rad/({unit})" if parameter == "n" else unit


def meaning_of(parameter: str) -> str:
    """Of a shape, in words."""
    return _MEANINGS[parameter]
