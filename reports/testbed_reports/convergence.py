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


def fit_order(size, error):
    """Least-squares slope of log(error) against log(size); both (K,). Points that are not positive are left out."""
    size, error = _usable(size, error)
    if len(np.unique(size)) < 2:
        return Order(np.nan, np.nan, np.nan, len(size))
    x, y = np.log(size), np.log(error)
    spread = np.sum((x - x.mean()) ** 2)
    slope = np.sum((x - x.mean()) * (y - y.mean())) / spread
    if len(x) < 3:
        return Order(float(slope), np.nan, np.nan, len(x))
    residual = y - y.mean() - slope * (x - x.mean())
    deviation = np.sqrt(np.sum(residual**2) / (len(x) - 2) / spread)
    half = stdtrit(len(x) - 2, 0.975) * deviation  # Student's t
    return Order(float(slope), float(slope - half), float(slope + half), len(x))


def pairwise_orders(size, error):
    """Order between each cell size and the one before, (K,); the first is nan."""
    size, error = np.asarray(size, float), np.asarray(error, float)
    orders = np.full(len(size), np.nan)
    with np.errstate(all="ignore"):
        orders[1:] = np.log(error[1:] / error[:-1]) / np.log(size[1:] / size[:-1])
    orders[~np.isfinite(orders)] = np.nan
    return orders
