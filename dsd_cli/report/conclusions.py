"""One plain sentence on what to conclude from a comparison."""

from __future__ import annotations

import math
from pathlib import PurePath

from dsd_cli.identify.compare.comparison import BIAS, COMMAND, EXACT, MEMORY, NO_BALANCE, NOISE, SHORT, Comparison
from dsd_cli.identify.compare.forward import OPEN_LOOP, Forward
from dsd_cli.identify.compare.residuals import LARGE

_NEXT = "`dsd diagnose` says which effect"
_ON = {
    "direction": "the direction of motion, as dry friction does",
    "velocity": "the velocity, as friction does",
    "position": "the position, as weight, springs and cogging do",
    "u": "the command, as its limits, a dead zone or a wrong inertia do",
    "acceleration": "the acceleration, as a wrong inertia does",
    "time": "the time, as drift, a change of the load or pushes from outside do",
}
_OTHER = {
    MEMORY: "the error depends on no channel, but on its own past: dynamics that the model lacks, noise of the"
    " measured motion, or forces from outside; `dsd diagnose` tries the effects with memory",
    COMMAND: f"the error follows u, but is no function of it: a wrong delay or inertia, or a load that swings; {_NEXT}",
    NOISE: "what is left looks like noise: nothing in this log asks for another effect",
    EXACT: "the model predicts this log exactly: the error is rounding",
    SHORT: "the log is too short to say on what the error depends",
}
#: Times the force error of the best log, from which on another log is worth a word.
_UNEQUAL = 2.0
#: Why a closed loop is further off than an open one.
CONTROLLER = (
    "the closed loop is further off than the open one, so that is not the model's error: the drive's controller is not"
    " quite the configured one (the speed that it measures, its noise, how it differentiates the reference); judge the"
    " model by the open loop"
)


def conclusion(result: Comparison) -> str:
    """What the error depends on, and what to do next."""
    return _conclusion(result) + _unequal(result) + _held_out(result)


def _held_out(result: Comparison) -> str:
    """That the log set aside is much further off than those that the sentence is about."""
    force = result.force
    if result.holdout is None or force.log is None or force.holdout is None:
        return ""
    if not force.holdout.rmse > _UNEQUAL * force.log.rmse:
        return ""
    name, times = PurePath(result.holdout.log).name, force.holdout.rmse / max(force.log.rmse, 1e-300)
    return f"; {name}, held out, is {times:.2g} times as far off: a value differs there, or an effect shows"


def _unequal(result: Comparison) -> str:
    """That one of several logs is much further off: then a value may differ between them."""
    left = result.force.by_log
    if len(left) < 2 or not max(left.values()) > _UNEQUAL * min(left.values()):
        return ""
    times = max(left.values()) / max(min(left.values()), 1e-300)
    worst, best = (PurePath(choose(left, key=lambda log: left[log])).name for choose in (max, min))
    return (
        f"; {worst} is {times:.2g} times as far off as {best}: where friction or an offset differs between logs,"
        " `dsd diagnose` with all of them says each log's level"
    )


def _conclusion(result: Comparison) -> str:
    found = result.conclusion
    if found == BIAS:
        share = _percent(result.bias_share)
        return f"{share} of the error is a constant, as a weight or an offset of u is: {_NEXT}"
    if found == NO_BALANCE:
        return f"on what the error depends cannot be said: {result.force.missing}"
    if found in _OTHER:
        return _OTHER[found]
    explains = max(d.explains for d in result.dependence if d.on == found)
    on = _ON.get(found, f"{found.replace(' x ', ' and ')} together")
    constant = result.bias_share
    beside = f", and {_percent(constant)} of the whole is a constant" if constant >= LARGE else ""
    return f"the error depends on {on} ({_percent(explains)} of its variance){beside}: {_NEXT}"


def no_dependence(result: Comparison) -> str:
    """Why there is nothing that the residual depends on."""
    if result.dependence:
        return "no channel explains 1 % of it"
    return result.force.missing or "the log is too short to hold out blocks"


def _percent(share: float) -> str:
    """Whole percent, but never 100 for what is less."""
    return f"{100 * share:.0f} %" if share < 0.99 else f"{100 * share:.1f} %"


def simulation_conclusion(result: Forward) -> str:
    """What the numbers of a simulation are worth."""
    loop, main = result.main
    if math.isfinite(result.horizon) and not result.restarts:
        return (
            f"no stretch of the log is longer than {result.horizon:g} s, so nothing was begun anew: over all of it the"
            f" model is {main.rmse:.3g} {main.unit} off in {main.channel} (rms); a shorter --horizon says more"
        )
    if math.isfinite(result.horizon):
        return (
            f"from a measured state the model is {main.rmse:.3g} {main.unit} off in {main.channel} (rms) within"
            f" {result.horizon:g} s"
        )
    if loop == OPEN_LOOP:
        return (
            "in open loop the model integrates every error of its forces twice, so its position drifts away: judge"
            " the model by --horizon prediction"
        )
    if result.of_controller:
        return CONTROLLER
    return "the controller holds the drift down in closed loop; in open loop the position drifts away in any case"
