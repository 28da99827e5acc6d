"""Where a scene puts its material points, as core/scene/geometry.cpp does: centres of the squares of a pattern that lie in a body."""
import numpy as np


def _in_polygon(vertices, x, y):
    inside = np.zeros(len(x), bool)
    for (ax, ay), (bx, by) in zip(vertices, [vertices[-1], *vertices[:-1]]):
        if ay != by:
            inside ^= ((ay > y) != (by > y)) & (x < ax + (y - ay) / (by - ay) * (bx - ax))
    return inside


def _contains(body, x, y):
    if body["shape"] == "box":
        (left, low), (right, high) = body["min"], body["max"]
        return (x >= left) & (x <= right) & (y >= low) & (y <= high)
    if body["shape"] == "disk":
        return np.hypot(x - body["center"][0], y - body["center"][1]) <= body["radius"]
    if body["shape"] == "polygon":
        return _in_polygon(body["vertices"], x, y)
    raise ValueError(body["shape"])


def _fill(body, bodies, grid):
    host = next(b for b in bodies if b["name"] == body["inside"]) if body.get("inside") else body
    h = grid["cell_size"] / host["points_per_cell"]
    corner, size = (host["min"], np.subtract(host["max"], host["min"])) if host["shape"] == "box" else (grid["origin"], grid["size"])
    x, y = (a.ravel() for a in np.meshgrid(*(corner[k] + (np.arange(round(size[k] / h)) + 0.5) * h for k in (0, 1))))
    kept = _contains(host, x, y) & _contains(body, x, y)
    for other in bodies:
        if not body.get("inside") and other.get("inside") == host["name"]:
            kept &= ~_contains(other, x, y)
    return np.column_stack([x[kept], y[kept], np.full(kept.sum(), h * h)])


MOST = 5_000_000  # squares of a pattern, beyond which it is not made to be compared with


def sampling(resolved):
    """(N, 3): x, y and volume of the points of a resolved scene; None where it does not tell, or is too large to look at."""
    try:
        bodies, grid = resolved["body"], resolved["grid"]
        squares = sum(np.prod(grid["size"]) * (body["points_per_cell"] / grid["cell_size"]) ** 2 for body in bodies)
        return np.concatenate([_fill(body, bodies, grid) for body in bodies]) if 0 < squares <= MOST else None
    except (KeyError, TypeError, ValueError, IndexError, StopIteration, ZeroDivisionError, OverflowError):
        return None
