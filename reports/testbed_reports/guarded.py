"""Whether a result file is whole, found out without harm: the HDF5 library crashes, hangs or asks for all memory on some damaged files.

The programs of the testbed end a file with its CRC-32. Where that holds, the file is as it was written. A file without it, of another code,
is read once, all of it, in a child process with limits of time and memory; what a child has read this process can read."""
import faulthandler
import mmap
import os
import re
import resource
import signal
import zlib
from pathlib import Path

import h5py

TRAILER = re.compile(rb"testbed-crc32 ([0-9a-f]{8}) ([0-9a-f]{16})\n")
TRAILER_SIZE = 40
SECONDS, BYTES_PER_SECOND = 20, 20e6  # of computing for a file, and more for a large one
SPARE_MEMORY = 2 << 30

_verdicts = {}


class DamagedError(Exception):
    """Why a file must not be read."""


def ensure_readable(path):
    """Raises DamagedError unless the HDF5 file can be read, OSError when there is none. A verdict holds as long as the file does not change."""
    path = Path(path)
    status = path.stat()
    key = (str(path.resolve()), status.st_ino, status.st_size, status.st_mtime_ns)
    if key not in _verdicts:
        _verdicts[key] = _judge(path, status.st_size)
    if _verdicts[key]:
        raise DamagedError(_verdicts[key])


def _judge(path, size):
    """What is wrong with a file, '' when nothing is."""
    if not path.is_file():
        return "is no file"
    trailer = None
    if size > TRAILER_SIZE:
        with open(path, "rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
            trailer = TRAILER.fullmatch(data[-TRAILER_SIZE:])
            if trailer and (int(trailer[2], 16) != size - TRAILER_SIZE or int(trailer[1], 16) != _crc(data, size - TRAILER_SIZE)):
                return "is damaged: its checksum is not that of its contents"
    return "" if trailer else _try_in_child(path, size)


def _crc(data, size):
    value, step = 0, 1 << 20
    for begin in range(0, size, step):
        value = zlib.crc32(data[begin:min(begin + step, size)], value)
    return value


def _read_all(path):
    """Reads every attribute and every dataset of a file."""
    with h5py.File(path, "r") as file:
        if "checksum" in file.attrs:
            raise DamagedError("is damaged: its checksum is missing at its end (truncated, or changed after the run)")

        def visit(node):
            for name in node.attrs:
                node.attrs[name]
            if isinstance(node, h5py.Dataset):
                node[()]
            for name in node if isinstance(node, h5py.Group) else ():
                if not isinstance(node.get(name, getlink=True), h5py.HardLink):
                    raise DamagedError(f"is refused: '{name}' is a link to elsewhere")
                address = h5py.h5o.get_info(node[name].id).addr
                if address not in seen:
                    seen.add(address)
                    visit(node[name])
                elif isinstance(node[name], h5py.Group):
                    raise DamagedError(f"is refused: the group '{name}' is there twice")

        seen = {h5py.h5o.get_info(file.id).addr}
        visit(file)


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


def _try_in_child(path, size):
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
            _read_all(path)
            code = 0
        except BaseException as error:
            told = str(error) if isinstance(error, DamagedError) else f"cannot be read: {type(error).__name__}: {error}"
            os.write(writing, told.encode(errors="replace")[:500])
        finally:
            os._exit(code)
    os.close(writing)
    with os.fdopen(reading, "rb") as pipe:
        told = pipe.read().decode(errors="replace")
    _, status = os.waitpid(child, 0)
    if os.WIFSIGNALED(status):
        number = os.WTERMSIG(status)
        if number in (signal.SIGALRM, signal.SIGXCPU):
            return "is damaged: reading it takes for ever"
        return f"is damaged: the HDF5 library crashes on it ({signal.Signals(number).name})"
    return "" if os.WEXITSTATUS(status) == 0 else " ".join(told.split()) or "cannot be read"
