"""Passes over samples against NumPy's convolution and sines, compiled and not."""

import numpy as np
import pytest

from dsd_cli.signals.passes import COMPILED, every, mixed, passed, products, sine_and_cosine_of

WAYS = [pytest.param(COMPILED, id="compiled", marks=pytest.mark.skipif(COMPILED is None, reason="not compiled")), None]
RNG = np.random.default_rng(3)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize(("taps", "before"), [(1, 0), (3, 1), (4, 1), (25, 12), (33, 16), (32, 0), (41, 40)])
@pytest.mark.parametrize("samples", [1, 2, 15, 16, 17, 200, 2047, 2048, 2049, 7001])
def test_a_response_sees_the_ends_go_on_as_they_are(samples, taps, before, way):
    x, response = RNG.standard_normal(samples), RNG.standard_normal(taps)
    longer = np.concatenate([np.full(before, x[0]), x, np.full(taps - 1 - before, x[-1])])
    wanted = np.correlate(longer, response, mode="valid")
    np.testing.assert_allclose(passed(x, response, before, way), wanted, atol=1e-12)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("step", [1, 2, 3, 7, 48, 130])
@pytest.mark.parametrize("taps", [1, 37, 401])
@pytest.mark.parametrize("samples", [401, 1000, 30011])
def test_of_every_few_samples_one_value_is_made(step, taps, samples, way):
    x, response = RNG.standard_normal(samples), RNG.standard_normal(taps)
    wanted = np.correlate(x, response, mode="valid")[::step]
    np.testing.assert_allclose(every(x, response, step, len(wanted), way), wanted, atol=1e-11)
    assert every(x, response, step, 0, way).shape == (0,)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("most", [1.0, 9.9e5, 1e12])
def test_sines_and_cosines_of_near_and_far_angles(most, way):
    angle = np.concatenate([RNG.uniform(-most, most, 20001), np.arange(-60, 60) * np.pi / 4.0, [0.0, -0.0]])
    sine, cosine = sine_and_cosine_of(angle, way)
    np.testing.assert_allclose(sine, np.sin(angle), rtol=0.0, atol=3e-16)
    np.testing.assert_allclose(cosine, np.cos(angle), rtol=0.0, atol=3e-16)


@pytest.mark.parametrize("way", WAYS)
def test_a_strided_view_and_a_single_angle_are_angles(way):
    angles = RNG.standard_normal(300)[::3]
    np.testing.assert_allclose(sine_and_cosine_of(angles, way)[0], np.sin(angles), atol=3e-16)
    assert sine_and_cosine_of(0.0, way) == (0.0, 1.0)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("columns", [1, 2, 3, 5, 9, 40])
@pytest.mark.parametrize(("rows", "starts"), [(1, (0,)), (5, (0, 2, 2, 3)), (1030, (0,)), (3000, (4, 517, 519, 2999))])
def test_products_and_sums_of_segments(columns, rows, starts, way):
    x = RNG.standard_normal((columns, rows))
    weights = RNG.standard_normal((len(starts), columns))
    found, sums = products(list(x), starts, way), mixed(list(x), weights, starts, way)
    assert (sums[: starts[0]] == 0.0).all()
    for own, each, a, b in zip(found, weights, starts, [*starts[1:], rows], strict=True):
        np.testing.assert_allclose(own, x[:, a:b] @ x[:, a:b].T, atol=1e-11)
        np.testing.assert_allclose(sums[a:b], each @ x[:, a:b], atol=1e-12)


def test_one_set_of_weights_is_for_all_rows():
    np.testing.assert_allclose(mixed([np.arange(3.0), np.ones(3)], np.array([2.0, 1.0])), [1.0, 3.0, 5.0])


@pytest.mark.skipif(COMPILED is None, reason="not compiled")
def test_segments_beyond_the_rows_are_refused():
    for columns, edges in (((np.zeros(3), np.zeros(2)), [0, 2]), ((np.zeros(3),), [0, 4]), ((np.zeros(3),), [2, 1])):
        with pytest.raises(ValueError, match="columns of one length"):
            COMPILED.products(columns, np.array(edges), np.zeros((1, len(columns), len(columns))))
    with pytest.raises(ValueError, match="columns of one length"):
        COMPILED.mixed((np.zeros(3),), np.array([0, 3]), np.zeros(2), np.zeros(3))


@pytest.mark.skipif(COMPILED is None, reason="not compiled")
def test_the_compiled_passes_refuse_what_does_not_fit():
    for x, taps, step in ((np.zeros(0), np.zeros(3), 1), (np.zeros(3), np.zeros(0), 1), (np.zeros(3), np.zeros(1), 0)):
        with pytest.raises(ValueError, match="samples, taps"):
            COMPILED.passed(x, taps, 0, step, np.zeros(3))
    with pytest.raises(ValueError, match="one length"):
        COMPILED.sine_cosine(np.zeros(3), np.zeros(4), np.zeros(3))
