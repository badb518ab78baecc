"""What a controller is to follow: rates that are logged nowhere."""

import numpy as np

from dsd_cli.plant.references import Logged, Samples, Sine, Step, Trapezoids


def test_the_rate_of_a_logged_reference_is_not_late():
    """Central where it is smooth, backward where it jumps; beside the rates of the reference that was logged."""
    move = Trapezoids(1.5, 6.0, 60.0, dwell=0.1, start=0.05)
    for made, off in ((move, 0.011), (Sine(20.0, 0.3), 0.001), (Step(0.1, 0.7), 0.0)):
        true = made.sample(900, 0.001)
        logged = Logged(tuple(true.position.tolist())).sample(900, 0.001)
        late = Samples(tuple(true.position.tolist())).sample(900, 0.001)
        wrong, before = (np.sqrt(np.mean((one.rate - true.rate)[1:-1] ** 2)) for one in (logged, late))
        assert wrong <= off * np.abs(true.rate).max()
        assert wrong <= before
