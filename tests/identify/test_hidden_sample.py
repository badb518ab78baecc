"""A sample of the study of hidden effects (`python -m bench hidden`), small enough for every run of the tests.

Every second effect of the catalogue is asked, all of them by the study. Targets are the study's: of the plain single
effects 95 % are named, and nothing is found where nothing is missing.
"""

from bench import hidden_score as score
from bench.hidden_cases import SENSINGS, Job
from bench.hidden_run import ANGLE, Row, batch_rows
from tests.oracle.machine_cases import EFFECT_IDS

SEED = 1
MOTION_SENSINGS = ("all", "velocity", "position")
SINGLES = [
    Job("singles", (name,), SEED, "plain", MOTION_SENSINGS[k % len(MOTION_SENSINGS)])
    for k, name in enumerate(EFFECT_IDS)
][::2]
CLEAN = [Job("none", (), seed, sensing=SENSINGS[seed % len(SENSINGS)]) for seed in range(len(SENSINGS))]
#: Held-out error with the effect in, over what the sensor alone leaves in the band.
LEAST_RIGHT, MOST_ERROR = 0.95, 1.05
#: Share by which a value may be wrong (rad for an angle), and of values that may be further off.
FAR, MOST_FAR = 0.03, 0.1


def described(rows: list[Row]) -> list[str]:
    return [f"{r['call']} -> {r['verdict']} {r['probability']:.2f}, ties {r.get('ties', [])}" for r in rows]


def test_a_sample_of_hidden_effects() -> None:
    """One test, so that the machines are integrated once, in one batch."""
    rows = batch_rows([*SINGLES, *CLEAN])
    crashed = [f"{r['call']}: {r['error']}" for r in rows if "error" in r]
    assert not crashed
    alarms = [r for r in rows if r["part"] == "none" and r["verdict"] != "none"]
    assert not alarms, described(alarms)
    alone = score.counted(r for r in rows if r["part"] == "singles")
    assert len(alone) >= 0.9 * len(SINGLES), "the sample is to hold effects that matter and can be tested"
    named = [r for r in alone if score.right(r)]
    assert len(named) >= LEAST_RIGHT * len(alone), described([r for r in alone if not score.right(r)])
    ratios = score.quantiles([r["after"] / r["sensor"] for r in named])
    assert ratios is not None
    assert ratios["median"] <= MOST_ERROR, ratios
    _values_are_right(named)


def _values_are_right(named: list[Row]) -> None:
    """Values of effects and the inertia of the machines, against the generator's."""
    values = [(r["call"], v) for r in named for v in r["values"]]
    far = [(call, v) for call, v in values if abs(v["error"]) > FAR * max(abs(v["true"]), v["name"] == ANGLE)]
    assert len(far) <= MOST_FAR * len(values), far
    inertias = {r["call"]: r["own_error"]["inertia"] for r in named}
    far_ones = {call: error for call, error in inertias.items() if abs(error) > FAR}
    assert len(far_ones) <= MOST_FAR * len(inertias), far_ones
