"""What to do next: the experiment that distinguishes two effects, and the limits of a verdict."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from dsd_cli.effects import catalogue, kind_of
from dsd_cli.identify.fit.freeform import GAIN
from dsd_cli.identify.results import DELAY, INERTIA, NONE, UNKNOWN, Candidate
from dsd_cli.signals.units import PER_UNIT

_GENERAL = "move at constant speed both ways, slowly and fast, over the whole travel, with a rest between the moves"


def advice_for(
    verdict: str,
    named: Candidate | None,
    more_unknown: bool,
    depends_on: Sequence[str],
    provenance: Mapping[str, str],
    nearest: str = "",
    own: bool = False,
) -> tuple[str, ...]:
    """Sentences, the most useful first; nearest : see `Diagnosis`. own : the model has the effect."""
    lines = []
    alike: dict[str, list[str]] = {}
    for rival in named.indistinguishable_from if named is not None else ():
        alike.setdefault(_experiment(verdict, rival), [verdict]).append(rival)
    lines += [f"{' or '.join(names)}? {experiment}" for experiment, names in alike.items()]
    if nearest:
        lines.append(f"to see whether it is {nearest}, record a longer log: {_GENERAL}")
    if verdict == UNKNOWN:
        lines.append(_look_at(depends_on))
        lines.append("if you know a law for it, write it as an effect and pass it with --effects-from")
    elif verdict != NONE and more_unknown:
        lines.append("this is not all: something else remains that no effect of the catalogue explains")
    if verdict not in (NONE, UNKNOWN, INERTIA, DELAY) and not lines:
        again = "dsd improve LOG -o FILE fits all values of the model again"
        lines.append(again if own else f"dsd add LOG {verdict} -o FILE puts it into the model")
    if verdict != NONE:
        lines.append(PER_UNIT)
    if "reconstructed" in provenance.get("velocity", ""):
        lines.append("speed and position were reconstructed from u and d_hat: log the position to be surer")
    return tuple(lines)


def asking_again(kept: Sequence[str]) -> str:
    """What to do where values are kept from where the log would have them."""
    names = " and ".join(kept)
    return f"ask again without the given values of {names}: what the log gives then, and whether anything is missing"


def _look_at(depends_on: Sequence[str]) -> str:
    channels = [name for name in depends_on if name != GAIN]
    over = " and ".join(channels) or "time"
    if GAIN in depends_on:
        return f"u moves the axis more at times, by {over}: does the inertia, the load or the gain of the drive vary?"
    return f"look at the residual over {over}" + (" (dsd compare --plot)" if channels else "")


def _experiment(one: str, other: str) -> str:
    """The experiment that distinguishes the two, from the file of either."""
    effects, one, other = catalogue(), kind_of(one), kind_of(other)
    found = (effects[a].told_apart.get(b) for a, b in ((one, other), (other, one)) if a in effects)
    return next((experiment for experiment in found if experiment), _GENERAL)
