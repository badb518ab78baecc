"""How sure a verdict is where the makers that it was asked of did not make d_hat."""

from types import SimpleNamespace

import pytest

from dsd_cli.identify import d_hat_makers
from dsd_cli.identify.d_hat_makers import Beliefs, diagnosed
from dsd_cli.plant.maker import MAKERS
from tests.report.examples import DIAGNOSIS


class SameValues:
    """Values that the makers agree on."""

    def __init__(self, *_: object) -> None:
        self.probability = 0.0

    def wrong(self, *_: object) -> float:
        return 1.0

    def put(self, answer, sure):
        self.probability = sure
        return SimpleNamespace(verdict=answer.verdict, probability=sure)


@pytest.mark.parametrize(("share", "surest"), [(0.001, 0.5), (0.9, 0.99)])
def test_a_verdict_of_makers_that_are_ruled_out_is_even_at_most(monkeypatch, share, surest):
    first, other, *_ = MAKERS
    beliefs = Beliefs({first: share, other: 1.0 - share}, {first: {}, other: {}})
    found = {first: SimpleNamespace(verdict="coulomb_friction", probability=0.99, advice=())}
    monkeypatch.setattr(d_hat_makers, "_searched", lambda *_: (found, beliefs))
    monkeypatch.setattr(d_hat_makers, "_OverMakers", SameValues)
    monkeypatch.setattr(d_hat_makers, "replace", lambda answer, **_: answer)
    asked = SimpleNamespace(recordings=[SimpleNamespace(sample_time=1e-3)], model=None, made=lambda _: ([], []))
    answer, _ = diagnosed(asked, lambda *_: DIAGNOSIS)
    assert answer.probability == pytest.approx(surest)
