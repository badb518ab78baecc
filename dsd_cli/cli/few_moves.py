"""What a diagnosis of one or two moves is worth, said as `dsd check` says it of the same log."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dsd_cli.identify.recordings.recording import Recording

#: Share of the sample rate at which speeds are low-passed: no band is known here, and above it no axis moves.
_CUTOFF = 0.1


def said_of_moves(recordings: Iterable[Recording]) -> tuple[str, ...]:
    """A piece of advice where fewer moves are in the logs than one effect asks for: none is left to judge by."""
    from dsd_cli.identify.checks.excitation import excitation
    from dsd_cli.identify.checks.results import MOVES_PER_EFFECT
    from dsd_cli.identify.checks.stretches import Stretch

    moves = 0
    for recording in recordings:
        T = recording.sample_time
        stretches = [
            Stretch(T, piece["t"], piece["u"], None, piece["velocity"], None)
            for piece in recording.pieces
            if "velocity" in piece
        ]
        if not stretches:
            return ()
        moves += excitation(stretches, None, _CUTOFF / T).stretches
    if not 0 < moves < MOVES_PER_EFFECT:
        return ()
    several = "" if moves == 1 else "s"
    what = f"{moves} move{several} from rest to rest, and dsd check asks for {MOVES_PER_EFFECT} for each effect"
    return (f"{what}: what is said here was judged on the moves that it was fitted to, so record more of them",)
