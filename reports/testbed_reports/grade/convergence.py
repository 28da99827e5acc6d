"""Orders of convergence from errors on several cell sizes."""
from dataclasses import dataclass

import numpy as np
from scipy.special import stdtrit


@dataclass
class Order:
    """Fitted order with its 95 % interval (nan when fewer than 3 points leave none)."""
    order: float
    low: float
    high: float
    points: int

    def __str__(self):
        if not np.isfinite(self.order):
            return "no order"
        interval = f" [{self.low:.2f}, {self.high:.2f}]" if np.isfinite(self.low) else ""
        return f"{self.order:.2f}{interval}"


def _usable(size, error):
    size, error = np.asarray(size, float), np.asarray(error, float)
    good = np.isfinite(size) & np.isfinite(error) & (size > 0) & (error > 0)
    return size[good], error[good]


def _fit(size, value):
    """(slope, intercept, half widths of their 95 % intervals, points) of log(value) over log(size), both (K,); nan for what K is too
    few for. Points that are not positive are left out."""
    size, value = _usable(size, value)
    if len(np.unique(size)) < 2:
        return np.nan, np.nan, np.nan, np.nan, len(size)
    x, y = np.log(size), np.log(value)
    spread = np.sum((x - x.mean()) ** 2)
    slope = np.sum((x - x.mean()) * (y - y.mean())) / spread
    intercept = y.mean() - slope * x.mean()
    if len(x) < 3:
        return slope, intercept, np.nan, np.nan, len(x)
    deviation = np.sqrt(np.sum((y - intercept - slope * x) ** 2) / (len(x) - 2))
    student = stdtrit(len(x) - 2, 0.975)
    return (slope, intercept, student * deviation / np.sqrt(spread),
            student * deviation * np.sqrt(1.0 / len(x) + x.mean() ** 2 / spread), len(x))


def fit_order(size, error):
    """Least-squares slope of log(error) against log(size); both (K,). Points that are not positive are left out."""
    slope, _, half, _, points = _fit(size, error)
    return Order(float(slope), float(slope - half), float(slope + half), points)


@dataclass
class PowerLaw:
    """value = a L^q: the exponent, and the factor (the value at L = 1 m) with its 95 % interval."""
    q: Order
    a: float
    a_low: float
    a_high: float

    def __call__(self, size):
        return self.a * size**self.q.order


def fit_power(size, value):
    """Least squares of log(value) over log(size), both (K,), such as one pair per run."""
    _, intercept, _, half, _ = _fit(size, value)
    return PowerLaw(fit_order(size, value), *(float(np.exp(intercept + sign * half)) if sign else float(np.exp(intercept))
                                              for sign in (0, -1, 1)))


def pairwise_orders(size, error):
    """Order between each cell size and the one before, (K,); the first is nan."""
    size, error = np.asarray(size, float), np.asarray(error, float)
    orders = np.full(len(size), np.nan)
    with np.errstate(all="ignore"):
        orders[1:] = np.log(error[1:] / error[:-1]) / np.log(size[1:] / size[:-1])
    orders[~np.isfinite(orders)] = np.nan
    return orders
