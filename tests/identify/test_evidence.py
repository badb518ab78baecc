"""Probabilities: they share one unit of belief, do not depend on order, and one lucky block does not decide."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dsd_cli.identify.fit.bank import Bank, Term
from dsd_cli.identify.fit.blocks import spread_over_blocks
from dsd_cli.identify.fit.problem import Settings, pose
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.recordings.recording import prepare
from dsd_cli.identify.search.sets import Search
from dsd_cli.identify.verdict import probability
from dsd_cli.identify.verdict.belief import belief_by_squares, shared_belief
from dsd_cli.identify.verdict.probability import (
    NOTHING,
    changes,
    membership,
    probabilities,
)
from dsd_cli.plant.references import Multisine
from dsd_cli.signals.log import Log
from tests.identify.search_rig import BELIEVED, OBSERVER, T, posed, seen

GAINS = st.lists(st.lists(st.floats(-50.0, 50.0), min_size=6, max_size=6), min_size=1, max_size=5)


@settings(max_examples=60, deadline=None)
@given(GAINS, st.floats(0.0, 20.0))
def test_shares_are_of_one_whole(rows, price):
    gains = np.array([[0.0] * 6, *rows])
    shares = shared_belief(gains, np.array([0.0] + [price] * len(rows)))
    assert shares.sum() == pytest.approx(1.0)
    assert (shares >= 0.0).all()


@settings(max_examples=40, deadline=None)
@given(GAINS, st.randoms(use_true_random=False))
def test_the_order_of_the_alternatives_does_not_matter(rows, random):
    gains = np.array([[0.0] * 6, *rows])
    prices = np.arange(len(gains), dtype=float)
    order = list(range(len(gains)))
    random.shuffle(order)
    np.testing.assert_allclose(
        shared_belief(gains[order], prices[order]), shared_belief(gains, prices)[order], atol=1e-12
    )


def test_shares_are_those_of_a_bayesian_bootstrap_in_plain_loops():
    """Pseudo-BMA+ (Yao et al. 2018): each draw weighs the blocks anew, and shares belief by tempered likelihoods."""
    rng = np.random.default_rng(7)
    gains = np.array([np.zeros(12), rng.normal(0.8, 1.5, 12), rng.normal(0.5, 0.3, 12)])
    prices = [0.0, 3.0, 5.0]
    draws = []
    for _ in range(4000):
        weights = rng.exponential(size=12)
        weights *= 12.0 / weights.sum()
        nats = [
            POLICY.tempering * (sum(w * g for w, g in zip(weights, row, strict=True)) - p)
            for row, p in zip(gains, prices, strict=True)
        ]
        odds = [math.exp(n - max(nats)) for n in nats]
        draws.append([o / sum(odds) for o in odds])
    wanted, spread = np.mean(draws, axis=0), np.std(draws, axis=0)
    found = shared_belief(gains, np.array(prices))
    assert (np.abs(found - wanted) < 4.0 * spread * math.sqrt(1.0 / 400 + 1.0 / 4000)).all()
    assert wanted.min() > 0.02, "else nothing was compared"


def test_belief_by_squares_is_that_of_unknown_variances_over_the_blocks():
    """Where all blocks say the same, odds are (left / least) ** (-N / 2), tempered, N blocks: a t likelihood."""
    parts = np.random.default_rng(3).uniform(0.5, 2.0, 30)
    left = np.array([1.3, 1.0, 1.1, 2.0])
    found = belief_by_squares(left[:, None] * parts)
    odds = left ** (-0.5 * 30 * POLICY.tempering)
    np.testing.assert_allclose(found, odds / odds.sum(), rtol=0.15)
    np.testing.assert_allclose(belief_by_squares(7.0 * left[:, None] * parts), found, rtol=1e-9)
    np.testing.assert_allclose(belief_by_squares(np.ones((3, 8))), 1.0 / 3.0)


@pytest.mark.parametrize("blocks", [10, 20, 40])
def test_one_lucky_block_does_not_convince(blocks):
    gains = np.zeros((2, blocks))
    gains[1] = -0.2
    gains[1, 3] = 30.0
    assert shared_belief(gains, np.array([0.0, 6.0]))[1] < 0.9
    assert not spread_over_blocks(gains[1])
    spread = np.zeros((2, blocks))
    spread[1] = gains[1].sum() / blocks
    assert shared_belief(spread, np.array([0.0, 6.0]))[1] > shared_belief(gains, np.array([0.0, 6.0]))[1]


def test_a_gain_in_every_block_convinces():
    rng = np.random.default_rng(1)
    gains = np.array([np.zeros(20), rng.uniform(1.0, 4.0, 20)])
    assert shared_belief(gains, np.array([0.0, 6.0]))[1] > 0.99
    assert spread_over_blocks(gains[1])


def test_chance_convinces_nobody():
    for seed in range(50):
        gains = np.array([np.zeros(20), np.random.default_rng(seed).normal(0.0, 0.7, 20)])
        assert shared_belief(gains, np.array([0.0, 6.0]))[1] < 0.7


def test_gains_without_end_do_not_overflow():
    gains = np.array([np.zeros(8), np.full(8, 1e9), np.full(8, -1e9)])
    np.testing.assert_allclose(shared_belief(gains, np.zeros(3)), [0.0, 1.0, 0.0])


@pytest.mark.parametrize(
    ("gains", "agreed"),
    [
        (np.full(20, 1.0), True),
        (np.full(20, 0.3), False),
        (np.concatenate([[100.0], np.full(19, 0.1)]), False),
        (np.concatenate([[100.0], np.full(19, 1.0)]), True),
        (np.concatenate([np.full(12, 3.0), np.full(8, -2.0)]), False),
    ],
)
def test_blocks_agree_if_more_than_one_gains_and_few_lose(gains, agreed):
    assert bool(spread_over_blocks(gains)) is agreed


NAMES = ("coulomb_friction", "gravity", "viscous_friction", "stiffness", "constant_load")


@pytest.fixture(scope="module")
def search():
    found = posed({"coulomb_friction": {"level": 0.08}, "gravity": {"amplitude": 0.15, "phase": 0.3}}, NAMES)
    return found, found.run(found.refit)


def test_probabilities_of_options_and_nothing_sum_to_one_in_any_order(search):
    search, _ = search
    options = search.options(search.refit)
    shares = probabilities(search, search.refit, options)
    assert set(shares) == {NOTHING, *(o.effect for o in options)}
    assert sum(shares.values()) == pytest.approx(1.0)
    backwards = probabilities(search, search.refit, options[::-1])
    assert backwards == pytest.approx(shares)


def test_belief_counts_what_coloured_noise_explains_by_chance(search, monkeypatch):
    """As if every gain were so many times less, whichever is the best."""
    found, _ = search
    options, rest = found.options(found.refit), found.refit
    gains = np.stack([np.zeros(len(rest.losses)), *(found.gains(rest, o.fit) for o in options)])
    prices = np.array([0.0, *(found.price(o.fit.terms) for o in options)])
    monkeypatch.setattr(Search, "by_chance", lambda *_: 5.0)
    shares = probabilities(found, rest, options[::-1])
    expected = shared_belief(gains / 5.0, prices)
    assert list(shares.values()) == pytest.approx([expected[0], *expected[:0:-1]])


def test_nothing_alone_is_certain(search):
    search, _ = search
    assert probabilities(search, search.refit, []) == {NOTHING: pytest.approx(1.0)}


def test_members_of_the_truth_are_found_and_sure(search):
    search, whole = search
    assert {t.id for t in whole.terms} >= {"coulomb_friction", "gravity"}
    for name in ("coulomb_friction", "gravity"):
        found = membership(search, whole, name, misfit=False)
        assert found.effect == name
        assert sum(found.probabilities.values()) == pytest.approx(1.0)
        assert found.probabilities[name] > 0.9
        assert name not in found.rivals
        assert found.rivals == ()


def test_an_effect_that_explains_much_less_is_no_rival_however_uncertain_the_lead(search, monkeypatch):
    """A spring explains 61 % of what gravity does, and gains as well; with noise so loud that the rest is no certain
    lead it would be a tie, but for its share."""
    search, whole = search
    monkeypatch.setattr(probability, "in_plain_laws", lambda *_: None)  # one for one
    loud = Search(replace(search.problem, noise=replace(search.noise, variance=5e4 * search.noise.variance)))
    rest = loud.fit(tuple(t for t in whole.terms if t.id != "gravity"), whole.tap)
    (spring,) = [o for o in loud.options(rest) if o.effect == "stiffness"]
    assert spring.evidence > loud.evidence(rest)
    assert not loud.matters(spring.fit, whole)
    assert membership(loud, whole, "gravity", misfit=False).rivals == ()
    monkeypatch.setattr(probability, "POLICY", replace(POLICY, rival_error=100.0))
    assert membership(loud, whole, "gravity", misfit=False).rivals == ()
    monkeypatch.setattr(probability, "POLICY", replace(POLICY, rival_error=100.0, rival_share=0.5))
    assert membership(loud, whole, "gravity", misfit=False).rivals == ("stiffness",)


def test_an_effect_that_explains_as_much_is_a_rival_where_the_model_misfits():
    """Over a few degrees a spring and gravity are one and the same, beside damping that is not among the candidates."""
    small = Multisine((0.7, 1.7, 3.1, 5.3), 0.05, seed=3)
    hidden = {"stiffness": {"coefficient": 0.4}, "viscous_friction": {"coefficient": 0.01}}
    search = posed(hidden, ("stiffness", "gravity", "cogging"), reference=small)
    whole = search.fit((Term("stiffness"),), search.refit.tap)
    found = membership(search, whole, "stiffness", misfit=True)
    assert "gravity" in found.rivals
    assert "gravity" in found.alike


@pytest.mark.parametrize(("size", "rivals", "surest"), [(0.02, {"constant_load", "stiffness"}, 0.5), (0.5, set(), 1.0)])
def test_a_weight_over_a_few_degrees_is_no_surer_than_a_load_with_a_spring(size, rivals, surest):
    """Neither is it alone; together they are, to the sine's curvature, which noise of u hides."""
    moves, laws = Multisine((0.7, 1.7, 3.1, 5.3), size, seed=3), ("gravity", "stiffness", "constant_load")
    (piece,) = seen({"gravity": {"amplitude": 0.5, "phase": 0.4}}, reference=moves).pieces
    channels = {name: piece[name] for name in ("t", "velocity", "position")}
    channels["u"] = piece["u"] + 0.05 * np.random.default_rng(5).normal(size=len(piece))
    recording = prepare(Log(channels, T, "log.csv"), OBSERVER)
    search = Search(pose([recording], BELIEVED, Settings(effects=laws)))
    found = membership(search, search.fit((Term("gravity"),), search.refit.tap), "gravity", misfit=False)
    assert ({*found.rivals}, found.surest) == (rivals, surest)


