"""What to do next: the experiment that would tell two effects apart, and what a verdict does not say."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from dsd_cli.identify.results import DELAY, INERTIA, NONE, UNKNOWN, Candidate

#: Pairs that logs often cannot separate, and the experiment that can.
EXPERIMENTS: Mapping[frozenset[str], str] = {
    frozenset(pair): text
    for pair, text in (
        (
            ("coulomb_friction", "presliding_friction"),
            "reverse slowly over a few encoder steps: presliding friction builds up over a distance, Coulomb at once",
        ),
        (
            ("coulomb_friction", "load_friction"),
            "move at constant speed under two different loads: only load-dependent friction grows with the load",
        ),
        (
            ("coulomb_friction", "stribeck_friction"),
            "move at several constant speeds, very slow ones too: the Stribeck excess fades with speed",
        ),
        (
            ("coulomb_friction", "viscous_friction"),
            "move at constant speed, slowly and fast, both ways: only viscous friction grows with speed",
        ),
        (
            ("coulomb_friction", "dead_zone"),
            "hold a small constant command while the axis coasts: friction stops it, a dead zone does not",
        ),
        (
            ("viscous_friction", "quadratic_drag"),
            "move at constant speed at three speeds or more, a fast one among them",
        ),
        (
            ("gravity", INERTIA),
            "hold the axis at several angles, or move slowly over a whole turn: gravity acts at rest, inertia does not",
        ),
        (("gravity", "stiffness"), "move over half a turn or more: a spring keeps growing, gravity turns back"),
        (("stiffness", "cubic_stiffness"), "move further out: the cubic part grows faster"),
        (
            ("gravity", "constant_load"),
            "move over half a turn: gravity changes with the angle, a constant load does not",
        ),
        (("actuator_lag", DELAY), "apply steps of u and log at a higher rate: a lag rises gradually, a delay jumps"),
        (("backlash", "flexible_coupling"), "move with small and large amplitudes: only play depends on the amplitude"),
        (
            ("cogging", "periodic_disturbance"),
            "move at two different speeds: cogging keeps its place, not its frequency",
        ),
    )
}
_GENERAL = "move at constant speed both ways, slowly and fast, over the whole travel, with a rest between the moves"


def advice_for(
    verdict: str,
    named: Candidate | None,
    more_unknown: bool,
    depends_on: Sequence[str],
    provenance: Mapping[str, str],
) -> tuple[str, ...]:
    """Sentences, the most useful first."""
    lines = []
    rivals = named.indistinguishable_from if named is not None else ()
    for rival in rivals:
        lines.append(f"{verdict} or {rival}? {EXPERIMENTS.get(frozenset((verdict, rival)), _GENERAL)}")
    if verdict == UNKNOWN:
        on = " and ".join(depends_on)
        lines.append(f"look at the residual over {on} (dsd compare --plot)" if on else "look at the residual over time")
        lines.append("if you know a law for it, write it as an effect and pass it with --effects-from")
    elif verdict != NONE and more_unknown:
        lines.append("this is not all: something else remains that no effect of the catalogue explains")
    if verdict not in (NONE, UNKNOWN, INERTIA, DELAY) and not lines:
        lines.append(f"dsd add LOG {verdict} -o FILE puts it into the model")
    if verdict != NONE:
        lines.append(
            "inertia and forces are per unit of u: where u is no torque or force (volts, amperes), J is known only up "
            "to the gain of the drive, and a wrong gain looks just like a wrong inertia"
        )
    if "reconstructed" in provenance.get("velocity", ""):
        lines.append("speed and position were reconstructed from u and d_hat: log the position to be surer")
    return tuple(lines)
