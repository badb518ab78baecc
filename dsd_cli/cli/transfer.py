"""`dsd improve --from-prior`: a model learnt on one machine as prior for its sister."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from dsd_cli.errors import UsageError

if TYPE_CHECKING:
    from dsd_cli.files.config import Config
    from dsd_cli.identify.compare.versus import Moved
    from dsd_cli.identify.results import Ladder


#: Share by which sister machines differ, where nobody says.
SPREAD = 0.1


def check_spread(spread: float, from_prior: bool) -> None:
    """Raises UsageError where a spread is given that nothing would use."""
    if spread != SPREAD and not from_prior:
        raise UsageError(f"--spread {spread:g} without --from-prior", "it says how far sister machines may differ")


def with_priors(config: Config, spread: float) -> Config:
    """The config with every value of [model] as a prior, but for those of which [fit] says more.

    A prior is as wide as its standard error in [[history]] and the spread between machines together.

    Raises
    ------
    UsageError : a spread that is no share, or [fit] holds everything.
    """
    from dsd_cli.cli.recordings import believed_model
    from dsd_cli.cli.versus import fitted_errors
    from dsd_cli.effects import get_effect
    from dsd_cli.identify.fit.values import flat

    if not (math.isfinite(spread) and 0.0 < spread <= 10.0):
        raise UsageError(f"--spread {spread:g}", "must be a share above 0, such as 0.1")
    if config.fit.hold:
        raise UsageError("--from-prior and --hold", "what is held has no prior")
    said, errors = {*config.fit.fix, *config.fit.prior}, fitted_errors(config)
    model, texts = believed_model(config), []
    for name, value in flat(model).items():
        effect, _, parameter = name.partition(".")
        angle = parameter and get_effect(effect).parameter(parameter).unit == "rad"
        width = math.hypot(errors.get(name, 0.0), spread * (1.0 if angle else abs(value)))
        low, high = config.fit.bounds.get(name, (-math.inf, math.inf))
        if name not in said and not low <= value <= high:
            hint = "as a prior it must be within: widen the bounds, or leave them out"
            raise UsageError(f"--from-prior: {name} = {value:g} is outside of its bounds, {low:g} to {high:g}", hint)
        if name not in said and width > 0.0:
            texts.append(f"{name}={value!r}+-{width!r}")
    return config.knowing(prior=texts)


def transferred(config: Config, ladder: Ladder) -> tuple[Moved, ...]:
    """The values of [model] beside those that this machine has."""
    from dsd_cli.cli.recordings import believed_model
    from dsd_cli.cli.versus import fitted_errors
    from dsd_cli.identify.compare.versus import moved
    from dsd_cli.identify.fit.values import flat

    return moved(
        flat(believed_model(config)),
        {name: e.value for name, e in ladder.values.items()},
        fitted_errors(config),
        {name: e.std_error for name, e in ladder.values.items()},
        {name: e.unit for name, e in ladder.values.items()},
    )
