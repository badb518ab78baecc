"""What a motion is worth: nats of the targets that count, and what it shows of the catalogue."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from functools import cached_property

import numpy as np

from dsd_cli.design.expectation import Expectation, Expected
from dsd_cli.design.rows import Products
from dsd_cli.design.targets import apart
from dsd_cli.identify.policy import POLICY
from dsd_cli.signals.log import Array

#: Nats below which all is nothing, and from which on (of a value: (value / standard error)^2 / 2) nothing is open; ten
#: times that is plenty: what is expected may be wrong by so much, and more than that decides nothing.
LEAST, ENOUGH, PLENTY = 1e-3, 50.0, 500.0
#: Weight of a factor in the nats of an effect of the catalogue, against one in those of what is open.
_WIDE = 1.0
#: Nats of an effect of the catalogue, as large as is just of use, below which a motion does not show it: as large as u
#: itself it would not get enough.
_UNSEEN = ENOUGH * POLICY.much_force**2


class Measure(Expectation):
    """Expected evidence for the targets that count."""

    def nats(self, found: Expected) -> dict[str, float]:
        """Of every target: "a, not b" where a is true, and of a value (value / error)^2 / 2; what is just of use counts
        as no more than enough."""
        nats = {self._name(*pair): min(lead, ENOUGH * found.of_use[pair]) for pair, lead in found.nats.items()}
        for v in self.targets.values:
            nats[v.name] = 0.5 * (v.size / max(found.errors[v.name], 1e-300)) ** 2
        return nats

    def _name(self, truth: int, rival: int) -> str:
        return ", not ".join(apart(*(self.targets.explanations[i].name for i in (truth, rival))))

    def told_apart(self, expected: Expected, a: int, b: int) -> tuple[int, int]:
        """The direction of a pair in which there are fewer nats; one that no motion identifies, or whose truth the logs
        have ruled out, is not counted beside the other."""
        found = [p for p in ((a, b), (b, a)) if p in expected.nats]
        told = [p for p in found if self._name(*p) in self.open]
        return min(told or found, key=lambda p: expected.nats[p])

    @cached_property
    def open(self) -> frozenset[str]:
        """Targets that count."""
        names = ({self._name(*p) for p in self.now} | {v.name for v in self.targets.values}) - self.ruled_out
        return frozenset(names if self._only is None else names & self._only)

    @cached_property
    def ruled_out(self) -> frozenset[str]:
        """Directions "a, not b" with b so far ahead of a by the logs, and by so much force, that a is not the truth: no
        motion is for them."""
        behind = {p: float(-np.diff(self._left_by(p, self.inverse)[1])[0]) for p in self.now}
        of_use = {p: self._of_use(squares, self._u_of_logs) for p, squares in behind.items()}
        return frozenset(self._name(*p) for p, nats in self.now.items() if nats < -ENOUGH and of_use[p] > 1.0)

    @property
    def likely(self) -> tuple[int, ...]:
        """Places of the explanations that may be the axis: all in doubt, else those that no other is far ahead of, by
        blocks that no fit saw or by all rows."""
        fits = [e.fit for e in self.targets.explanations]
        left = np.array([[self.search.nats(x) for x in (fit.loss, fit.squares)] for fit in fits])
        near = np.any(left - left.min(axis=0) < ENOUGH, axis=1)
        return tuple(i for i, one in enumerate(near) if self.targets.doubtful or one)

    @property
    def leading(self) -> int:
        """Place of the explanation whose u is fed forward: the first, but where it does not explain the logs to their
        noise the one that does: an axis that is held by what it is not stands off, and is driven on."""
        left = [self.search.nats(e.fit.loss) for e in self.targets.explanations]
        best = int(np.argmin(left))
        return best if left[best] < ENOUGH < left[0] - left[best] else 0

    def without(self, names: Sequence[str]) -> Measure:
        """The same without these targets."""
        return Measure(self.search, self.targets, self.draws, self.open - set(names), self._limits) if names else self

    def smallest(self, planned: Products) -> float:
        """Expected nats of the target that is identified least; of the catalogue's effects where there is no target."""
        if self.open:
            return self.least(self.expected(planned))
        return float(min(self._shown(planned), default=0.0))

    def least(self, expected: Expected) -> float:
        """Nats of the target that is identified least."""
        return min(nats for name, nats in self.nats(expected).items() if name in self.open)

    def worth(self, planned: Products) -> float:
        """Logarithm of the smallest expected nats, as long as they are not plenty; a part of the mean one of those by
        which the catalogue's other effects are distinguished."""
        least = min(self.smallest(planned), PLENTY) if self.open else PLENTY
        shown = self._shown(planned)
        wide = float(self.reach.shares @ np.log(np.clip(shown, _UNSEEN, PLENTY))) if len(shown) else 0.0
        return float(np.log(max(least, LEAST))) + _WIDE * wide

    def _shown(self, planned: Products) -> Array:
        """Nats by which each of the catalogue's effects is distinguished from any other, shape (m,)."""
        return self.reach.shown(self._with_logs(planned).grams[-1]) / self.search.noise.nats

    def sized_by(self, motions: Sequence[Products]) -> Measure:
        """The same, the catalogue's effects as large as is of use in the motions with these inner products."""
        found = copy(self)
        found.reach = self.reach.sized([one.grams[-1] for one in motions])
        return found
