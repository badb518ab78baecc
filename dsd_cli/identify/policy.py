"""Every threshold that changes an answer, in one place; docs/how/policy.md has the same table (a test).

Nats are natural logarithms of likelihood ratios on data that a fit did not see. Budgets of computing stand
where they are spent.
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
    least_band_periods: float = 15.0  # periods of the band's end in a stretch that accelerates
    flattest: float = 1e-3  # least noise density over its mean: no row is trusted more than 30 times another

    # -- which way round --
    fair_part: float = 0.2  # rms of J a over that of u; with less, u is friction, weight or cogging nearly all through
    other_way: float = 0.5  # of the share that one form leaves, at most, for the other to be taken
    believed_inertia: float = 4.0  # factor within which an inertia is believed where the log leaves it open

    # -- rows --
    least_free: float = 0.3  # share of a row in which friction's direction is known
    unsure_share: float = 0.005  # of a row in which the axis may rest or turn, from which on it is weighed down
    sure_part: float = 0.3  # of the rows that count, in which the direction is sure: those decide what is missing
    harmless_lean: float = 0.1  # of a row's noise, by which the friction in its unsure share may lean
    rows_per_value: int = 10  # of which the direction is sure, for each value; with fewer all rows count alike
    incomplete: float = 1.3  # of the noise's power; a fit that leaves more misses something, and its values err by it
    delay_step_share: float = 0.03  # of a row; a delay between two steps mixes both, exact enough to the band's end
    exercised: float = 0.99  # quantile of |u| that counts as its largest: one spike says nothing about a limit

    # -- noise --
    least_segments: int = 5  # periodograms of a residual's spectrum; with fewer nothing is said of its shape
    stands_out: float = 1.6  # of the least density above it: a line or a rise towards low frequencies
    correlated_rows: int = 60  # lags over which the correlation of whitened rows is summed
    noise_from_share: float = 0.5  # of half the sample rate, where motion has ended: the sensor's noise is read there

    # -- delays --
    least_delay_range: float = 0.03  # s that are tried at least; each such distance from the believed delay costs a nat
    longest_delay: float = 1.0  # s of delay that are tried at most; no drive answers later
    longest_delay_share: float = 0.2  # of a stretch that accelerates

    # -- held-out blocks --
    gap_rows: int = 5  # between what is fitted and what is judged: the reach of low-pass and whitening
    folds: int = 5  # of the cross-validation: each fit sees four fifths of the log
    most_blocks: int = 40  # of a log; more would be short against the correlation of its rows
    block_gaps: int = 3  # gaps that a block is long at least, so that not all of a fit's rows are gaps

    # -- evidence for an effect --
    effect_price: float = 3.0  # nats for an effect, one of some twenty, and for each shape of it that was searched
    pulse_price: float = 14.0  # nats for a pulse in time: its level and two edges, found among all rows
    least_gain: float = 6.0  # nats beyond its price that a step must gain, without its best block, too
    most_lost: float = 0.3  # of what blocks gain, that others may lose: a gain must not be that of a few blocks
    most_effects: int = 8  # added to a model, and steps of a ladder; a rig distinguishes no more
    least_cycles: float = 3.0  # in a stretch, for its motion to be called one that repeats
    cycle_left: float = 0.5  # correlation of the speed with itself, below which it has gone elsewhere in between
    cycle_alike: float = 0.98  # and that it has again a cycle later
    least_periods: float = 2.5  # of a line in the log or the travel; fewer are a trend

    # -- pulses in time --
    most_pulses: int = 6  # of a stretch and of a log; more are a law
    shortest_pulse: int = 3  # rows
    pulse_deviations: float = 8.0  # standard errors of its mean: it is the best of very many windows
    unsure_push: float = 0.25  # of a row in which the axis may rest or turn, from which on it shows no push
    weakest_pulse: float = 0.1  # of the strongest; less is part of its edges
    of_place: float = 0.35  # of the pushes' variance that the position explains; no true ones reach it by chance

    # -- what matters in practice --
    least_fall: float = 0.015  # share of the held-out error that a step takes off; a load above the band may cost it
    least_force: float = 0.003  # and the share of u that it explains
    much_force: float = 0.015  # or the share of u that it explains, however loud the noise

    # -- several logs --
    level_own_share: float = 0.05  # of a level's columns that functions of the motion leave; else not identifiable
    level_knots_apart: float = 0.02  # of a channel's range, in which a function beside levels bends; no finer

    # -- long recordings --
    searched_samples: int = 20_000  # of excerpts in which sets of effects are searched; all rows judge them
    searched_seconds: float = 10.0  # the least that they last
    searched_slack: float = 1.3  # recordings up to so many times as long are searched whole
    unexplained_seconds: float = 1.0  # of a window over which what is left is compared with the excerpts'
    unexplained_factor: float = 2.0  # of the power in their worst window, from which on it joins them

    # -- reconstructed motion --
    most_drift: float = 0.7  # of the range of the position, by which it may drift and still be used
    most_travel: float = 1.5  # times the least travel of any speed offset: an axis that works comes back
    told_deviations: float = 2.0  # standard errors that the values of an effect must be away from 0

    # -- a resonance above the band --
    response_lowest_share: float = 0.25  # of the band's end, from which on the response is looked at
    response_highest_share: float = 0.15  # of the sample rate, up to which it is
    response_nats: float = 30.0  # that a resonance must gain over a rigid axis and over a lag; noise alone reaches 8
    response_share: float = 0.03  # least share of the inertia that swings; and that does not
    response_damping: float = 0.25  # of the free vibration; above, nothing swings
    response_correlated: float = 6.0  # rows over which what a swinging load leaves is correlated; more: play may rattle
    response_fall: float = 0.5  # of the output error that it takes off: less, and it leaves something correlated
    driven_gain: float = 0.7  # of the error with a load that the sensor drives, that one driven by the model may leave
    play_alone: float = 0.1  # of the force in contact, that may push a motor which is alone in its play
    play_off: float = 0.03  # of the play, by which contacts may lie off its flanks; of true play up to 0.02

    # -- vetoes --
    least_inertia: float = 0.01  # of the inertia first fitted; a set that leaves less explains u by itself

    # -- ties --
    nearly_the_same: float = 0.05  # share by which errors of two effects alone may differ; the commoner one is named
    rival_share: float = 0.7  # of the winner's explained power that a rival explains whose lead in nats is uncertain
    rival_deviations: float = 2.5  # standard errors over the blocks below which a lead is uncertain
    rival_share_in_misfit: float = 0.9  # of the winner's explained power that suffices where something unknown is left
    changed_for_name: float = 2.0  # factor on the given values, beyond the winner's change, with which it is not named
    rival_error: float = 2.0  # times the winner's error; a rival that leaves more is none

    # -- probability --
    tempering: float = 0.5  # exponent on likelihoods: blocks are neither independent nor alike
    least_told_direction: float = 0.9  # of the samples in motion; a sensor that shows fewer cannot identify friction
    even: float = 0.5  # odds of what the log leaves open: no value away from 0, no known zero, another value than given
    surest: float = 0.99  # no verdict is surer: the catalogue is not the world
    clear_fall: float = 0.1  # share of what is left that pushes, a filter, a path or an unconfirmed effect take off
    stands_in: float = 3.0  # times what is left; what takes off no more stands in for another law half the time
    rows_of_a_choice: float = 3.0  # independent equations that halve a belief; times the square of the set's size
    surest_in_doubt: float = 0.9  # "unknown", for the search may have missed an effect; pushes in time

    # -- values --
    value_deviations: float = 4.0  # standard errors from which on a value is wrong, or a load has a frequency, or a gap
    contradicting_deviations: float = 3.0  # standard deviations from which on a log contradicts a prior or held value
    not_identified: float = 1e3  # standard errors over the value; more is no estimate
    tied_correlation: float = 0.97  # of two values, above which they are one; with the inertia only the ratio is known
    reported_correlation: float = 0.9  # of two values, above which it is reported
    blocks_per_unknown: int = 3  # below which the scatter over blocks is no estimate of a covariance

    # -- nothing is missing --
    floor_factor: float = 1.6  # of the sensor's floor; what is left above it is no noise of the sensor
    least_unknown: float = 0.01  # share of u that is left at even odds of a force; the least beside friction at turns
    floor_excess: float = 0.03  # share of u that is left above that, from which on something is missing, if unknown
    unknown_fall: float = 0.04  # share of the held-out error that a free-form function takes off: something is unknown
    unknown_nats: float = 12.0  # and the nats that it gains: it is the best of some ten functions
    structured_share: float = 0.35  # of the residual's power below which its spectrum may be that of noise
    share_of_possible: float = 0.75  # of the power that a free-form function explains, that named effects explain

    # -- motion --
    resolved_deviations: float = 10.0  # of the position's noise (three counts of an encoder): the shortest way resolved
    least_rest_samples: int = 5  # slow samples in a row that may be a rest
    resting_most: float = 0.3  # of the rms speed: no faster is at rest, however loud the noise
    resting_share: float = 0.5  # of the rest speed: what mean and change of the speed may be over a rest
    resting_size: float = 1.2  # of the rest speed: what the rms of the speed may be; noise alone has a third
    resting_slope: float = 0.05  # of the usual change from sample to sample: what the change may be instead
    resting_bands: tuple[float, ...] = (1.0, 2.0, 3.0)  # times the rest speed; noise exceeds it for a moment
    least_moving: float = 0.02  # share of rows in which the axis slides
    rest_deviations: float = 3.0  # of the speed's noise, within which the axis may be at rest
    creep_share: float = 1e-3  # of the rms speed, up to which a sticking axis may creep
    presliding_share: float = 0.01  # of it, up to which friction may not have reached its level, if that lasts a row
    clear_acceleration: float = 0.12  # of the rms of u: noise of J a above which the smoothed speed's slope is taken
    clear_signs: float = 8.0  # standard errors from which on a sign counts
    correlated_samples: float = 50.0  # of d_hat that count as one, for that

    # -- smoothing --
    smoothing_growth: float = 1.1  # of what a window removes over narrower ones, from which on it removes signal
    noise_misjudged: float = 1.4  # times the noise that may be removed at first: it is not always white
    windows_agree: float = 5.0  # standard deviations by which a wider window may differ from a narrower one


POLICY = Policy()
