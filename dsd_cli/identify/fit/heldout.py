"""Held-out errors in the unit of u: what a whitened fit is worth on d_hat itself."""

from __future__ import annotations

import numpy as np

from dsd_cli.effects import Role
from dsd_cli.identify.fit.bank import Term, Terms, drive, inputs_of, raw_columns
from dsd_cli.identify.fit.blocks import Blocks
from dsd_cli.identify.fit.rows import Equations
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.signals.log import Array


class PlainErrors:
    """Residuals of fits as d_hat shows them: not whitened, not thinned; rows that can be used only.

    Parameters
    ----------
    blocks : those of the (thinned) rows that the fits were made on.
    """

    def __init__(self, equations: Equations, blocks: Blocks) -> None:
        self.equations = equations
        self._y = equations.plain_measured()
        self._fold = blocks.fold[equations.block_of_plain_rows(blocks)]
        self._keep = np.concatenate([s.keep[equations.startup :] for s in equations.stretches]) > 0.0
        self._columns: dict[object, Array] = {}
        self._known: dict[tuple[Terms, int], float] = {}

    @property
    def force(self) -> float:
        """rms of the net force Jn a, unit of u."""
        return float(np.sqrt(np.mean(self._y[self._keep] ** 2)))

    def residual(self, fit: Fit, held_out: bool = True) -> Array:
        """y less the fit: each row by the fit that did not see its block, or by the fit to all; shape (N,)."""
        left = self._y.copy()
        for i, column in enumerate(self._of(fit)):
            left -= (fit.folds[self._fold, i] if held_out else fit.total[i]) * column
        return left * self._keep

    def rmse(self, fit: Fit) -> float:
        """Held-out root mean square, unit of u."""
        key = (fit.terms, fit.tap)
        if key not in self._known:
            self._known[key] = float(np.sqrt(np.sum(self.residual(fit) ** 2) / np.count_nonzero(self._keep)))
        return self._known[key]

    def _of(self, fit: Fit) -> list[Array]:
        inputs = inputs_of(fit.terms)
        columns = [self._drive(inputs, tap) for tap in (fit.tap, fit.tap + 1)]
        for term in fit.terms:
            if term.effect.role is not Role.INPUT:
                columns += self._term(term, fit.tap)
        return columns

    def _drive(self, inputs: Terms, tap: int) -> Array:
        return self.equations.plain(drive(self.equations, inputs, tap))

    def _term(self, term: Term, tap: int) -> list[Array]:
        return [self.equations.plain(raw) for raw in raw_columns(self.equations, term, tap)]
