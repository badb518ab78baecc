"""The effect file of a formula: what `--effects-from` takes, from fixed names and numbers alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from dsd_cli.effects import Role
from dsd_cli.learn.dictionary import BASES, MODULATIONS, Kind, body_of, effect_of, meaning_of, unit_of
from dsd_cli.learn.formula import Term

_HEAD = '''"""A law that `dsd learn` found; edit it as you like; --effects-from of this file gives it to every command:

    dsd add LOG {first} -c model.toml --effects-from THIS_FILE -o better.toml

v is the velocity, q the position, u the control input, t the time; a column is the force for a coefficient of 1
(of friction its level: direction, and holding at rest, are the plant's own).
"""

import math

import numpy as np

from dsd_cli.effects import Effect, Parameter, Role
{imports}'''


def law_source(terms: Sequence[Term], names: Sequence[str], values: Sequence[Mapping[str, float]]) -> str:
    """The file, of one effect for each term; `values` : found, where the searches of a fit begin."""
    memory = any(t.kind.base == "inertia" for t in terms)
    imports = "from dsd_cli.effects.general import inertia_columns\n" if memory else ""
    text = _HEAD.format(first=names[0], imports=imports)
    for term, name, found in zip(terms, names, values, strict=True):
        text += "\n".join(["", *_columns(term.kind, name), *_effect(term, name, found)])
    listed = ", ".join(f"{name.upper()}" for name in names)
    return text + f"\n\nEFFECTS = [{listed}]\n"


def _columns(kind: Kind, name: str) -> list[str]:
    state = ", state=None" if kind.base == "inertia" else ""
    return ["", f"def {name}(channels, shape{state}):", *body_of(kind), "", ""]


def _effect(term: Term, name: str, found: Mapping[str, float]) -> list[str]:
    kind, words = term.kind, words_of(term, found)
    sine = "amplitude" in found
    role = "FRICTION" if BASES[kind.base].role is Role.FRICTION else "APPLIED"
    lines = [
        f"{name.upper()} = Effect(",
        f'    id="{name}",',
        f"    role=Role.{role},",
        f'    law="{effect_of(kind).law}",',
        f'    summary="Learnt: {words}.",',
        f'    pattern="the residual looks like {words}",',
        "    parameters=(",
    ]
    if sine:
        lines.append(f'        Parameter("amplitude", "{kind.unit}", "how strong it is", lower=0.0),')
        lines.append('        Parameter("phase", "rad", "phase", -math.pi, math.pi),')
    else:
        lines.append(f'        Parameter("coefficient", "{kind.unit}", "how strong it is; {found["coefficient"]:.4g}'
                     ' was found"),')  # fmt: skip
    for key, value in term.shape:
        lower, upper = sorted((value - abs(value) - 1.0, value + abs(value) + 1.0)) if key == "place" else (
            value / 30.0, value * 30.0)  # fmt: skip
        lines.append(f'        Parameter("{key}", "{unit_of(kind, key)}", "{meaning_of(key)}; {value:.4g} was found",'
                     f" {lower:.6g}, {upper:.6g}, linear=False),")  # fmt: skip
    lines += ["    ),", f"    needs={kind.needs!r},", f"    columns={name},"]
    lines += [f"    starts=lambda ranges: {_starts(term)!r},"]
    lines += _sine_of(term) if sine else []
    return [*lines, *(["    memory=True,"] if kind.base == "inertia" else []), ")", ""]


def words_of(term: Term, values: Mapping[str, float]) -> str:
    """A term with these values for people."""
    base, modulation = BASES[term.kind.base], MODULATIONS[term.kind.modulation]
    said = {name: f"{value:.3g}" for name, value in values.items()}
    return f"{base.words} {modulation.words.format(x=_SAID[term.kind.over], **said)}".strip()


#: Letter of a channel -> how it is said.
_SAID = {"v": "|v|", "q": "q", "u": "u", "t": "time", "": ""}


def _starts(term: Term) -> list[dict[str, float]]:
    """Around what was found."""
    found = {name: float(f"{value:.6g}") for name, value in term.shape}
    if not found:
        return [{}]
    scaled = [{n: v if n == "place" else float(f"{v * f:.6g}") for n, v in found.items()} for f in (0.8, 1.0, 1.25)]
    return scaled if scaled[0] != scaled[1] else [found]


def _sine_of(term: Term) -> list[str]:
    """Amplitude and phase for the two columns."""
    names = [name for name, _ in term.shape]
    shape = ", ".join(f'"{n}": values["{n}"]' for n in names)
    back = ", ".join(f'"{n}": shape["{n}"]' for n in names)
    return [
        '    split=lambda values, _: (tuple(values["amplitude"] * f(values["phase"]) for f in (math.cos, math.sin)),'
        f" {{{shape}}}),",
        f'    join=lambda c, shape, _: {{"amplitude": math.hypot(*c), "phase": math.atan2(c[1], c[0]), {back}}},',
    ]
