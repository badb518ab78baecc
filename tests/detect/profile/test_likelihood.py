"""The closed forms against a search over the plant's own two values, and against numpy's least squares."""

import numpy as np
import pytest

from dsd_cli.detect.profile.likelihood import Sums, fit

G, M = 8, 60


def window(seed: int, noise: float, delay: float = 3.4, alpha: float = 1.3) -> tuple[np.ndarray, np.ndarray]:
    """z of shape (M, G), linear between the delays, and y = alpha z(delay) + noise."""
    rng = np.random.default_rng(seed)
    u = np.convolve(rng.normal(size=M + G + 12), np.ones(6) / 6, "valid")
    z = np.column_stack([u[G - g : G - g + M] for g in range(G)])
    n = int(delay)
    f = delay - n
    return z, alpha * ((1 - f) * z[:, n] + f * z[:, n + 1]) + noise * rng.normal(size=M)


def sums_of(z: np.ndarray, y: np.ndarray) -> Sums:
    columns = [z[:, g] for g in range(G)]
    zz, zy = np.array([[[c @ c] for c in columns]]), np.array([[[c @ y] for c in columns]])
    adjacent = np.array([[[columns[g] @ columns[g + 1]] for g in range(G - 1)]])
    return Sums(np.array([y @ y]), np.array([float(M)]), zz, zy, adjacent)


def searched(z: np.ndarray, y: np.ndarray, alpha: float | None = None) -> tuple[float, float, float]:
    """(square, lag, alpha) of a fine search over the delay, alpha by the definition of least squares."""
    best = (np.inf, 0.0, 0.0)
    for lag in np.linspace(0, G - 1, 7001):
        n = min(int(lag), G - 2)
        regressor = z[:, n] + (lag - n) * (z[:, n + 1] - z[:, n])
        a = alpha if alpha is not None else max(float(np.linalg.lstsq(regressor[:, None], y, rcond=None)[0][0]), 0.0)
        square = float(((y - a * regressor) ** 2).sum())
        best = min(best, (square, float(lag), a))
    return best


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("known", [None, 1.3])
def test_the_best_delay_and_alpha_are_those_of_a_search(seed: int, known: float | None) -> None:
    z, y = window(seed, noise=0.1)
    found = fit(sums_of(z, y), rho=0.1, confidence=3.0, known_alpha=known)
    square, lag, alpha = searched(z, y, known)
    assert found.square[0] <= square + 1e-9
    assert found.square[0] == pytest.approx(square, abs=2e-3)
    assert found.lag[0] == pytest.approx(lag, abs=2e-3)
    assert found.alpha[0] == pytest.approx(alpha, abs=2e-3)


def test_without_noise_both_values_are_exact() -> None:
    z, y = window(0, noise=0.0)
    found = fit(sums_of(z, y), rho=0.1, confidence=3.0, known_alpha=None)
    assert found.lag[0] == pytest.approx(3.4, abs=1e-9)
    assert found.alpha[0] == pytest.approx(1.3, abs=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_standard_errors_are_those_of_least_squares_on_z_and_its_slope(seed: int) -> None:
    """The inverse of sigma^-2 [z a D]' [z a D], the textbook formula of nonlinear least squares."""
    z, y = window(seed, noise=0.05)
    found = fit(sums_of(z, y), rho=0.5, confidence=3.0, known_alpha=None)
    n = int(found.lag[0])
    slope = z[:, n + 1] - z[:, n]
    jacobian = np.column_stack([z[:, n] + (found.lag[0] - n) * slope, found.alpha[0] * slope])
    covariance = 0.5**2 * np.linalg.inv(jacobian.T @ jacobian)
    assert found.alpha_std[0] == pytest.approx(np.sqrt(covariance[0, 0]), rel=1e-6)
    assert found.lag_std[0] == pytest.approx(np.sqrt(covariance[1, 1]), rel=1e-6)


def test_a_rho_that_is_too_small_does_not_shrink_the_errors() -> None:
    z, y = window(1, noise=0.2)
    honest, bold = (fit(sums_of(z, y), rho, 3.0, None) for rho in (0.2, 0.001))
    assert bold.lag_std[0] == pytest.approx(honest.lag_std[0], rel=0.3)


def test_a_constant_u_tells_the_inertia_and_nothing_of_the_delay() -> None:
    rng = np.random.default_rng(3)
    z = np.ones((M, G))
    found = fit(sums_of(z, 1.5 * z[:, 0] + 0.01 * rng.normal(size=M)), 0.01, 3.0, None)
    assert found.lag_range[0][0] <= 0
    assert found.lag_range[1][0] >= G - 1
    low, high = found.alpha_range[0][0], found.alpha_range[1][0]
    assert low < 1.5 < high
    assert high - low < 0.02


def test_an_exponential_u_tells_neither() -> None:
    """u(t - L) is then a multiple of u(t): the paper's own problem, and here an infinite standard error."""
    t = np.arange(M)
    z = np.column_stack([np.exp(-0.05 * (t - g)) for g in range(G)])
    found = fit(sums_of(z, 1.3 * z[:, 3]), 0.01, 3.0, None)
    assert np.isinf(found.lag_std[0])
    assert np.isinf(found.alpha_std[0])
    assert found.lag_range[1][0] - found.lag_range[0][0] >= G - 1
    assert found.alpha_range[1][0] / found.alpha_range[0][0] > 1.3


def test_an_inverted_plant_is_no_plant() -> None:
    """y = -z would be a negative inertia: alpha is 0 and everything stays possible."""
    z, _ = window(2, noise=0.0)
    found = fit(sums_of(z, -z[:, 3]), 0.1, 3.0, None)
    assert found.alpha[0] >= 0.0
    assert found.square[0] > 1.0