def test_a_nat_is_worth_as_many_squares_as_the_noise_is_loud_and_dependent(search):
    """Of noise louder than what is left, rows of twice the variance, or of which two count as one, tell half as much;
    prices stay."""
    search, whole = search
    loud = replace(search.noise, variance=1e4 * search.noise.variance)
    search = Search(replace(search.problem, noise=loud))
    gains, price = search.gains(search.refit, whole), search.price(whole.terms)
    assert (gains > 0.0).sum() > 0.8 * len(gains)
    np.testing.assert_allclose(gains, (search.refit.losses - whole.losses) / (2.0 * loud.variance * loud.inflation))
    for louder in (replace(loud, variance=2.0 * loud.variance), replace(loud, inflation=2.0 * loud.inflation)):
        other = Search(replace(search.problem, noise=louder))
        np.testing.assert_allclose(other.gains(search.refit, whole), 0.5 * gains)
        gained = other.evidence(whole) - other.evidence(search.refit)
        assert gained == pytest.approx(0.5 * gains.sum() - price)


def test_what_is_left_beyond_the_noise_is_of_unknown_size(search):
    """Far above the noise a share of what is left counts, whatever the noise: N/2 ln of the ratio of squares."""
    search, whole = search
    quiet = replace(search.noise, variance=1e-6 * search.noise.variance)
    before, rows = search.refit, search.problem.blocks.rows
    expected = 0.5 * rows * np.log(before.loss / whole.loss)
    for noise in (quiet, replace(quiet, variance=1e-3 * quiet.variance), replace(quiet, inflation=5.0)):
        other = Search(replace(search.problem, noise=noise))
        gains = other.gains(before, whole)
        assert gains.sum() == pytest.approx(expected)
        np.testing.assert_allclose(gains / gains.sum(), (before.losses - whole.losses) / (before.loss - whole.loss))
        assert other.evidence(whole) - other.evidence(before) == pytest.approx(expected - other.price(whole.terms))


