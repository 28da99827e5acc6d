#!/usr/bin/python3
"""Runs every scene of benchmarks/ on every particle method with two builds, and compares the result files bit by bit.

    tests/same_bits.py OTHER/build/bin/testbed build/bin/testbed [--steps 200] [--threads 1 2] [--scenes REGEX]

A run goes over the first steps of its scene, so that all of them take minutes. What tells of time, machine and build is not compared, nor the text of the scene, to which keys may be added.
Exit 1 if a dataset or attribute differs.
"""
import argparse
import re
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import h5py
import numpy as np

ROOT = Path(__file__).resolve().parents[1]
METHODS = ("lpfdm-2000", "lpfdm", "mpm-linear", "mpm-linear-bbar", "mpm-bspline", "mpm-cpgimp")
OTHERWISE = re.compile(r"/provenance|/scene/resolved|/performance/.*(_s|phases.*|per_second|bytes.*)$|checksum")


def contents(path):
    """Name -> value of everything that two builds should agree on."""
    found = {}

    def take(name, node):
        for key, value in node.attrs.items():
            found[f"/{name.strip('/')}@{key}"] = np.asarray(value).tobytes() if isinstance(value, np.ndarray) else repr(value)
        if isinstance(node, h5py.Dataset):
            found["/" + name] = node.dtype.str, node.shape, node[()].tobytes()

    with h5py.File(path, "r") as file:
        take("", file)
        file.visititems(take)
    return {k: v for k, v in found.items() if not OTHERWISE.search(k.replace("@", "/"))}


def first_steps(binary, scene, method, steps):
    """The end [s] of that many steps; None where the scene does not take this method."""
    told = subprocess.run([binary, "check", scene, "--method", method], capture_output=True, text=True, check=False).stdout
    step = re.search(r"^time step\s+(\S+) s, (\d+) steps", told, re.M)
    return None if not step else float(step[1]) * min(steps, int(step[2]))


def compare(job, options):
    """'' or what differs."""
    scene, method, threads = job
    end = first_steps(options.binaries[0], scene, method, options.steps)
    if end is None:
        return "is not taken"
    with tempfile.TemporaryDirectory() as folder:
        results = []
        for number, binary in enumerate(options.binaries):
            output = Path(folder) / f"{number}.h5"
            subprocess.run([binary, "run", scene, "--method", method, "--threads", str(threads), "--set", f"time.end={end!r}", "--quiet", "-o", output],
                           capture_output=True, check=False)
            results.append(contents(output) if output.is_file() else {})
    names = results[0].keys() | results[1].keys()
    other = sorted(n for n in names if results[0].get(n) != results[1].get(n))
    return "no result" if not names else f"{len(other)} of {len(names)} differ: {', '.join(other[:4])}" if other else ""


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("binaries", nargs=2)
    parser.add_argument("--steps", type=int, default=200)
    parser.add_argument("--threads", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--scenes", default="")
    parser.add_argument("-j", "--jobs", type=int, default=2)
    options = parser.parse_args()
    scenes = [str(p) for p in sorted(ROOT.glob("benchmarks/**/scene*.toml")) if re.search(options.scenes, str(p))]
    jobs = [(scene, method, threads) for scene in scenes for method in METHODS for threads in options.threads]
    with ThreadPoolExecutor(options.jobs) as pool:
        told = list(pool.map(lambda job: compare(job, options), jobs))
    for (scene, method, threads), text in zip(jobs, told):
        if text:
            print(f"{Path(scene).relative_to(ROOT)} {method} {threads}: {text}")
    same = sum(not text for text in told)
    print(f"{same} of {len(jobs)} runs have the same bits")
    return 0 if same == sum(text != "is not taken" for text in told) else 1


if __name__ == "__main__":
    sys.exit(main())
