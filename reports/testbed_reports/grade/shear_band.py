"""Shear bands in a plastic shear strain that is known at points: their axes, and estimates of their width.

Initial positions are used throughout: sliding along a band maps its strip onto itself, so width and angle are the same as in
the deformed body as far as the blocks between the bands are rigid, while a crossing band is not cut and shifted, and the points
stand on a lattice on which linear interpolation is well conditioned.
"""
import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.integrate import trapezoid
from scipy.interpolate import LinearNDInterpolator
from scipy.stats import theilslopes

REACH = 1.5  # half length of a normal over the half-maximum width of the band
OUTER = 0.75  # beyond this share of the half length a normal shows the background
STRENGTH = 0.25  # a band's mean strain above the background, on its axis, over the 99th percentile of the strain
SLENDER = 2.0  # a band is more than so many times as long as wide: a bulge is none
SHORTER = (1.0, 0.7, 0.5, 0.35)  # normals to begin with: long ones leave the body or meet the other band
FEWEST = 8  # normals for an estimate
ESTIMATORS = ("std", "integral", "half_max")


@dataclass
class Band:
    """A straight band: points x with x . normal = offset [m]; `angle` [rad] of the axis from the horizontal.

    `normals`: strain above the background on the normals that the other bands do not touch, (S, K), at distances `d` (K,) [m];
    not `clear` when there were too few of them, and the clearest were taken.
    """
    angle: float
    offset: float
    half: float
    width: float = math.nan
    strength: float = 0.0
    clear: bool = True
    d: np.ndarray = None
    normals: np.ndarray = None

    @property
    def tangent(self):
        return np.array([math.cos(self.angle), math.sin(self.angle)])

    @property
    def normal(self):
        return np.array([-math.sin(self.angle), math.cos(self.angle)])

    @property
    def inclination(self):
        """From the horizontal, 0 to 90 degrees."""
        folded = abs(math.degrees(self.angle)) % 180.0
        return min(folded, 180.0 - folded)

    def distance(self, x):
        """Signed distance (...,) of x (..., 2) from the axis."""
        return x @ self.normal - self.offset


def half_max_width(d, strain):
    """Full width at half maximum of a profile (K,) over d (K,): from the top outwards to the first crossing on each side."""
    top = int(np.argmax(strain))
    level, ends = 0.5 * strain[top], []
    for way in (strain[top::-1], strain[top:]):
        below = np.flatnonzero(way < level)
        if not len(below):
            ends.append(len(way) - 1.0)
            continue
        k = below[0]
        ends.append(k - 1 + (way[k - 1] - level) / (way[k - 1] - way[k]))
    at = np.interp([top - ends[0], top + ends[1]], np.arange(len(d)), d)
    return at[1] - at[0]


def estimate_widths(d, strain):
    """{estimator: width} of a profile (K,) of strain above the background over d (K,), equally spaced.

    std: sqrt(12) standard deviations, integral: integral over maximum, half_max: full width at half maximum. A band of uniform
    strain and width w gives w thrice, 1 + cos gives (0.626, 0.5, 0.5) w, a triangle (0.707, 0.5, 0.5) w.
    """
    total = trapezoid(strain, d)
    if not total > 0:
        return dict.fromkeys(ESTIMATORS, math.nan)
    centre = trapezoid(strain * d, d) / total
    variance = trapezoid(strain * (d - centre) ** 2, d) / total
    return {"std": math.sqrt(12.0 * variance), "integral": total / strain.max(), "half_max": half_max_width(d, strain)}


