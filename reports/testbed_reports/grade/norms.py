"""Norms of fields sampled at points: volume weighted with the initial volume, in the plane.

s, s_exact: (N, 6) stress; u, u_exact: (N, 3) displacement; v: (N,) initial volume [m3 per m].
"""
import numpy as np

from ..read.results import TENSOR


def frobenius(s):
    """In-plane Frobenius norm per point, (N,): the shear component counts twice."""
    xx, xy, yy = (s[:, TENSOR[c]] for c in ("xx", "xy", "yy"))
    return np.sqrt(xx**2 + yy**2 + 2.0 * xy**2)


def length(u):
    """In-plane length per point, (N,)."""
    return np.hypot(u[:, 0], u[:, 1])


def l2(error, exact, v):
    """||error|| / ||exact|| of magnitudes per point (N,), weighted by volume."""
    return np.sqrt(np.sum(v * error**2) / np.sum(v * exact**2))


def linf(error, exact):
    """Largest error over the largest exact magnitude."""
    return np.max(error) / np.max(exact)


def rms(error, v):
    """Root of the volume mean of the squared magnitude, in the unit of `error`."""
    return np.sqrt(np.sum(v * error**2) / np.sum(v))


def l1_yy(s, s_exact, v, scale):
    """Volume mean of |error of the vertical stress| over `scale` [Pa] (the norm used for AMPLE's column)."""
    yy = TENSOR["yy"]
    return np.sum(np.abs(s[:, yy] - s_exact[:, yy]) * v) / (scale * np.sum(v))
