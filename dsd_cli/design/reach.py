"""How well a motion shows all that the catalogue has: a poor log may have named none of what is there.

Where the logs saw little, the truth is often no explanation of theirs. So beside what is open a motion is worth what it
shows of every effect that is a function of the motion, just so large that it would be of use: of its force the part
that neither the plant's own balance nor any one other effect can take, |(I - P_{own, other}) x|^2 / 2 s^2.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from dsd_cli.design.rows import Model
from dsd_cli.effects import Ranges, Role, get_effect
from dsd_cli.identify.fit.bank import FIXED, Term
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.search.sets import Search
from dsd_cli.signals.log import Array

#: Of normal matrices of unit columns: what no double distinguishes from 0.
_RIDGE = 1e-9
#: Other shapes that a rival may take.
_MOST_SHAPES = 4


@dataclass(frozen=True)
class Reach:
    """model : an explanation with every other effect beside it, of size 0, once in each of its shapes. effects : of
    those, the rows of its Gram matrix; names : whose they are. sizes : of each of these rows, its coefficient squared,
    shape (m,)."""

    model: Model
    names: tuple[str, ...]
    effects: tuple[slice, ...]
    sizes: Array

    @classmethod
    def beside(cls, search: Search, model: Model, ranges: Ranges) -> Reach:
        """All candidates that are functions of the motion, at the shapes in which the logs would have them, and at
        those that such ranges can show: of friction at low speed a poor log sees no speed."""
        here = {t.id for t in model.terms}
        found = [o.fit for o in search.options(search.refit) if o.effect not in here]
        added = [
            (term, fit.widths[-1])
            for fit in found
            for term in dict.fromkeys([fit.terms[-1], *other_shapes(fit.terms[-1], ranges)])
            if _of_motion(term)
        ]
        widths = [width for _, width in added]
        ends = 1 + FIXED + sum(model.widths) + np.cumsum([0, *widths])
        wide = replace(
            model,
            terms=(*model.terms, *(term for term, _ in added)),
            widths=(*model.widths, *widths),
            total=np.concatenate([model.total, np.zeros(sum(widths))]),
        )
        names = tuple(term.id for term, _ in added)
        return cls(wide, names, tuple(slice(int(a), int(b)) for a, b in pairwise(ends)), np.ones(sum(widths)))

    def sized(self, grams: Sequence[Array]) -> Reach:
        """Each effect so large that it is of use beside the largest u (`POLICY.much_force`, a share of it) in the one
        of these motions, all of one length, that shows it best."""
        if not self.effects:
            return self
        squares = np.max([np.diag(gram) for gram in grams], axis=0)
        rows = squares[self.effects[0].start : self.effects[-1].stop]
        return replace(self, sizes=POLICY.much_force**2 * squares[0] / np.maximum(rows, 1e-300))

    def shown(self, gram: Array) -> Array:
        """Square of each row that no other effect can take, shape (m,); `gram` : begins with the model's."""
        if not self.effects:
            return np.empty(0)
        # the drive is the sum of the others
        first, last = self.effects[0].start, self.effects[-1].stop
        own = [i for i in range(1, self.model.size) if not first <= i < last]
        size = np.sqrt(np.maximum(np.diag(gram), 1e-300))
        normal = gram / np.outer(size, size) + _RIDGE * np.eye(len(gram))
        alone = _without(normal[first:last, first:last], normal[first:last, own], normal[np.ix_(own, own)])
        least = np.diag(alone).copy()
        owner = self._owner
        for name, effect in zip(self.names, self.effects, strict=True):
            at = slice(effect.start - first, effect.stop - first)
            beside = np.diag(_without(alone, alone[:, at], alone[at, at] + _RIDGE * np.eye(at.stop - at.start)))
            others = owner != name
            least[others] = np.minimum(least[others], beside[others])
        return np.asarray(self.sizes * size[first:last] ** 2 * np.maximum(least, 0.0))

    @property
    def _owner(self) -> NDArray[np.str_]:
        """Effect of each row, shape (m,)."""
        return np.repeat(np.array(self.names, dtype=np.str_), [x.stop - x.start for x in self.effects])

    @property
    def shares(self) -> Array:
        """Of each row in a mean over effects, shape (m,): those of one effect share alike."""
        _, which, count = np.unique(self._owner, return_inverse=True, return_counts=True)
        return np.asarray(1.0 / (count[which] * len(count)))


def _without(normal: Array, cross: Array, own: Array) -> Array:
    """The inner products of what some rows do not explain of others (Schur complement)."""
    return np.asarray(normal - cross @ np.linalg.solve(own, cross.T))


def _of_motion(term: Term) -> bool:
    """Whether its force is there again with another motion, and is no matter of what was before."""
    effect = term.effect
    timed = effect.listed or (effect.periods is not None and not effect.needs)
    return effect.role in (Role.APPLIED, Role.FRICTION) and not (timed or effect.memory or "u" in effect.needs)


def other_shapes(term: Term, ranges: Ranges) -> list[Term]:
    """The effect at a few of the starting shapes that a search over such ranges begins with, from end to end."""
    if not term.effect.searched or term.effect.listed:
        return []
    starts = get_effect(term.id).starts(ranges)
    places = np.unique(np.linspace(0, len(starts) - 1, min(_MOST_SHAPES, len(starts))).round().astype(int))
    return [Term.of(term.id, starts[i]) for i in places]
