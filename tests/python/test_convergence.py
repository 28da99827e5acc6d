"""Orders of convergence."""
import numpy as np
import pytest
from testbed_reports.grade.convergence import fit_order, fit_power, pairwise_orders

L = np.array([2.0, 1.0, 0.5, 0.25])


@pytest.mark.parametrize("order", [1.0, 2.0, -1.0])
def test_exact_orders(order):
    fit = fit_order(L, 0.3 * L**order)
    assert fit.order == pytest.approx(order)
    assert (fit.low, fit.high) == pytest.approx((order, order))
    assert pairwise_orders(L, 0.3 * L**order)[1:] == pytest.approx([order] * 3)


def test_interval_is_the_classical_one():
    noise = np.array([0.1, -0.05, 0.02, -0.07])
    fit = fit_order(L, np.exp(noise) * L**2)
    x, y = np.log(L), np.log(L**2) + noise
    A = np.c_[x, np.ones(4)]
    coefficient, residual, *_ = np.linalg.lstsq(A, y, rcond=None)
    deviation = np.sqrt(residual[0] / 2 / np.sum((x - x.mean()) ** 2))
    half = 4.30265 * deviation  # Student's t, 2 degrees of freedom
    assert fit.order == pytest.approx(coefficient[0])
    assert (fit.low, fit.high) == pytest.approx((coefficient[0] - half, coefficient[0] + half), rel=1e-5)


def test_two_points_have_no_interval_and_one_no_order():
    fit = fit_order(L[:2], L[:2] ** 2)
    assert fit.order == pytest.approx(2) and np.isnan(fit.low) and str(fit) == "2.00"
    assert np.isnan(fit_order([1.0], [1.0]).order)


def test_nan_is_left_out():
    assert fit_order(L, [4, 1, np.nan, 0.0625]).order == pytest.approx(2)
    assert np.isnan(pairwise_orders(L, [4, 1, np.nan, 1])[2:]).all()


def test_a_power_law_has_factor_and_exponent():
    law = fit_power(L, 1.7 * L**0.8)
    assert (law.a, law.a_low, law.a_high) == pytest.approx((1.7, 1.7, 1.7)) and law.q.order == pytest.approx(0.8)
    assert law(0.3) == pytest.approx(1.7 * 0.3**0.8)
    assert np.isnan(fit_power(L[:2], L[:2]).a_low) and np.isnan(fit_power(L[:1], L[:1]).a)


def test_interval_of_the_factor_is_the_classical_one():
    noise = np.array([0.1, -0.05, 0.02, -0.07])
    law = fit_power(3 * L, np.exp(noise) * L**2)
    A = np.c_[np.ones(4), np.log(3 * L)]
    coefficient, residual, *_ = np.linalg.lstsq(A, np.log(L**2) + noise, rcond=None)
    half = 4.30265 * np.sqrt(residual[0] / 2 * np.linalg.inv(A.T @ A)[0, 0])
    assert np.log([law.a, law.a_low, law.a_high]) == pytest.approx(coefficient[0] + half * np.array([0, -1, 1]), rel=1e-5)
