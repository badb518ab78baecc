"""Logs whose columns all passed the same low-pass, as drives and scripts write them: what is said of the axis is not
what the low-pass did."""

import pytest
from scipy import signal

from dsd_cli.identify.fit.problem import Settings
from dsd_cli.identify.recordings.recording import prepare
from dsd_cli.identify.recordings.spectrum import NOTHING_LOST
from dsd_cli.identify.results import NONE
from dsd_cli.identify.verdict.diagnose import diagnose
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.log import Log
from tests.oracle.rig import make
from tests.oracle.rig_cases import RigCase

STEP = 0.004
EFFECTS = (
    *("coulomb_friction", "presliding_friction", "viscous_friction"),
    *("gravity", "stiffness", "flexible_coupling"),
)


def logged(what, seed, hz):
    """(recording, model, observer) of a rig's log, after a Butterworth low-pass of fourth order to and fro; 0: none."""
    (made,) = make([RigCase(what, seed, "enc40k", duration=10.0, sample_time=STEP)])
    low = signal.butter(4, hz, fs=1.0 / STEP, output="sos") if hz else None
    channels = {
        name: x if low is None or name == "t" else signal.sosfiltfilt(low, x)
        for name, x in made.channels.items()
        if name != "reference"
    }
    observer = ObserverSettings(made.observer["nominal_inertia"], made.observer["time_constant"])
    model = PlantModel(made.believed["inertia"], made.believed["delay"], made.believed["effects"])
    return prepare(Log(channels, STEP, "log.csv"), observer), model, observer


@pytest.mark.parametrize("hz", [0.0, 10.0, 15.0])
def test_of_a_complete_model_nothing_is_missing(hz):
    recording, model, observer = logged((), 2, hz)
    found = diagnose([recording], model, observer, Settings(effects=EFFECTS))
    assert found.verdict == NONE
    assert (
        found.probability > 0.9 if hz == 0.0 else found.probability == pytest.approx(0.5)
    )  # of what is not in the log
    said = [warning for warning in found.warnings if "passed a low-pass" in warning]
    assert len(said) == (hz > 0.0)
    assert (recording.lost == NOTHING_LOST) is (hz == 0.0)


@pytest.mark.parametrize("hz", [10.0, 15.0])
def test_the_band_ends_below_the_cut_and_friction_is_named(hz):
    recording, model, observer = logged(("coulomb_friction",), 1, hz)
    found = diagnose([recording], model, observer, Settings(effects=EFFECTS))
    assert found.verdict == "coulomb_friction"
    assert 0.4 * hz < found.band_hz < hz