def _search(x, strain, volume, spacing, degrees=range(-89, 91)):
    """The strip with the largest integral of strain above the median over the root of its width: a matched filter on the Radon
    transform over the angles, which is sharpest when the strip has angle, place and width of a band."""
    order = np.argsort(strain)
    weight = np.cumsum(volume[order])
    excess = (strain - strain[order][np.searchsorted(weight, 0.5 * weight[-1])]) * volume
    best = (-math.inf, None)
    for angle in np.radians(degrees):
        across = x @ np.array([-math.sin(angle), math.cos(angle)])
        lowest = across.min()
        sums = np.concatenate([[0.0], np.cumsum(np.bincount(((across - lowest) / spacing).astype(int), excess))])
        for wide in np.unique(np.geomspace(2, max(2, len(sums) // 3), 12).astype(int)):  # spacings
            score = (sums[wide:] - sums[:-wide]) / math.sqrt(wide)
            top = int(np.argmax(score)) if len(score) else 0
            if len(score) and score[top] > best[0]:
                best = (score[top], angle, lowest + (top + 0.5 * wide) * spacing, wide * spacing)
    return Band(best[1], best[2], max(REACH * best[3], 3.0 * spacing), best[3])


def _sample(field, x, band, spacing, others):
    """(s, d, strain above the background (S, K), whether all are clear) on the normals of a band that stay inside the body and clear of
    the other bands by their width; of the clearest when those are too few."""
    along = x @ band.tangent
    s = np.arange(along.min(), along.max(), 0.5 * spacing)
    d = np.linspace(-band.half, band.half, 2 * max(8, math.ceil(4.0 * band.half / spacing)) + 1)
    at = band.offset * band.normal + s[:, None, None] * band.tangent + d[None, :, None] * band.normal
    strain = field(at)
    inside = np.isfinite(strain).all(axis=1)
    clearance = np.full(len(s), math.inf)
    for other in others:
        clearance = np.minimum(clearance, np.abs(other.distance(at)).min(axis=1) / other.width)
    clearance[~inside] = -1.0
    use = np.flatnonzero(clearance > 1.0)
    clear = len(use) >= FEWEST
    if not clear:
        use = np.sort(np.argsort(clearance)[::-1][:min(FEWEST, inside.sum())])
    background = strain[use][:, np.abs(d) >= OUTER * band.half].mean(axis=1)
    return s[use], d, np.clip(strain[use] - background[:, None], 0.0, None), clear


def _measure(field, x, band, spacing, others):
    """The band with the normals, the width and the strength that its axis has, None when it has too few normals; and where they stand
    (S,) [m]."""
    s, d, excess, clear = _sample(field, x, band, spacing, others)
    total, top = excess.sum(axis=1), excess.max(axis=1)
    good = (total > 0) & (top > 0.3 * np.median(top)) if len(top) else np.zeros(0, bool)
    if good.sum() < FEWEST:
        return None, s
    width = half_max_width(d, np.median(excess[good], axis=0))
    strength = float(excess[:, np.abs(d) <= 0.5 * spacing].mean())
    return replace(band, width=width, strength=strength, clear=clear, d=d, normals=excess[good]), s[good]


def _turn(field, x, band, spacing, others):
    """The band with its axis through the centroids of its normals; None when it has no clear normals on the way there."""
    for _ in range(5):
        found, s = _measure(field, x, band, spacing, others)
        if found is None or not found.clear:
            return None
        slope, shift, *_ = theilslopes(found.normals @ found.d / found.normals.sum(axis=1), s)
        axis = band.tangent + slope * band.normal
        turned = Band(math.atan2(axis[1], axis[0]), 0.0, max(REACH * found.width, 3.0 * spacing), found.width)
        band = replace(turned, offset=float(((band.offset + shift) * band.normal) @ turned.normal))
    return _measure(field, x, band, spacing, others)[0]


def _trace_all(field, x, bands, spacing):
    """The bands traced where the others do not disturb, twice, from normals of several lengths, of which those count on whose axis the
    strain stands out most. A band without clear normals keeps the axis that was sought; one without normals is left out."""
    for _ in range(2):
        traced = []
        for band in bands:
            others = [b for b in bands if b is not band]
            starts = [replace(band, half=shorter * band.half) for shorter in SHORTER]
            found = [b for b in (_turn(field, x, start, spacing, others) for start in starts) if b is not None]
            found = found or [b for b, _ in (_measure(field, x, start, spacing, others) for start in starts) if b is not None]
            traced.append(max(found, key=lambda b: b.strength, default=None))
        bands = [band for band in traced if band is not None]
    return bands


def _length(x, strain, band, spacing):
    """Of the axis [m], as far as the strain exceeds half the band's."""
    on_axis = (np.abs(band.distance(x)) < spacing) & (strain > np.median(strain) + 0.5 * band.strength)
    along = x[on_axis] @ band.tangent
    return np.ptp(along) if len(along) else 0.0


def _remains(field, x, band, spacing, other, least):
    """Whether a band without clear normals still exceeds `least` after the mean normal of the other one is taken out of the strain."""
    profile = other.normals.mean(axis=0)
    rest, _ = _measure(lambda at: field(at) - np.interp(other.distance(at), other.d, profile, 0.0, 0.0), x, band, spacing, [other])
    return rest is not None and rest.strength > least


def find_bands(x, strain, volume, spacing, most=2, share=STRENGTH):
    """Up to `most` (1 or 2) bands, the strongest first. x (N, 2) initial positions, strain (N,), volume (N,), spacing of points [m].

    The second band is sought among the strips that lean to the other side, as conjugate bands do, which may cross the first one; if
    there is none, outside the strip of the first. A band counts when it is slender and its mean strain above the background, on its axis,
    exceeds `share` of the 99th percentile of the strain. A body of a few points, or in which nothing varies, has none.
    """
    if len(x) < FEWEST or np.ptp(x, axis=0).min() < spacing:
        return []
    field, least = LinearNDInterpolator(x, strain), share * np.percentile(strain, 99)

    def strong(bands):
        found = [b for b in _trace_all(field, x, bands, spacing) if b.strength > least and _length(x, strain, b, spacing) > SLENDER * b.width]
        return sorted(found, key=lambda b: -b.strength)

    first = _search(x, strain, volume, spacing)
    if most == 1:
        return strong([first])
    conjugate = strong([first, _search(x, strain, volume, spacing, range(-89, 0) if first.angle > 0 else range(1, 90))])
    if len(conjugate) == 2 and (conjugate[1].clear or _remains(field, x, conjugate[1], spacing, conjugate[0], least)):
        return conjugate
    first = conjugate[0] if conjugate else first
    free = np.abs(first.distance(x)) > max(1.5 * first.width, 3.0 * spacing)
    return strong([first, _search(x[free], strain[free], volume[free], spacing)] if free.sum() >= 10 else [first])


def widths(band):
    """{estimator: median over the normals of a band} [m]."""
    found = [estimate_widths(band.d, normal) for normal in band.normals]
    return {name: float(np.median([w[name] for w in found])) for name in ESTIMATORS}
