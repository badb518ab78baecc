"""What the best free-form function of the channels could reach: how much of the residual is law, and how much noise.

Hats over each channel, and over pairs of them, are fitted together with the drive and the model's effects, in the same
equations. They name no physics; they say how much there is to be found, and on what it depends.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dsd_cli.effects import Role
from dsd_cli.identify.compare.dependence import Inputs, basis
from dsd_cli.identify.compare.dependence import inputs_of as channels_of
from dsd_cli.identify.fit.bank import drive, inputs_of, raw_columns
from dsd_cli.identify.fit.blocks import Blocks
from dsd_cli.identify.fit.gram import Grams, grams, solve, total_gram
from dsd_cli.identify.fit.rows import Equations
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.plant.model import PlantModel
from dsd_cli.signals.log import Array

#: Groups of channels whose functions are tried, the simple ones first. The acceleration is none of them: measured, it
#: holds what is to be explained.
SINGLES = (("velocity",), ("position",), ("u",), ("time",))
PAIRS = (
    ("velocity", "position"),
    ("velocity", "time"),
    ("velocity", "u"),
    ("position", "time"),
)
HATS, HATS_IN_PAIR, FINE_HATS = 12, 6, 40
#: Hats over time are wider than three held-out blocks, so that a held-out block can be interpolated.
BLOCKS_PER_TIME_HAT = 3
#: Penalty on bends, and on size, as a share of the mean information on a hat.
BENDS, SIZE = 1e-3, 1e-5
STRENGTHS = (1.0, 30.0, 1e3, 3e4)


@dataclass(frozen=True)
class Freeform:
    """A fit with a free-form function of these channels beside the model.

    losses : held-out sums of squares per block, shape (B,), in the domain of the equations.
    """

    on: tuple[str, ...]
    losses: Array

    @property
    def loss(self) -> float:
        """Held-out sum of squares."""
        return float(self.losses.sum())


class FreeformFits:
    """Free-form functions beside a fit, for some equations."""

    def __init__(self, equations: Equations, blocks: Blocks, fit: Fit, model: PlantModel) -> None:
        self.equations, self.blocks, self.fit = equations, blocks, fit
        self.pieces = [channels_of(s.log, model, equations.observer, 0) for s in equations.stretches]
        self._base = [equations.measured(), *_columns(equations, fit)]

    @property
    def loss(self) -> float:
        """Held-out sum of squares without any free-form function."""
        found = grams(self._base, self.blocks)
        return float(_losses(solve(found.fitted), found, self.blocks).sum())

    def groups(self) -> list[tuple[str, ...]]:
        """Groups whose channels all stretches have, and that vary."""
        have = {n for n in self.pieces[0].values if all(_varies(p, n) for p in self.pieces)}
        return [g for g in (*SINGLES, *PAIRS) if set(g) <= have]

    def fit_with(self, on: tuple[str, ...]) -> Freeform:
        """Cross-validated."""
        raw, penalty = self.raw(on)
        columns = [self.equations.rows([a[:, i] for a in raw]) for i in range(raw[0].shape[1])]
        found = grams([*self._base, *columns], self.blocks)
        fixed = len(self._base) - 1
        tried = []
        for strength in STRENGTHS:
            ridge = 1e-9 * np.eye(fixed + len(columns))
            ridge[fixed:, fixed:] += strength * (BENDS * penalty + SIZE * np.eye(len(columns)))
            tried.append(Freeform(on, _losses(solve(found.fitted, ridge), found, self.blocks)))
        return loss_of(tried)

    def raw(self, on: tuple[str, ...]) -> tuple[list[Array], Array]:
        """Hats per interval of each stretch, shape (n, c), and the penalty on their bends, (c, c)."""
        if on == ("time",):
            count = max(self.blocks.count // BLOCKS_PER_TIME_HAT, 3)
            return basis(self.pieces, on, [count])
        if on == ("position",):
            return basis(self.pieces, on, [FINE_HATS])
        return basis(self.pieces, on, [HATS] if len(on) == 1 else [HATS_IN_PAIR] * len(on))


def _losses(theta: Array, found: Grams, blocks: Blocks) -> Array:
    """Squared residuals of each block by the fit that did not see it, shape (B,)."""
    residual = np.concatenate([np.ones((len(theta), 1)), -theta], axis=1)[blocks.fold]
    return np.asarray(np.einsum("bi,bij,bj->b", residual, found.held_out, residual))


def _columns(equations: Equations, fit: Fit) -> list[Array]:
    inputs = inputs_of(fit.terms)
    columns = [equations.rows(drive(equations, inputs, tap)) for tap in (fit.tap, fit.tap + 1)]
    for term in fit.terms:
        if term.effect.role is not Role.INPUT:
            columns += [equations.rows(raw) for raw in raw_columns(equations, term, fit.tap)]
    return columns


def _varies(piece: Inputs, name: str) -> bool:
    return name in piece.values and float(np.ptp(piece.values[name])) > 0.0


def rich_residual(fits: FreeformFits) -> Array:
    """What remains beside functions of every single channel at once, in the domain of the equations."""
    columns = list(fits._base[1:])
    for on in fits.groups():
        if len(on) == 1:
            raw, _ = fits.raw(on)
            columns += [fits.equations.rows([a[:, i] for a in raw]) for i in range(raw[0].shape[1])]
    rows = [fits._base[0], *columns]
    theta = solve(total_gram(rows)[None], SIZE)[0]
    return np.asarray(rows[0] - theta @ np.stack(columns))


def loss_of(found: Sequence[Freeform]) -> Freeform:
    """The one with the least held-out loss."""
    return min(found, key=lambda f: f.loss)
