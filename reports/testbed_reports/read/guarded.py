"""Opening a result file without harm: the HDF5 library crashes, hangs, asks for all memory or spoils that of the program on some damaged files.

The programs of the testbed end a file with its CRC-32. Where that holds, the file is as it was written, and is opened. A file without it, of
another code, is read by a child process with limits of time and memory; what the child hands over is made a file in memory, so that the library
never meets the damaged one in this process."""
import contextlib
import faulthandler
import itertools
import mmap
import os
import pickle
import re
import resource
import signal
import zlib
from pathlib import Path

import h5py
import numpy as np

TRAILER = re.compile(rb"testbed-crc32 ([0-9a-f]{8}) ([0-9a-f]{16})\n")
TRAILER_SIZE = 40
SECONDS, BYTES_PER_SECOND = 20, 20e6  # of computing for a file, and more for a large one
SPARE_MEMORY = 2 << 30

MOST_BYTES, MOST_FILES = 512 << 20, 200  # of such files that are kept: each takes memory of the library, too

_good = set()  # files with a checksum that holds
_number = itertools.count()  # names of the copies, of which many may be open
_copies = {}  # of files without a checksum: an open file in memory, or a DamagedError


class DamagedError(Exception):
    """Why a file must not be read."""


@contextlib.contextmanager
def open_file(path):
    """The HDF5 file, open for reading. Raises DamagedError when it cannot be read, OSError when there is none."""
    path = Path(path)
    status = path.stat()
    if not path.is_file():
        raise DamagedError("is no file")
    if _has_good_checksum(path, status.st_size):
        with h5py.File(path, "r") as file:
            yield file
        return
    key = (str(path.resolve()), status.st_ino, status.st_size, status.st_mtime_ns)
    if key not in _copies:
        _forget_others(key)
        try:
            _copies[key] = _copy_by_child(path, status.st_size)
        except DamagedError as error:
            _copies[key] = error
    if isinstance(_copies[key], DamagedError):
        raise _copies[key]
    yield _copies[key]


def _forget_others(key):
    """Makes room for a file, and forgets what stood at its place before."""
    for old in [k for k in _copies if k[0] == key[0]]:
        del _copies[old]  # h5py closes what nobody holds
    if key[2] + sum(k[2] for k in _copies) > MOST_BYTES or len(_copies) >= MOST_FILES:
        _copies.clear()


def has_checksum(path):
    """Whether a file is as a program of the testbed wrote it. Raises DamagedError when it was changed since."""
    return _has_good_checksum(Path(path), Path(path).stat().st_size)


def _has_good_checksum(path, size):
    """Whether a file ends with its checksum. Raises DamagedError when with another one."""
    status = path.stat()
    key = (str(path.resolve()), status.st_ino, status.st_size, status.st_mtime_ns)
    if key in _good:
        return True
    if size <= TRAILER_SIZE:
        return False
    with open(path, "rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        trailer = TRAILER.fullmatch(data[-TRAILER_SIZE:])
        if trailer and (int(trailer[2], 16) != size - TRAILER_SIZE or int(trailer[1], 16) != _crc(data, size - TRAILER_SIZE)):
            raise DamagedError("is damaged: its checksum is not that of its contents")
    if trailer:
        _good.add(key)
    return trailer is not None


def _crc(data, size):
    value, step = 0, 1 << 20
    for begin in range(0, size, step):
        value = zlib.crc32(data[begin:min(begin + step, size)], value)
    return value


def plain(value):
    """An HDF5 attribute as a plain Python value."""
    if isinstance(value, bytes):
        return value.decode()
    if isinstance(value, np.ndarray):
        return [plain(v) for v in value.ravel()] if value.size != 1 else plain(value.ravel()[0])
    return value.item() if isinstance(value, np.generic) else value


def _read_all(path):
    """Every group and every array of numbers of a file: name -> (attributes, array or None), groups before what they hold."""
    found, seen = {}, set()
    with h5py.File(path, "r") as file:
        if "checksum" in file.attrs:
            raise DamagedError("is damaged: its checksum is missing at its end (truncated, or changed after the run)")

        def visit(name, node):
            attributes = {key: plain(node.attrs[key]) for key in node.attrs}
            if isinstance(node, h5py.Dataset):
                if node.dtype.kind in "biuf":
                    found[name] = attributes, node[()]
                return
            address = h5py.h5o.get_info(node.id).addr
            if address in seen:
                raise DamagedError(f"is refused: the group '{name}' is there twice")
            seen.add(address)
            found[name] = attributes, None
            for key in node:
                if not isinstance(node.get(key, getlink=True), h5py.HardLink):
                    raise DamagedError(f"is refused: '{key}' is a link to elsewhere")
                if isinstance(node[key], (h5py.Group, h5py.Dataset)):
                    visit(f"{name.rstrip('/')}/{key}", node[key])

        visit("/", file)
    return found


def _in_memory(found):
    """A file in memory that holds what another one does."""
    file = h5py.File.in_memory() if hasattr(h5py.File, "in_memory") else h5py.File(f"copy {next(_number)}", "w", driver="core", backing_store=False)
    for name, (attributes, array) in found.items():
        node = file if name == "/" else file.create_group(name) if array is None else file.create_dataset(name, data=array)
        for key, value in attributes.items():
            node.attrs[key] = value
    return file


def _limit(size):
    """In the child: neither for ever, nor all the memory, nor a core file."""
    faulthandler.disable()
    seconds = int(SECONDS + size / BYTES_PER_SECOND)
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 1))
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    signal.alarm(60 * seconds)  # a busy machine or a slow disk is no fault of the file
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + SPARE_MEMORY + 4 * size,) * 2)


def _copy_by_child(path, size):
    """A file in memory with the contents of another one. Raises DamagedError."""
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:  # no exception may leave this branch
        code = 1
        try:
            os.close(reading)
            null = os.open(os.devnull, os.O_WRONLY)
            os.dup2(null, 1)
            os.dup2(null, 2)  # what a crashing library says
            _limit(size)
            with os.fdopen(writing, "wb") as pipe:
                try:
                    pipe.write(pickle.dumps(_read_all(path), protocol=5))
                    code = 0
                except Exception as error:
                    told = str(error) if isinstance(error, DamagedError) else f"cannot be read: {type(error).__name__}: {error}"
                    pipe.write(" ".join(told.split()).encode(errors="replace")[:500])
        finally:
            os._exit(code)
    os.close(writing)
    with os.fdopen(reading, "rb") as pipe:
        handed_over = pipe.read()
    _, status = os.waitpid(child, 0)
    if os.WIFSIGNALED(status):
        number = os.WTERMSIG(status)
        if number in (signal.SIGALRM, signal.SIGXCPU):
            raise DamagedError("is damaged: reading it takes for ever")
        raise DamagedError(f"is damaged: the HDF5 library crashes on it ({signal.Signals(number).name})")
    if os.WEXITSTATUS(status) != 0:
        raise DamagedError(handed_over.decode(errors="replace") or "cannot be read")
    try:
        return _in_memory(pickle.loads(handed_over))
    except Exception as error:  # names and values that this version of the library does not write
        raise DamagedError(f"cannot be read: {type(error).__name__}: {error}") from error
