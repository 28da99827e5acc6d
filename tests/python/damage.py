"""Damaged copies of result files: cut short, or with bits of a byte flipped. Most of the flips lie outside the arrays, where the library
reads what it must not trust."""
import h5py
import numpy as np


def _metadata(path):
    """Offsets of all bytes that are no array's."""
    free = np.ones(path.stat().st_size, bool)
    with h5py.File(path) as file:
        def mark(_, node):
            if isinstance(node, h5py.Dataset) and node.id.get_offset() is not None:
                free[node.id.get_offset():node.id.get_offset() + node.id.get_storage_size()] = False
        file.visititems(mark)
    return np.flatnonzero(free)


def damaged_copies(path, count, seed):
    """Yields (what was done, bytes), the same ones for a seed: of ten, one cut, two flips anywhere, seven outside the arrays."""
    random, whole, metadata = np.random.default_rng(seed), path.read_bytes(), _metadata(path)
    for n in range(count):
        if n % 10 == 0:
            size = int(random.integers(0, len(whole)))
            yield f"cut to {size} of {len(whole)} bytes", whole[:size]
            continue
        where = int(random.integers(0, len(whole)) if n % 10 < 3 else random.choice(metadata))
        mask = int(random.integers(1, 256)) if n % 2 else 1 << int(random.integers(0, 8))
        changed = bytearray(whole)
        changed[where] ^= mask
        yield f"byte {where} xor {mask}", bytes(changed)
