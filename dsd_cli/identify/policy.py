"""Every threshold that changes an answer, in one place; docs/policy.md has the same table, and a test compares the two.

Nats are natural logarithms of likelihood ratios on data that a fit did not see. Budgets of computing stand in `Budget`.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Policy:
    """What counts as signal, as certain, as large enough to be said, and as sure."""

    # -- band --
    highest_share: float = 0.125  # of the sample rate; above, means over an interval are not exact enough
    signal_over_noise: float = 100.0  # power of the acceleration over the sensor's noise at the end of the band
    least_band_hz: float = 2.0  # Hz; slower moves than that hold no servo axis' dynamics
    least_band_periods: float = 15.0  # periods of the band's end in the longest stretch
    flattest: float = 1e-3  # least noise density over its mean: no row is trusted more than 30 times another

    # -- rows --
    least_free: float = 0.3  # share of a row in which friction's direction is known
    delay_step_share: float = 0.03  # of a row; a delay between two steps mixes both, exact enough to the band's end
    exercised: float = 0.99  # quantile of |u| that counts as its largest: one spike says nothing about a limit

    # -- noise --
    least_segments: int = 5  # periodograms of a residual's spectrum; with fewer nothing is said of its shape
    stands_out: float = 1.6  # of the least density above it: a line or a rise towards low frequencies
    correlated_rows: int = 60  # lags over which the correlation of whitened rows is summed

    # -- delays --
    least_delay_range: float = 0.03  # s of delay that are tried at least
    longest_delay: float = 1.0  # s of delay that are tried at most; no drive answers later
    longest_delay_share: float = 0.2  # of the longest stretch

    # -- held-out blocks --
    gap_rows: int = 5  # between what is fitted and what is judged: the reach of low-pass and whitening

    # -- what matters in practice --
    least_fall: float = 0.015  # share of the held-out error that a step takes off
    least_force: float = 0.003  # and the share of u that it explains
    least_force_at_turns: float = 0.01  # the same beside friction, which is not known better where the axis turns
    much_force: float = 0.015  # or the share of u that it explains, however loud the noise

    # -- long recordings --
    searched_samples: int = 20_000  # of excerpts in which sets of effects are searched; all rows judge them
    searched_seconds: float = 10.0  # the least that they last
    searched_slack: float = 1.3  # recordings up to so many times as long are searched whole
    unexplained_seconds: float = 1.0  # of a window over which what is left is compared with the excerpts'
    unexplained_factor: float = 2.0  # of the power in their worst window, from which on it joins them

    # -- reconstructed motion --
    drift_rounds: int = 3  # in which its drift is found beside a set of effects, and the set anew
    drift_gain: float = 0.9  # of the held-out error, which a round must reach

    # -- a resonance above the band --
    response_lowest_share: float = 0.5  # of the band's end, from which on the response is looked at
    response_highest_share: float = 0.15  # of the sample rate, up to which it is
    response_nats: float = 30.0  # that a resonance must gain over a rigid axis and over a lag; noise alone reaches 8
    response_lost: float = 0.3  # of what blocks gain, that others may lose
    response_share: float = 0.03  # least share of the inertia that swings; and that does not
    response_damping: float = 0.4  # of the free vibration; above, nothing swings
    response_in_band: float = 0.8  # of the band's end; a resonance below is told by the balance itself

    play_deviations: float = 5.0  # standard errors of a gap, which it must have

    # -- vetoes --
    least_inertia: float = 0.01  # of the inertia first fitted; a set that leaves less explains u by itself
    few_rows: int = 150  # independent equations below which no verdict is surer than 80 %

    # -- nothing is missing --
    floor_factor: float = 1.6  # of the sensor's floor; what is left above it is no noise of the sensor
    least_unknown: float = 0.01  # share of u that a function explains; friction at turns is not known better
    floor_excess: float = 0.03  # share of u that is left above that, from which on something is missing, if unknown

    narrow_band_hz: float = 10.0  # a band that ends below hides fast effects: "nothing" is then less sure

    # -- motion --
    resolved_deviations: float = 10.0  # of the position's noise (three counts of an encoder) in the shortest way told
    least_rest_samples: int = 5  # slow samples in a row that may be a rest
    resting_most: float = 0.3  # of the rms speed: no faster is at rest, however loud the noise
    resting_share: float = 0.5  # of the rest speed: what mean and change of the speed may be over a rest
    resting_size: float = 1.2  # of the rest speed: what the rms of the speed may be; noise alone has a third
    resting_slope: float = 0.05  # of the usual change from sample to sample: what the change may be instead
    resting_bands: tuple[float, ...] = (1.0, 2.0, 3.0)  # times the rest speed; noise exceeds it for a moment
    least_moving: float = 0.02  # share of rows in which the axis slides


POLICY = Policy()
