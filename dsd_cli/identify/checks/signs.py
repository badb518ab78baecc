"""Which channel has the wrong sign: u, velocity, position and d_hat have a vote each."""

from __future__ import annotations

from dsd_cli.identify.checks.disturbance import Observed, culprit
from dsd_cli.identify.checks.results import Finding
from dsd_cli.identify.checks.sign import sign_of_u
from dsd_cli.identify.checks.view import View


def check_signs(view: View, opposite: bool, d_hat: Observed | None, observer_sign: int) -> list[Finding]:
    """At most one finding about u or the motion.

    Parameters
    ----------
    opposite : velocity and position have opposite signs.
    d_hat : how d_hat is made of the motion (as `view.band` takes it) and u, where it is logged.
    """
    turned = sign_of_u(view)
    blamed = "" if d_hat is None else culprit(d_hat, observer_sign)
    source = view.band.source if view.band is not None else "position"
    if opposite:
        other = "velocity" if source == "position" else "position"
        against_u = turned > 0.0 or blamed == "motion"
        return [_opposite(source if against_u else other, sure=against_u or _sees(view))]
    if blamed == "motion":
        both = [name for name in ("velocity", "position") if name in view.log]
        what = f"{' and '.join(both)}: the other sign than u and d_hat"
        return [Finding(what, source, "error", 0.95, multiply=tuple((name, -1.0) for name in both))]
    if turned > 0.0 or blamed == "u":
        what = "u has the other sign than the motion it causes"
        return [Finding(what, "u", "error", max(turned, 0.95), multiply=(("u", -1.0),))]
    return []


def _sees(view: View) -> bool:
    """Whether a u of the wrong sign would have been seen."""
    fit, done = view.forward, view.work
    return (fit is not None and fit.explained > 0.5) or (done is not None and done.clearness > 5.0)


def _opposite(channel: str, sure: bool) -> Finding:
    other = "position" if channel == "velocity" else "velocity"
    what = "velocity has the other sign than the slope of position"
    remedy = "" if sure else f"this log cannot say whether it is not {other} that must be turned"
    return Finding(what, channel, "error", 0.98, remedy, ((channel, -1.0),))
