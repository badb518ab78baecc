"""Whether u and the motion are of one axis: u of another one, or of another time, has little in common with it.

Asked of u by the motion: with its acceleration, the effects that were found and any functions of speed and position, a
fit to one part of the log must explain u in the others. Effects can be found for any u; they do not explain it
elsewhere.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dsd_cli.identify.fit.freeform import freeform_fits
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.search.sets import Search

#: Share of u that the motion must tell. Of 335 logs of an outside rig with anything missing, laws that no catalogue has
#: among them, 334 have 0.55 and more, and the u of another axis has 0.39 at most in 117 of 120 (the others are short).
_LEAST_IN_COMMON = 0.45


@dataclass(frozen=True)
class AxisMatch:
    """share : of u, that the motion explains in parts of the log that were not fitted. rows : independent equations."""

    share: float
    rows: int

    @property
    def lacking(self) -> str:
        """What the log does not show; "" if nothing."""
        if self.share >= _LEAST_IN_COMMON:
            return ""
        if self.rows < POLICY.few_rows:
            return f"{self.rows} independent equations do not show that u drives this axis"
        return "u and the motion have too little in common: u does not seem to drive this axis"

    @property
    def said(self) -> str:
        """One sentence on what is lacking."""
        told = f"{100.0 * max(self.share, 0.0):.0f} % of u"
        text = f"{self.lacking} (fitted to one part of the log, the motion explains {told} in the others)"
        if self.rows < POLICY.few_rows:
            return f"{text}. A longer log, or faster moves, would show it; or is it the column of another axis?"
        return f"{text}. Is it the column of another axis, or from another time?"


def axis_match(search: Search, whole: Fit) -> AxisMatch:
    """Of u and the motion, beside the set that was found."""
    part = search.excerpt or search
    problem, fit = part.problem, part.fit(whole.terms, whole.tap)
    fits = freeform_fits(problem.errors.bank, part.equations, problem.blocks, fit, part.solver.inertia)
    groups = [group for group in (("velocity",), ("position",)) if group in fits.groups()]
    shares = (fits.share_of_u(groups[:count]) for count in range(len(groups), -1, -1))  # a run up is at each place once
    told = max(shares)
    if search.solver.inverse:  # the held-out error of the set is that of u by the motion, of all rows
        errors = search.problem.errors
        u = errors.bank.command((), whole.tap)[search.equations.kept]
        told = max(told, 1.0 - (errors.rmse(whole) / max(float(np.std(u)), 1e-300)) ** 2)
    return AxisMatch(told, problem.blocks.rows)
