"""Whether what stays unexplained is a mechanical end stop that the axis touches: those rows are then left out.

A stop pushes inwards and nowhere else: nothing up to where it is touched, then ever harder, with an impact that no
catalogue has. Effects of the whole travel are found in its place. Two contacts, one at either end, are held against any
function of the position; and without the rows beyond them nothing may depend on the position any more: a spring that
hardens does so everywhere.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from dsd_cli.identify.fit.bank import has_friction
from dsd_cli.identify.fit.blocks import grams, losses, solve
from dsd_cli.identify.fit.freeform import FreeformFits
from dsd_cli.identify.fit.row_weights import shared_inflation
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.recordings.excerpts import inside
from dsd_cli.identify.recordings.recording import Mended, Recording
from dsd_cli.identify.results import Diagnosis
from dsd_cli.identify.search.sets import Search
from dsd_cli.identify.verdict.discrepancy import Discrepancy
from dsd_cli.signals.log import Array

#: Shares of the travel within which a stop is touched, and at least; places that are tried within, at either end. A
#: contact that the drive presses in by more is a spring in which the axis moves.
_DEEPEST, _LEAST, _TRIED = 0.1, 1e-3, 60
#: Share of what depends on the position that may be left without them: a spring that hardens by q^5 leaves 0.25, what
#: an impact does to the rows before it 0.03.
_LEFT = 0.1
_POSITION = ("position",)
#: What is taken off a recording, see there.
_KIND = "end stop"


@dataclass(frozen=True)
class Contact:
    """end : 1 of the upper end of the travel, -1 of the lower. place : where it is touched, rad or m. stiffness : of
    the force inwards, unit of u per rad or m."""

    end: int
    place: float
    stiffness: float

    def push(self, position: Array) -> Array:
        """Force at a stiffness of 1."""
        return -self.end * np.maximum(self.end * (position - self.place), 0.0)


@dataclass(frozen=True)
class EndStops:
    """mended : the logs without the rows in which the axis touches them. said : where. key : what leaves them out.
    before : what depends on the position with them, see `_Touching.by_position`."""

    mended: Mended
    said: str
    key: str
    before: float

    def confirmed(self, search: Search, whole: Fit) -> bool:
        """Whether nothing depends on the position any more, to what was found without those rows."""
        return _Touching(*search.searched(whole)).by_position() < _LEFT * self.before

    def beside(self, diagnosis: Diagnosis) -> Diagnosis:
        """An answer from all rows, in which nothing but the stops is missing, with the advice to leave them out."""
        return replace(diagnosis, advice=(f"{self.said}: an end stop? {self.key} leaves it out", *diagnosis.advice))


def end_stops(
    search: Search, whole: Fit, beyond: Discrepancy, recordings: Sequence[Recording], holdout: Sequence[Recording]
) -> EndStops | None:
    """None where the axis does not seem to touch any.

    Not where a position is summed up from something else: such a place would be no place in the log.
    """
    every = (*recordings, *holdout)
    if not beyond.unknown or any(_KIND in r.taken_off or r.provenance.get("position") != "logged" for r in every):
        return None
    touching = _Touching(*search.searched(whole))
    if not (contacts := touching.contacts()):
        return None
    place = {c.end: c.place for c in contacts}
    low, high = place.get(-1, -math.inf), place.get(1, math.inf)
    several = [[inside(r, low, high, _KIND) for r in each] for each in (recordings, holdout)]
    left, aside = (tuple(r for r in each if r is not None) for each in several)
    if len(left) < len(recordings) or len(aside) < len(holdout):
        return None
    positions = np.concatenate([piece["position"] for r in every for piece in r.pieces])
    digits = max(3 - math.floor(math.log10(touching.high - touching.low)), 0)
    least = math.ceil(max(low, positions.min() - 0.1**digits) * 10**digits) / 10**digits
    most = math.floor(min(high, positions.max() + 0.1**digits) * 10**digits) / 10**digits
    key = f'--set "signals.position_range=[{least:.{digits}f}, {most:.{digits}f}]"'
    where = " or ".join(f"{'above' if c.end > 0 else 'below'} {c.place:.{digits}f}" for c in contacts)
    said = f"where the position (rad or m) is {where} something pushes the axis back, and nowhere else"
    told = f"{said}: these rows count as an end stop and are left out. For other commands: {key}"
    return EndStops(Mended(left, aside, (told,)), said, key, touching.by_position())


class _Touching:
    """Contacts at the ends of the travel beside all that was found, judged in the rows of a search."""

    def __init__(self, search: Search, fit: Fit) -> None:
        self.fits: FreeformFits = search.freeform(fit)
        self.search, self.rmse = search, search.problem.errors.rmse(fit)
        self.travels = [piece.values["position"] for piece in self.fits.pieces if "position" in piece.values]
        places = np.concatenate([*self.travels, np.zeros(0)])
        self.low, self.high = (float(places.min()), float(places.max())) if len(places) else (0.0, 0.0)

    @cached_property
    def rows(self) -> list[Array]:
        """What is explained, and what explains it, whitened."""
        return [self.fits.equations.whitened(x) for x in self.fits.base]

    def by_position(self) -> float:
        """Power that some function of the position takes off what is left, unit of u squared; 0 if none does."""
        return max(self.rmse**2 - self.fits.left_of(self.rmse, _POSITION) ** 2, 0.0)

    def contacts(self) -> list[Contact]:
        """Those that are there; none where a function of the position explains clearly more."""
        if _POSITION not in self.fits.groups():
            return []
        found: list[Contact] = []
        first = max((self._best(end, []) for end in (-1, 1)), key=lambda found: found[0])[1]
        for contact in (first, self._best(-first.end, [first])[1]):
            if contact.stiffness > 0.0 and self._gain([*found, contact], found) > POLICY.unknown_nats:
                found.append(contact)
        free = self.fits.fit_with(_POSITION)
        clear = self._loss([]) - self._loss(found) > POLICY.share_of_possible * free.gain
        return found if found and clear else []

    def _best(self, end: int, beside: Sequence[Contact]) -> tuple[float, Contact]:
        """(squares that it takes off, the contact at the place where these are most), beside what was found."""
        q, _ = np.linalg.qr(np.stack([*self.rows[1:], *map(self._row, beside)]).T)
        left, edge = self.rows[0] - q @ (q.T @ self.rows[0]), self.high if end > 0 else self.low
        found = []
        for depth in ((self.high - self.low) * np.geomspace(_LEAST, _DEEPEST, _TRIED)).tolist():
            contact = Contact(end, edge - end * depth, 0.0)
            row = self._row(contact)
            row = row - q @ (q.T @ row)
            stiffness = float(row @ left) / max(float(row @ row), 1e-300)
            found.append((max(stiffness, 0.0) * float(row @ left), replace(contact, stiffness=stiffness)))
        return max(found, key=lambda one: one[0])

    def _row(self, contact: Contact) -> Array:
        """Whitened."""
        equations = self.fits.equations
        raw, held = [contact.push(x) for x in self.travels], has_friction(self.fits.fit.terms)
        return equations.whitened(equations.acting(raw, smooth=False, held=held))

    def _gain(self, contacts: Sequence[Contact], beside: Sequence[Contact]) -> float:
        """Nats of held-out blocks that contacts gain over some of them, beyond what they explain by chance of what is
        as coloured as the rest."""
        now, was = self._left(contacts), self._left(beside)
        gained = self.search.nats(self._loss(beside)) - self.search.nats(self._loss(contacts))
        return gained / max(shared_inflation(now, was - now), 1.0)

    def _loss(self, contacts: Sequence[Contact]) -> float:
        """Squares in held-out blocks: a place that the axis met in one of them alone explains nothing there."""
        found = grams([*self.rows, *map(self._row, contacts)], self.fits.blocks)
        return float(losses(solve(found.fitted), found, self.fits.blocks).sum())

    def _left(self, contacts: Sequence[Contact]) -> Array:
        columns = np.stack([*self.rows[1:], *map(self._row, contacts)])
        return self.rows[0] - np.linalg.lstsq(columns.T, self.rows[0], rcond=None)[0] @ columns
