"""The rigs' logs as tiers: what the studies of docs/measured (outside, hidden) ask, and d_hat by other makers."""

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from tests.oracle import d_hat_makers, machine_cases, machines
from tests.oracle.questions import Question, Tier
from tests.oracle.rig import D_HAT_NOISE, NOMINAL, make_exact
from tests.oracle.rig_cases import PAIRS, SINGLES, STRANGERS_SEEN, STRANGERS_UNSEEN, RigCase, RigLog
from tests.oracle.rig_designs import generator
from tests.oracle.rig_sizes import rms
from tests.oracle.rig_trials import find_trial

OWN = ("inertia", "delay")
STRANGERS = (*STRANGERS_SEEN, *STRANGERS_UNSEEN)
#: Effects that u and d_hat are asked for, without position and speed of their own.
BY_D_HAT = (
    *("viscous_friction", "coulomb_friction", "constant_load", "quadratic_drag", "viscous_asymmetry", "inertia"),
    *("external_force", "periodic_disturbance", "delay", "stiffness", "dead_zone", "actuator_lag"),
)


def _asked(log: RigLog, judged: str) -> Question:
    wrong = [name for name in OWN if not np.isclose(log.believed[name], log.truth[name], rtol=1e-9)]
    also = tuple(wrong) if set(log.case.what) & set(OWN) else ()
    return Question(
        hidden=log.case.what,
        channels={n: c for n, c in log.channels.items() if n != "reference"},
        believed=dict(log.believed),
        observer=dict(log.observer),
        truth=dict(log.truth),
        judged=judged,
        also=also,
        notes={"promised": log.floor["promised"], "shares": log.floor["shares"]},
    )


def _of_rig(seed: int, name: str, whats: Sequence[tuple[str, ...]], judged: str, more: dict[str, Any]) -> Question:
    """One of `whats` in turn; tiers of few logs do not all ask for the same ones."""
    what = whats[(seed + zlib.crc32(name.encode())) % len(whats)]
    log, _ = make_exact(RigCase(what=what, seed=seed, **more))
    return _asked(log, judged)


def _rig(
    name: str, sensing: str = "speed40k", whats: Sequence[Any] = SINGLES, judged: str = "one", **more: Any
) -> Tier:
    weight = more.pop("weight", 1.0)
    sets = tuple((w,) if isinstance(w, str) else tuple(w) for w in whats)
    return Tier(name, partial(_of_rig, name=name, whats=sets, judged=judged, more={"sensing": sensing, **more}), weight)


# -- d_hat by other makers ------------------------------------------------------------------------------------------


def _by_maker(seed: int, how: str, pairing: str, told: Mapping[str, str] | None = None) -> Question:
    """The same machine, motion and noise for every maker. In every other log the maker has the loop's own sensor of
    speed, else an exact one and white noise on d_hat, as in the rig. told : what the owner says of the maker."""
    case = RigCase(what=(BY_D_HAT[seed % len(BY_D_HAT)],), seed=seed, sensing="udhat")
    trial = find_trial(case)
    log, motion = make_exact(case)[0], trial.motion
    rng = generator(case, "maker", trial.attempt)
    nominal = trial.design.inertia * float(rng.uniform(*NOMINAL))
    own_sensor = bool(rng.random() < 0.5)
    v = np.array(trial.servo.seen_v) if own_sensor else motion.v
    d_hat = d_hat_makers.made(motion.t, motion.u, v, nominal, case.tau, how, pairing)
    noise = rms(motion.u[motion.t >= 0.0]) * rng.uniform(*D_HAT_NOISE) * rng.standard_normal(len(d_hat))
    d_hat = d_hat + (0.0 if own_sensor else 1.0) * noise
    made = _asked(log, "one")
    made.channels["d_hat"] = d_hat[motion.t >= 0.0]
    observer = {"nominal_inertia": nominal, "time_constant": case.tau, **(told or {})}
    return replace(made, observer=observer, notes=made.notes | {"filter": how, "u": pairing, "own_sensor": own_sensor})


def _told(how: str, pairing: str, told: Mapping[str, str], word: str) -> Tier:
    return Tier(f"d_hat: {how}, {pairing} u, {word}", partial(_by_maker, how=how, pairing=pairing, told=told), 0.5)


# -- the other generator --------------------------------------------------------------------------------------------


def _of_machines(seed: int, sensing: str) -> Question:
    what = machine_cases.EFFECT_IDS[seed % len(machine_cases.EFFECT_IDS)]
    (case,) = machine_cases.cases(what, [seed], sensing=sensing)
    (found,) = machines.run([case])
    effects = {n: dict(p) for n, p in (*case.base, *case.hidden) if n not in OWN}
    return Question(
        hidden=(what,),
        channels=dict(found.channels),
        believed={
            "inertia": case.believed_inertia,
            "delay": case.believed_delay,
            "effects": {n: dict(p) for n, p in case.base},
        },
        observer={"nominal_inertia": case.nominal_inertia, "time_constant": case.observer_time_constant},
        truth={"inertia": case.inertia, "delay": case.delay, "effects": effects},
        notes={"promised": float(found.ratio >= 1.0 / 0.95)},
    )


def tiers() -> list[Tier]:
    """All of them."""
    makers = [(how, pairing) for how in ("exact", "euler", "bilinear") for pairing in d_hat_makers.PAIRINGS]
    return [
        _rig("speed and 40,000 counts"),
        _rig("loud speed", "speedloud"),
        _rig("4096 counts", "enc4096"),
        _rig("8192 counts, irregular stamps", "enc8192jitter500"),
        _rig("u and d_hat", "udhat"),
        _rig("3 s", duration=3.0),
        _rig("100 Hz", sample_time=0.01),
        _rig("4 kHz", sample_time=0.00025, duration=8.0, weight=0.5),
        _rig("speed loop", loop="velocity"),
        _rig("weak loop", loop="weak"),
        _rig("open loop", loop="open"),
        _rig("moderate effects", strength="moderate"),
        _rig("believed inertia 3 %, delay 1 ms off", believed_inertia_factor=1.03, believed_delay_error=1e-3),
        _rig("two effects", whats=PAIRS, judged="set"),
        _rig("effects of no catalogue", whats=STRANGERS, judged="stranger", weight=1.5),
        _rig("nothing missing, speed", whats=((),), judged="none"),
        _rig("nothing missing, 4096 counts", "enc4096", ((),), "none"),
        _rig("nothing missing, irregular stamps", "enc8192jitter500", ((),), "none"),
        Tier("own rig, all channels", partial(_of_machines, sensing="all"), 0.5),
        Tier("own rig, position", partial(_of_machines, sensing="position"), 0.5),
        *(
            Tier(f"d_hat: {how}, {pairing} u", partial(_by_maker, how=how, pairing=pairing), 0.75)
            for how, pairing in makers
        ),
        _told("euler", "newest", {"filter": "euler", "u": "newest"}, "given"),
        _told("bilinear", "mean", {"filter": "bilinear", "u": "mean"}, "given"),
        _told("euler", "newest", {"filter": "auto", "u": "auto"}, "found"),
    ]