def test_rows_count_by_their_weights(search):
    """Above the noise, rows of which nine in ten have a tenth of the weight are worth a tenth and 0.9 hundredths."""
    search, whole = search
    equations, quiet = search.equations, replace(search.noise, variance=1e-9 * search.noise.variance)
    size = sum(equations.lengths)
    weight = np.where(np.arange(size) % 10 == 0, 1.0, 0.1)
    bank = Bank(replace(equations, row_weight=weight), search.problem.errors.bank)
    weighed = Search(replace(search.problem, noise=quiet, solver=search.solver.on(bank)))
    before, after = (weighed.fit(fit.terms, fit.tap) for fit in (search.refit, whole))
    expected = 0.5 * size * (0.1 + 0.9 * 0.01) * np.log(before.loss / after.loss)
    assert weighed.gains(before, after).sum() == pytest.approx(expected, rel=0.01)


def test_what_must_be_searched_and_what_happened_once_costs_more(search):
    search, _ = search
    plain, shaped = Term("coulomb_friction"), Term.of("dead_zone", {"width": 0.1})
    one, two = (Term.of("external_force", {"edges": edges}) for edges in (((1, 2),), ((1, 2), (3, 4))))
    prices = [search.price(terms) for terms in ((), (plain,), (shaped,), (one,), (two,))]
    assert prices[0] == 0.0
    assert prices == sorted(set(prices))
    assert search.price((plain, shaped)) == pytest.approx(prices[1] + prices[2])


def test_effects_of_the_model_cost_nothing(search):
    search, whole = search
    believed = replace(BELIEVED, effects={"coulomb_friction": {"level": 0.05}})
    knowing = posed({}, ("gravity",), believed, duration=4.0)
    assert knowing.price(knowing.base) == 0.0
    assert search.price(whole.terms) > search.price(search.refit.terms) == 0.0


@pytest.mark.parametrize(
    ("told", "hidden", "changed"), [(0.3, 0.3, 0.0), (0.1, 0.3, math.log(3.0)), (0.3, -0.3, math.inf)]
)
def test_what_a_fit_changes_of_what_the_model_told(told, hidden, changed):
    """A force that a fit takes away or turns round is changed more than by any factor."""
    model = replace(BELIEVED, effects={"constant_load": {"force": told}})
    search = posed({"constant_load": {"force": hidden}}, (), model)
    found = max(changes(search, search.refit))
    assert found == changed if math.isinf(changed) else found == pytest.approx(changed, abs=0.1)
