"""The log that a motion will leave, simulated, and what the fits of all logs then say of it.

Which rows count, in which band, by which weights and against which noise is decided by the code that will decide it for
the true log (`task.searched_with`): near a threshold, as where friction's direction is sure in just enough rows,
no description of that code foresees it. Each plant that the logs leave as likely has another draw of the sensor's
noise, so that what hangs on either shows as a range.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from dsd_cli.design.expectation import Expected
from dsd_cli.design.inverse import Path, command_for
from dsd_cli.design.measure import Measure
from dsd_cli.design.seen import as_logged
from dsd_cli.identify.fit.bank import Terms
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.fit.testability import Settings
from dsd_cli.identify.search.sets import Search
from dsd_cli.identify.search.task import Task, searched_with
from dsd_cli.plant.model import PlantModel

#: Explanations, from which on each has fewer plants: the search in a log of each takes the most time of all.
_TRUTHS = 2


def expected_of(measure: Measure, paths: Mapping[int, Path], most: float, draws: int) -> Expected:
    """Of the pairs and values of a measure, by the logs and the one of a motion: the mean over so many plants each,
    over fewer of more explanations than two.

    paths : explanation -> the path that its plant takes; that of the first (0) where there is none. most : largest |u|.
    """
    nats: dict[tuple[int, int], list[float]] = {}
    of_use: dict[tuple[int, int], list[float]] = {}
    errors: dict[str, list[float]] = {value.name: [] for value in measure.targets.values}
    truths = _shapes(measure)
    draws = max(min(draws, _TRUTHS * draws // max(len(truths), 1)), 1)
    for truth, rivals in truths.items():
        for draw, plant in enumerate(measure.targets.explanations[truth].draws[:draws]):
            search, right = _searched(measure.search, plant, paths.get(truth, paths[0]), most, draw)
            for rival, shapes in rivals.items():
                fit = search.converged(min((search.fit(s, right.tap) for s in shapes), key=lambda f: float(f.loss)))
                nats.setdefault((truth, rival), []).append(search.nats(fit.loss) - search.nats(right.loss))
                was, now = (search.problem.errors.rmse(one) for one in (fit, right))
                more = (was**2 - now**2) / search.problem.least_of_use(fit) ** 2
                of_use.setdefault((truth, rival), []).append(more)
            if truth == 0 and errors:
                told = search.problem.values(right).estimates
                for value in measure.targets.values:  # one log more tells no less: beyond that the estimate scatters
                    error = float(np.fmin(told[value.name].std_error, value.error))
                    errors[value.name].append(error if error > 0.0 else math.inf)  # none: of no force, no shape
    return Expected(
        {pair: float(np.mean(found)) for pair, found in nats.items()},
        {pair: min(found) for pair, found in of_use.items()},
        {name: float(np.mean(found)) for name, found in errors.items()},
        {pair: (min(found), max(found)) for pair, found in nats.items()},
    )


def _shapes(measure: Measure) -> dict[int, dict[int, list[Terms]]]:
    """Truth -> rival -> its effects, as fitted and in other shapes."""
    found: dict[int, dict[int, list[Terms]]] = {0: {}} if measure.targets.values else {}
    for case in measure.cases:
        if case.truth != case.rival and case.draw == 0:
            found.setdefault(case.truth, {}).setdefault(case.rival, []).append(case.model.terms)
    return found


def _searched(search: Search, plant: PlantModel, path: Path, most: float, draw: int) -> tuple[Search, Fit]:
    """(search on the logs and that of a plant's motion, the set of effects of that plant)."""
    logs, model = search.problem.recordings, search.problem.model
    path = path.resampled(logs[0].sample_time)  # u between samples of the log would be no word of the delay's
    log = as_logged(logs[0], path, command_for(plant, path, most), model.rest_speed, draw)
    asked = Settings(effects=search.problem.candidates, known=search.solver.known)
    both, fit = searched_with(Task((*logs, log), model, asked), plant)
    return both, both.converged(fit)
