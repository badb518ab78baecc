"""What expressions are made of, and what is computed whenever they are: so that what is shared is written down once."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from typing import NamedTuple

from dsd_cli.export.expression import Expression


class _Bits(NamedTuple):
    """One bit for each node: its own, those of all that it is made of, and these less what is in bodies of loops."""

    own: int
    inside: int
    outside: int


class Needs:
    """Looks at each node once."""

    def __init__(self) -> None:
        self._surely: dict[Expression, dict[Expression, None]] = {}
        self._bits: dict[Expression, _Bits] = {}

    def certain(self, roots: Iterable[Expression]) -> dict[Expression, None]:
        """What is computed whenever these are, arguments first: both branches of a choice have it, or its condition."""
        return {x: None for root in roots for x in self._certain(root)}

    def _certain(self, e: Expression) -> dict[Expression, None]:
        if e not in self._surely:
            args = [a for a in e.args if isinstance(a, Expression)]
            if e.op == "where":
                both = self._certain(args[2])
                inside = {x: None for x in self._certain(args[1]) if x in both}
                found = {**self._certain(args[0]), **inside}
            elif e.op == "loop":  # what is in its body has other values each time
                found = self.certain(args[k] for k in _begins(e))
            else:
                found = self.certain(args)
            self._surely[e] = {**found, e: None}
        return self._surely[e]

    def within(self, e: Expression, whole: Expression) -> bool:
        """Whether that is a part of the whole, as the whole is."""
        return bool(self._nodes(whole).inside & self._nodes(e).own)

    def ahead(
        self, yes: Collection[Expression], no: Collection[Expression], sure: Iterable[Expression]
    ) -> Iterator[Expression]:
        """What comes before an `if` with these branches, arguments first: what both branches, or one of them and the
        place where it stands (`sure`), need in any case.
        """
        others = self.certain(no)
        yield from (x for x in self.certain(yes) if x in others)
        either = self._outside(yes) | self._outside(no)
        yield from (x for x in sure if self._nodes(x).own & either)

    def _outside(self, roots: Iterable[Expression]) -> int:
        found = 0
        for root in roots:
            found |= self._nodes(root).outside
        return found

    def _nodes(self, e: Expression) -> _Bits:
        if e not in self._bits:
            inside = outside = 0
            for k, a in enumerate(e.args):
                if isinstance(a, Expression):
                    found = self._nodes(a)
                    inside |= found.inside
                    outside |= found.outside if e.op != "loop" or k in _begins(e) else 0
            own = 1 << len(self._bits)
            self._bits[e] = _Bits(own, inside | own, outside | own)
        return self._bits[e]


def _begins(loop: Expression) -> range:
    """Where the first values of a loop are among its arguments."""
    third = (len(loop.args) - 2) // 3
    return range(2 + third, 2 + 2 * third)
