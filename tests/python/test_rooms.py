"""Where files stand: what a room includes lies in its own or in a room below it, and no header is there for the tests alone."""
import ast
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
CORE = ["base", "lattice", "materials", "scene", "bodies", "loads", "run"]  # each builds on those before it
REPORTS = ["read", "grade", "study", "draw", "page"]
METHODS = ["lpfdm", "mpm", "fem_reference"]


def room_of(path):
    parts = path.split("/")
    return "/".join(parts[:2]) if parts[0] in ("core", "benchmarks") else parts[0]


def below(room):
    """The rooms that a room may include, with itself."""
    core = [f"core/{name}" for name in CORE]
    if room in core:
        return core[: core.index(room) + 1]
    if room in METHODS:
        return [*core, room]
    return [*core, *METHODS, "benchmarks/harness"]


def includes():
    for top in ("core", *METHODS, "benchmarks"):
        for path in sorted((ROOT / top).rglob("*.[ch]pp")):
            name = path.relative_to(ROOT).as_posix()
            for line, text in enumerate(path.read_text().splitlines(), start=1):
                if found := re.match(r'#include "(.+)"', text):
                    yield name, line, found[1]


def test_includes_run_downward():
    assert {room_of(name) for name, _, _ in includes()} >= {f"core/{name}" for name in CORE[1:]}
    upward = [f"{name}:{line}: {included}" for name, line, included in includes() if room_of(included) not in below(room_of(name))]
    assert not upward, "\n".join(upward)


def test_no_header_is_there_for_the_tests_alone():
    used = {included for _, _, included in includes()}
    headers = [path.relative_to(ROOT).as_posix() for top in ("core", *METHODS, "benchmarks") for path in (ROOT / top).rglob("*.hpp")]
    assert not set(headers) - used


def test_imports_of_the_report_package_run_downward():
    package, seen, upward = ROOT / "reports" / "testbed_reports", set(), []
    for path in package.rglob("*.py"):
        room = path.parent.name
        for other in re.findall(r"^ *from \.\.(\w+)", path.read_text(), re.M):
            seen.add(other)
            if REPORTS.index(other) >= REPORTS.index(room):
                upward.append(f"{path.relative_to(package)}: {other}")
    assert seen >= {"read", "grade", "draw"} and not upward, "\n".join(upward)


def sources():
    for top in ("core", *METHODS, "benchmarks", "reports"):
        yield from (path for path in (ROOT / top).rglob("*") if path.suffix in (".cpp", ".hpp", ".py"))


def test_a_file_is_about_one_idea():
    long = {path.relative_to(ROOT).as_posix(): count for path in sources() if (count := len(path.read_text().splitlines())) > 350}
    assert not long


def test_a_function_fits_a_screen():
    long = []
    for path in sources():
        if path.suffix == ".py":
            functions = (node for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.FunctionDef))
            sizes = [(node.name, node.end_lineno - node.lineno + 1) for node in functions]
        else:
            sizes = list(cpp_functions(path.read_text().splitlines()))
        long += [(path.relative_to(ROOT).as_posix(), *size) for size in sizes if size[1] > 60]
    assert not long


def cpp_functions(lines):
    """(first line, number of lines) of what stands between braces at one depth and is no type, namespace, loop or lambda."""
    open_at = []
    for number, line in enumerate(lines):
        if found := re.fullmatch(r"( *)\{", line):
            begin = number - 1
            while begin > 0 and not re.search(r"[;{}:]\s*$|^\s*$|^\s*//", lines[begin - 1]):
                begin -= 1
            open_at.append((len(found[1]), begin, " ".join(text.strip() for text in lines[begin:number])))
        elif (found := re.match(r"( *)\}", line)) and open_at and open_at[-1][0] == len(found[1]):
            _, begin, head = open_at.pop()
            if "(" in head and not re.search(r"^(if|for|while|switch|else|try|catch|do|namespace)\b|\b(struct|class|enum) |\[[^]]*\]\s*\(", head):
                yield head, number - begin + 1
