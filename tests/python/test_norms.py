"""Norms against values worked out by hand."""
import numpy as np
import pytest
from testbed_reports.grade import norms

S = np.zeros((2, 6))
S[0, [0, 1, 3]] = 3.0, 2.0, 4.0
S[1, [2, 4, 5]] = 7.0, 8.0, 9.0  # out of the plane: not counted


def test_frobenius_counts_shear_twice_and_stays_in_the_plane():
    assert norms.frobenius(S) == pytest.approx([np.sqrt(9 + 16 + 2 * 4), 0.0])


def test_length_is_in_the_plane():
    assert norms.length(np.array([[3.0, 4.0, 12.0]])) == pytest.approx([5.0])


def test_l2_weights_with_volume():
    assert norms.l2(np.array([1.0, 2.0]), np.array([2.0, 1.0]), np.array([3.0, 1.0])) == pytest.approx(np.sqrt(7 / 13))


def test_linf():
    assert norms.linf(np.array([1.0, 3.0]), np.array([4.0, 2.0])) == pytest.approx(0.75)


def test_rms():
    assert norms.rms(np.array([1.0, 3.0]), np.array([3.0, 1.0])) == pytest.approx(np.sqrt(12 / 4))


def test_l1_yy():
    s, exact = np.zeros((2, 6)), np.zeros((2, 6))
    s[:, 3], exact[:, 3] = (-1.0, -5.0), (-2.0, -3.0)
    s[:, 0] = 100.0
    assert norms.l1_yy(s, exact, np.array([1.0, 3.0]), 10.0) == pytest.approx((1 + 3 * 2) / (10 * 4))
