"""Who made d_hat, of a log that has no motion beside it: the maker under whom the found effects explain the log best.

Read by the wrong maker, u + Q^-1 d_hat is Jn a and a part of what u changes in a sample; a delay and smooth functions
of the motion imitate some of that, but the laws that are there do not. So what is missing is searched for once, and
the set that is found is fitted again to the log as each maker would have it. Where none of them leaves surely less, u
is smooth and it does not matter.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from dsd_cli.identify.fit.problem import pose
from dsd_cli.identify.recordings.recording import Recording, prepare
from dsd_cli.identify.results import Diagnosis
from dsd_cli.identify.search.sets import Search
from dsd_cli.identify.verdict.diagnose import Settings, diagnose
from dsd_cli.plant.maker import Maker, remade
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.log import Log, with_channels

#: Of the held-out error that the maker of this package leaves, the share that another one may leave at most.
BETTER = 0.93
#: What other makers do most, for a first look.
_USUAL = (Maker("exact", "newest"), Maker("euler", "newest"))
#: A recording whose longest stretch is less than this share of it is not asked.
_LEAST_PIECE = 0.5
#: The share that one of them may leave at most to be worth a word.
_MUCH = 0.85


def as_made_by(log: Log, maker: Maker, observer: ObserverSettings) -> Log:
    """The log with d_hat as this package makes it, where that maker has made it. Needs t, u and d_hat."""
    if maker.as_here:
        return log
    here, _ = remade(log["t"], log["u"], observer.sign * log["d_hat"], maker, observer.time_constant)
    found = with_channels(log, d_hat=observer.sign * here)
    return replace(found, d_hat_source="position" if maker.intervals == 2 else "logged")


def maker_by_fit(
    log: Log,
    model: PlantModel,
    observer: ObserverSettings,
    makers: Sequence[Maker],
    restarts: Sequence[int] = (),
) -> Maker:
    """The one of `makers` that leaves least of the held-out data; that of this package where it is among them and no
    other leaves less than `BETTER` of what it does.

    Where others are asked for, "bilinear" is not looked for: below some tens of Hz its d_hat is another pairing's,
    half a sample later, and only the noise would choose.

    Raises
    ------
    DataError : the log is too short, or lacks u or d_hat.
    """
    makers = [m for m in makers if m.intervals == 1] or list(makers)
    first = makers[0] if Maker() not in makers else Maker()
    present = _found(as_made_by(log, first, observer), model, observer, restarts)
    left = {first: _left(as_made_by(log, first, observer), present, observer, restarts)}
    best = first
    for _ in range(2):
        for key in ("u", "filter"):  # one after the other: what both do is nearly the sum of what each does
            beside = [m for m in makers if replace(m, **{key: getattr(best, key)}) == best]
            left |= {
                m: _left(as_made_by(log, m, observer), present, observer, restarts) for m in beside if m not in left
            }
            best = min(beside, key=left.__getitem__)
    return best if left[best] < BETTER * left[first] else first


def _found(log: Log, model: PlantModel, observer: ObserverSettings, restarts: Sequence[int]) -> PlantModel:
    """The model with every effect that a search finds in the log."""
    answer = diagnose([prepare(log, observer, restarts)], model, observer, Settings())
    return answer.whole_model or answer.refitted_model


def _left(log: Log, model: PlantModel, observer: ObserverSettings, restarts: Sequence[int]) -> float:
    """Held-out force error with all values of the model fitted to this log, unit of u."""
    problem = pose([prepare(log, observer, restarts)], model, Settings())
    return float(problem.score(Search(problem).refit).heldout_rmse)


def other_maker(
    recordings: Sequence[Recording], answer: Diagnosis, observer: ObserverSettings
) -> tuple[Maker, float, float] | None:
    """(a usual maker under whom the found effects explain the log much better, held-out force error as read, and as
    made so); None where there is none, where a motion is logged, or where d_hat is not as it was logged."""
    (recording, *others) = recordings
    how = recording.provenance
    if others or how.get("d_hat") != "logged" or not how.get("velocity", "").startswith("reconstructed"):
        return None
    piece = max(recording.pieces, key=len)
    if len(piece) < _LEAST_PIECE * recording.samples:
        return None
    log = replace(piece, channels={name: piece[name] for name in ("t", "u", "d_hat")})
    as_eq_13, present = replace(observer, sign=1), answer.whole_model or answer.refitted_model
    left = {m: _left(as_made_by(log, m, as_eq_13), present, as_eq_13, ()) for m in (Maker(), *_USUAL)}
    best = min(left, key=left.__getitem__)
    return (best, left[Maker()], left[best]) if left[best] < _MUCH * left[Maker()] else None
