#!/usr/bin/python3
"""Mutation run: does a test notice when a single slip (slips.toml) is in the code?

Copies the sources to FOLDER/src, puts all slips in, builds once, and runs the tests once without a slip, to learn which come by which one.
Then, for each slip, runs the tests that come by it, the quickest first, until one fails. The result stands in FOLDER/results.json; slips that
were killed there are not run again. Exit 1 if fewer than 95 % are killed, or a slip survives of which slips.toml does not say why.
"""
import argparse
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

sys.dont_write_bytecode = True
from slips import HERE, ROOT, put_in, read_slips  # noqa: E402

SHARE = 0.95


@dataclass
class Test:
    """A command that fails or not; `seconds` and `reached` are known after a run without a slip."""
    name: str
    command: list
    env: dict
    last: bool = False  # run after all others: long, and comes by everything
    seconds: float = 0.0
    reached: set = field(default_factory=set)

    def run(self, env, limit):
        """0 or why it failed."""
        try:
            done = subprocess.run(self.command, env={**os.environ, **self.env, **env, "OMP_NUM_THREADS": "1"}, timeout=limit,
                                  stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        except subprocess.TimeoutExpired:
            return "ran for ever"
        return done.returncode


def copy_sources(to):
    """The files that git knows of; those that did not change keep their time, so that little is built again."""
    slips, kept = read_slips(), to.parent / "with_slips"
    shutil.rmtree(kept, ignore_errors=True)
    names = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, check=True, capture_output=True, text=True).stdout.split("\0")
    for name in filter(None, names):
        if (ROOT / name).is_file():
            (kept / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, kept / name)
    put_in(slips, kept)
    shutil.copy(HERE / "_slip.py", kept / "reports/testbed_reports/_slip.py")
    shutil.copy(HERE / "slip.hpp", kept / "slip.hpp")
    for path in sorted(kept.rglob("*")):
        other = to / path.relative_to(kept)
        if path.is_file() and not (other.is_file() and other.read_bytes() == path.read_bytes()):
            other.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(path, other)
    shutil.rmtree(kept)
    return slips


def build(source, folder, jobs):
    # with switches between them the compiler would join products and sums otherwise here and there: bits that should be the same were not
    flags = f"-include {source}/slip.hpp -ffp-contract=off"
    subprocess.run(["cmake", "-S", source, "-B", folder, "-G", "Ninja", f"-DCMAKE_CXX_FLAGS={flags}"], check=True,
                   stdout=subprocess.DEVNULL)
    subprocess.run(["cmake", "--build", folder, "-j", str(jobs)], check=True, stdout=subprocess.DEVNULL)


def find_tests(folder):
    """Those of ctest, but for the one that asks whether slips still fit."""
    told = json.loads(subprocess.run(["ctest", "--show-only=json-v1"], cwd=folder, check=True, capture_output=True, text=True).stdout)
    tests = []
    for test in told["tests"]:
        env = next((p["value"] for p in test.get("properties", []) if p["name"] == "ENVIRONMENT"), [])
        env = dict(item.split("=", 1) for item in env)
        if test["name"] != "python_slips":
            command = test["command"] + (["-x"] if test["name"].startswith("python_") else [])
            tests.append(Test(test["name"], command, env, last=test["name"] == "stability_coarse"))
    return tests


def learn(test):
    """Runs a test without a slip. Returns whether it passes."""
    with tempfile.TemporaryDirectory() as folder:
        start = time.monotonic()
        failed = test.run({"TESTBED_SLIP_REACHED": folder}, 3600)
        test.seconds = time.monotonic() - start
        for path in Path(folder).iterdir():
            test.reached.update(map(int, path.read_text().split()))
    return not failed


def hunt(slip, tests):
    """The test that notices a slip, '' if none does."""
    able = sorted((t for t in tests if slip.number in t.reached), key=lambda t: (t.last, t.seconds))
    for test in able:
        if test.run({"TESTBED_SLIP": str(slip.number)}, 30 + 10 * test.seconds):
            return test.name
    return "" if able else None


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("-j", "--jobs", type=int, default=os.cpu_count())
    parser.add_argument("--tests", default="", help="only tests whose name this regular expression finds")
    parser.add_argument("--files", default="", help="only slips in files whose name this regular expression finds")
    parser.add_argument("--slips", type=int, nargs="+", help="only slips of these numbers")
    options = parser.parse_args()
    signal.signal(signal.SIGINT, signal.default_int_handler)  # some tests interrupt a run; a shell's background jobs would ignore it
    folder = options.folder.resolve()
    slips = copy_sources(folder / "src")
    build(folder / "src", folder / "build", options.jobs)
    tests = [t for t in find_tests(folder / "build") if re.search(options.tests, t.name)]
    chosen = [s for s in slips if re.search(options.files, s.file) and s.number in (options.slips or [s.number])]
    results_file = folder / "results.json"
    known = json.loads(results_file.read_text()) if results_file.is_file() else {}
    key = lambda s: f"{s.file}: {s.before}«{s.of}»{s.after} -> {s.to}"  # noqa: E731
    open_ones = [s for s in chosen if not known.get(key(s))]

    with ThreadPoolExecutor(options.jobs) as pool:
        tests.sort(key=lambda t: not t.last)
        passed = list(pool.map(learn, tests))
        print("left out, because they fail without a slip in this build: " + ", ".join(t.name for t, ok in zip(tests, passed) if not ok), flush=True)
        tests = [t for t, ok in zip(tests, passed) if ok]

        def run(slip):
            known[key(slip)] = found = hunt(slip, tests)
            print(f"{slip.told}: " + (f"killed by {found}" if found else "LIVES" + ("" if found == "" else ", no test comes by")), flush=True)
            results_file.write_text(json.dumps(known, indent=1))

        list(pool.map(run, open_ones))
    alive = [s for s in chosen if not known.get(key(s))]
    print(f"{len(chosen) - len(alive)} of {len(chosen)} slips killed")
    for slip in alive:
        print(f"{slip.told}: " + (f"harmless: {slip.harmless}" if slip.harmless else "not explained"))
    return 0 if len(chosen) - len(alive) >= SHARE * len(chosen) and all(s.harmless for s in alive) else 1


if __name__ == "__main__":
    sys.exit(main())
