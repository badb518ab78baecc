"""The tuning of the detector."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from dsd_cli.detect.coloured import SensorNoise
from dsd_cli.detect.transition import Transition

Method = Literal["dsd", "average", "imm", "viterbi", "smooth", "profile", "combination"]

Output = Literal["d_hat", "derivative"]

#: Methods whose labels have estimates of delay and inertia between the candidates.
ESTIMATING = ("profile", "combination")

#: Methods that need the whole log before the first label.
OFFLINE = ("viterbi", "smooth")


@dataclass(frozen=True)
class DetectorSettings:
    """Tuning of the detector; the defaults are the paper's.

    Attributes
    ----------
    method : dsd (eq. 18-19), average (eq. 7-9), imm (eq. 10), viterbi, smooth (forward-backward), profile (estimates
        between the candidates, see `detect.profile`), combination (eq. 12).
    window : M of eq. 16-17, samples; imm, viterbi and smooth use one sample (their recursion is the memory).
    rho : standard deviation of eq. 5, unit of u.
    average : N of eq. 8, samples.
    transition : A of eq. 2.
    initial : index of the state before the first label.
    observer_filter : predictions pass Q like the measurement; False is eq. 14 to the letter.
    hold : nats by which another state must lead before the label changes; 0 is the paper's rule.
    confidence : nats of lead, on every axis of the grid, for `confident`; the state must also explain the window to
        within about 2 rho, or no label is confident.
    output : what the states predict: d_hat (eq. 14), or its derivative from u and d_hat (eq. 6: damping states alone;
        rho is then in unit of u per s).
    change : nats by which two windows must be better than one for a change (method "profile"); 0 looks for none.
    sensor_noise : white noise of the sensor behind d_hat, beside rho; see `detect.coloured`.
    """

    method: Method = "dsd"
    window: int = 100
    rho: float = 0.3
    average: int = 1
    transition: Transition = field(default_factory=Transition)
    initial: int = 0
    observer_filter: bool = True
    hold: float = 0.0
    confidence: float = 3.0
    output: Output = "d_hat"
    change: float = 20.0
    sensor_noise: SensorNoise = field(default_factory=SensorNoise)

    @property
    def effective_window(self) -> int:
        """M, or 1 for the methods whose recursion is the memory: a window would count every sample M times."""
        return 1 if self.method in ("imm", *OFFLINE) else self.window
