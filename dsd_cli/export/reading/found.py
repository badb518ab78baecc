"""What a file says of a joint, and the model that this makes."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from dsd_cli.effects import Values, catalogue, get_effect
from dsd_cli.effects.general import GENERAL
from dsd_cli.effects.joint_terms import JointTerms
from dsd_cli.errors import DataError, UsageError
from dsd_cli.plant.model import PlantModel
from dsd_cli.signals.units import Units


@dataclass(frozen=True)
class Found:
    """One joint.

    Attributes
    ----------
    name : as the file has it. linear : it slides. model : what was understood.
    notes : how it was taken. missed : what was not understood, or is nothing of a single joint.
    units : of u and of positions, as far as the file names them.
    """

    name: str
    linear: bool
    model: PlantModel
    notes: tuple[str, ...] = ()
    missed: tuple[str, ...] = ()
    units: Units = Units()  # noqa: RUF009 (frozen)


def model_of(inertia: float, delay: float, terms: JointTerms, where: str) -> PlantModel:
    """The model with every effect that is among the terms; several of a kind are numbered.

    Raises
    ------
    DataError : the values are none that a model can have.
    """
    effects: dict[str, Values] = {}
    for effect in (*catalogue().values(), *GENERAL.values()):
        if effect.of_joint is not None:
            effects |= _numbered(effect.id, effect.of_joint(terms, inertia))
    try:
        return PlantModel(inertia, delay, effects)
    except UsageError as error:
        raise DataError(f"{where}: {error.message}", error.hint) from None


def _numbered(kind: str, found: Sequence[Values]) -> dict[str, Values]:
    names = [kind, *(f"{kind}_{i}" for i in range(2, len(found) + 1))]
    for name in names[1 : len(found)]:
        get_effect(name)  # raises where a model has but one of it
    return dict(zip(names, found, strict=False))


def chosen(path: object, names: Iterable[str], wanted: str | None) -> str:
    """The joint of that name, or the only one.

    Raises
    ------
    DataError : there is none. UsageError : none of that name, or several.
    """
    from difflib import get_close_matches

    names = list(names)
    if not names:
        raise DataError(f"{path}: no joint that turns or slides")
    if wanted is None and len(names) == 1:
        return names[0]
    listed = ", ".join(names[:12]) + (", ..." if len(names) > 12 else "")
    if wanted is None:
        raise UsageError(f"{path}: has {len(names)} joints", f"--joint names one of {listed}")
    if wanted not in names:
        near = get_close_matches(wanted, names, n=1)
        raise UsageError(f"--joint {wanted}", f"did you mean {near[0]}?" if near else f"{path} has {listed}")
    return wanted
