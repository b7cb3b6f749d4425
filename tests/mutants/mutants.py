"""A hundred small faults, each put into a copy of the package and run against the tests of its
room: what survives is a line that no test near it asks.

    python tests/mutants/mutants.py draw [SEED]       writes mutants.yaml
    python tests/mutants/mutants.py run [NUMBER ...]  tells which of them survive

`rooms.yaml` names the tests of each room. A mutant is kept as the line that it changes, so that the
list outlives changes elsewhere in the file; one whose line is gone has to be drawn again.
"""

from __future__ import annotations

import ast
import os
import random
import re
import shutil
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from queue import SimpleQueue
from tempfile import TemporaryDirectory
from time import monotonic

import yaml

HERE = Path(__file__).parent
PROJECT = HERE.parents[1]
PACKAGE = PROJECT / "mapmore_cli"
LIST, ROOMS = HERE / "mutants.yaml", HERE / "rooms.yaml"
COUNT, SEED, MOST_OF_A_FILE, SECONDS = 100, 20261128, 2, 240
SOUND = "tests/study"  # tests that pass in a copy without a fault
FROM_END_TO_END = ("tests/cli/", "tests/fuzz/", "tests/bench/")
COPIED = ("mapmore_cli", "tests", "docs", "configs", "datasets")

COMPARED = {ast.Lt: ("<", "<="), ast.LtE: ("<=", "<"), ast.Gt: (">", ">="), ast.GtE: (">=", ">")}
COMPARED |= {ast.Eq: ("==", "!="), ast.NotEq: ("!=", "==")}
REPLACED = {ast.Add: ("+", "-"), ast.Sub: ("-", "+"), ast.Mult: ("*", "/"), ast.Div: ("/", "*")}
CALLED = {"min": "max", "max": "min", "abs": "", "sorted": "list", "any": "all", "all": "any"}
OF_NO_CONSEQUENCE = {"strict", "repr", "compare", "frozen", "slots", "maxsize", "indent", "width"}


@dataclass(frozen=True)
class Mutant:
    """A line of a file, the `place`-th that reads like this, and what it becomes."""

    file: str
    kind: str
    line: str
    becomes: str
    place: int

    def applied(self, text: str) -> str:
        """Return the file with the fault; raises ValueError if the line is not there any more."""
        lines = text.splitlines(keepends=True)
        found = [at for at, line in enumerate(lines) if line.strip() == self.line]
        if self.place >= len(found):
            raise ValueError(f"{self.file}: no line {self.line!r}: draw the list again")
        at = found[self.place]
        lines[at] = lines[at].replace(self.line, self.becomes)
        return "".join(lines)


# Where faults can be
# --------------------------------------------------------------------------------------------------


def mutants_of(path: Path) -> Iterator[Mutant]:
    """Yield every fault that can be put into a file, from top to bottom."""
    text = path.read_text(encoding="utf-8")
    lines = text.splitlines()
    for node in _code(ast.parse(text)):
        for kind, start, end, new in _changes(node, lines):
            line = lines[node.lineno - 1]
            becomes = (line[:start] + new + line[end:]).strip()
            place = sum(one.strip() == line.strip() for one in lines[: node.lineno - 1])
            yield Mutant(path.relative_to(PACKAGE).as_posix(), kind, line.strip(), becomes, place)


def _code(node: ast.AST) -> Iterator[ast.AST]:
    """Yield the nodes of what runs: no annotations, docstrings, errors, and words."""
    for name, value in ast.iter_fields(node):
        if name in ("annotation", "returns", "type_params", "decorator_list"):
            continue
        for child in value if isinstance(value, list) else [value]:
            if not isinstance(child, ast.AST) or isinstance(child, (ast.Raise, ast.JoinedStr)):
                continue
            if isinstance(child, ast.keyword) and child.arg in OF_NO_CONSEQUENCE:
                continue
            if isinstance(child, ast.If) and "TYPE_CHECKING" in ast.dump(child.test):
                continue
            if isinstance(child, ast.Subscript) and "Annotated" in ast.dump(child.value):
                continue
            yield child
            yield from _code(child)


def _changes(node: ast.AST, lines: list[str]) -> Iterator[tuple[str, int, int, str]]:
    """Yield what can be wrong with a node: a kind, from and to which column, and the new text.

    Columns of a syntax tree count bytes: lines with other characters are left out.
    """
    if not hasattr(node, "lineno") or node.lineno != node.end_lineno:
        if isinstance(node, ast.If) and node.test.lineno == node.test.end_lineno == node.lineno:
            test = node.test
            if lines[node.lineno - 1].isascii():
                inner = lines[node.lineno - 1][test.col_offset : test.end_col_offset]
                yield "branch", test.col_offset, test.end_col_offset, f"not ({inner})"
        return
    line = lines[node.lineno - 1]
    if not line.isascii():
        return
    start, end = node.col_offset, node.end_col_offset or 0
    match node:
        case ast.BinOp(op=ast.Div(), right=ast.Constant(value=str())):
            return  # a path
        case ast.BinOp(left=left, op=op, right=right) if type(op) in REPLACED:
            yield from _between(line, left, right, "sign", REPLACED[type(op)])
        case ast.Compare(left=left, ops=[op], comparators=[right]) if type(op) in COMPARED:
            kind = "edge" if isinstance(op, (ast.Lt, ast.LtE, ast.Gt, ast.GtE)) else "branch"
            yield from _between(line, left, right, kind, COMPARED[type(op)])
        case ast.BoolOp(op=op, values=[left, right]):
            words = ("and", "or") if isinstance(op, ast.And) else ("or", "and")
            yield from _between(line, left, right, "branch", words)
        case ast.UnaryOp(op=ast.USub()):
            yield "sign", start, start + 1, "+"
        case ast.UnaryOp(op=ast.Not()):
            yield "branch", start, start + 3, "bool" if line[start + 3] == "(" else "True and"
        case ast.Constant(value=bool() as value):
            yield "default", start, end, str(not value)
        case ast.Constant(value=int() as value):
            yield "off by one", start, end, str(value + 1)
        case ast.Constant(value=float() as value) if value:
            yield "unit factor", start, end, repr(10 * value)
        case ast.IfExp(body=body, test=test, orelse=other):
            texts = [line[one.col_offset : one.end_col_offset] for one in (other, test, body)]
            yield "branch", start, end, "{} if {} else {}".format(*texts)
        case ast.Call(func=ast.Name(id=name)) if name in CALLED:
            yield "call", start, start + len(name), CALLED[name]
        case ast.Call(func=ast.Attribute(value=value, attr="copy"), args=[]):
            yield "missing copy", value.end_col_offset or 0, end, ""


def _between(
    line: str, left: ast.expr, right: ast.expr, kind: str, texts: tuple[str, str]
) -> Iterator[tuple[str, int, int, str]]:
    """Yield the exchange of an operator between its operands, if they stand in one line."""
    if left.end_lineno == right.lineno:
        first = left.end_col_offset or 0
        gap = line[first : right.col_offset]
        if gap.count(texts[0]) == 1:
            at = first + gap.index(texts[0])
            yield kind, at, at + len(texts[0]), texts[1]


def draw(seed: int) -> list[Mutant]:
    """Draw faults from files in proportion to their size, and from the kinds of a file alike."""
    rng = random.Random(seed)
    tests = rooms()
    files = [path for path in sorted(PACKAGE.rglob("*.py")) if tests_of(path, tests)]
    sizes = [sum(1 for _ in ast.walk(ast.parse(path.read_text()))) for path in files]
    drawn: dict[Mutant, None] = {}
    while len(drawn) < COUNT:
        [path] = rng.choices(files, sizes)
        possible = [one for one in mutants_of(path) if one.line != one.becomes]
        taken = sum(one.file == path.relative_to(PACKAGE).as_posix() for one in drawn)
        if possible and taken < MOST_OF_A_FILE:
            kind = rng.choice(sorted({one.kind for one in possible}))
            drawn[rng.choice([one for one in possible if one.kind == kind])] = None
    return sorted(drawn, key=lambda one: (one.file, one.line))


# Tests of a room
# --------------------------------------------------------------------------------------------------


def rooms() -> dict[str, list[str]]:
    """Return the tests of each room: a file of the package, or a folder."""
    table: dict[str, list[str]] = yaml.safe_load(ROOMS.read_text(encoding="utf-8"))
    return table


def tests_of(path: Path, table: dict[str, list[str]]) -> list[str]:
    """Return the tests of a file: first those that import its module, wherever they stand except
    among studies from end to end; then the others of its innermost room. There are none for a file
    without a room.
    """
    at = path.relative_to(PACKAGE).as_posix()
    names = [name for name in table if at == name or at.startswith(f"{name.rstrip('/')}/")]
    if not names:
        return []
    module = ".".join(path.relative_to(PROJECT).with_suffix("").parts).removesuffix(".__init__")
    room = [
        file
        for test in table[max(names, key=len)]
        for file in ([test] if test.endswith(".py") else _test_files(test))
    ]
    parent, _, name = module.rpartition(".")
    imports = re.compile(rf"from {module} import|from {parent} import (\([^)]*|[^(\n]*)\b{name}\b")
    texts = {file: _text_of(file) for file in _test_files("tests")}
    importing = [file for file, text in texts.items() if name in text and imports.search(text)]
    near = [file for file in importing if file in room or not file.startswith(FROM_END_TO_END)]
    return list(dict.fromkeys([*near, *room]))


@cache
def _test_files(folder: str) -> list[str]:
    """Return the test files of a folder, from the project's."""
    found = sorted((PROJECT / folder).rglob("test_*.py"))
    return [file.relative_to(PROJECT).as_posix() for file in found]


@cache
def _text_of(file: str) -> str:
    return (PROJECT / file).read_text(encoding="utf-8")


def copy_of_project(place: Path) -> Path:
    """Copy what tests need, so that faults never stand in the checkout."""
    for name in COPIED:
        shutil.copytree(
            PROJECT / name, place / name, ignore=shutil.ignore_patterns("__pycache__", "runs")
        )
    for path in (*PROJECT.glob("*.*"), PROJECT / "Makefile", PROJECT / "LICENSE"):
        if path.is_file():
            shutil.copy(path, place)
    return place


SURVIVES, CAUGHT, UNFINISHED = "SURVIVES", "caught", "not finished"


def outcome_of(mutant: Mutant | None, place: Path, tests: list[str]) -> str:
    """Return whether tests notice the fault in a copy of the project. Tests that reach the time
    limit have not noticed it; on a busy machine, they may be slow only.
    """
    target = place / "mapmore_cli" / (mutant.file if mutant else "__init__.py")
    before = target.read_text(encoding="utf-8")
    measured = PROJECT.parent / "shared" / "data"
    env = {"MAPMORE_DATA": str(measured), "OPENBLAS_NUM_THREADS": "1", **os.environ}
    env["PYTHONPATH"] = str(place)
    env.pop("PYTHONDONTWRITEBYTECODE", None)  # else every run compiles the whole package anew
    line = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", "-m", "not long"]
    try:
        if mutant:
            target.write_text(mutant.applied(before), encoding="utf-8")
        done = subprocess.run(
            [*line, *tests], cwd=place, env=env, capture_output=True, timeout=SECONDS, check=False
        )
        if done.returncode not in (0, 1, 2, 3, 4):
            raise RuntimeError(f"{tests}: pytest ended with {done.returncode}")
        return CAUGHT if done.returncode else SURVIVES
    except subprocess.TimeoutExpired:
        return UNFINISHED
    finally:
        target.write_text(before, encoding="utf-8")


def run(numbers: list[int], jobs: int = 2) -> int:
    """Run the mutants of the list, or some, and print those that no test noticed: those that
    survive, and apart from them those whose tests did not finish. Return the number of both.
    """
    listed = [Mutant(**one) for one in yaml.safe_load(LIST.read_text(encoding="utf-8"))]
    table, missed = rooms(), dict[str, list[int]]()
    with TemporaryDirectory() as folder:
        places: SimpleQueue[Path] = SimpleQueue()
        for job in range(jobs):
            places.put(place := copy_of_project(Path(folder) / f"copy-{job}"))
            if outcome_of(None, place, [SOUND]) != SURVIVES:
                raise SystemExit(f"{SOUND} fails without a fault: is pytest installed here?")

        def tried(number: int) -> tuple[int, str, float]:
            place, started = places.get(), monotonic()
            try:
                tests = tests_of(PACKAGE / listed[number].file, table)
                return number, outcome_of(listed[number], place, tests), monotonic() - started
            finally:
                places.put(place)

        with ThreadPoolExecutor(jobs) as pool:
            for number, outcome, seconds in pool.map(tried, numbers or range(len(listed))):
                one = listed[number]
                print(
                    f"{number:3} {outcome:12} {seconds:5.0f} s  {one.file}: {one.kind}", flush=True
                )
                if outcome != CAUGHT:
                    missed.setdefault(outcome, []).append(number)
                    print(f"        {one.line}\n        {one.becomes}", flush=True)
    for outcome in (SURVIVES, UNFINISHED):
        these = missed.get(outcome, [])
        print(f"{outcome}: {len(these)} of {len(numbers or listed)} {these}")
    return sum(map(len, missed.values()))


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["draw", *seed]:
            chosen = draw(int(seed[0]) if seed else SEED)
            LIST.write_text(
                "# Made by `python tests/mutants/mutants.py draw`; do not edit.\n"
                + yaml.safe_dump([asdict(one) for one in chosen], sort_keys=False, width=110),
                encoding="utf-8",
            )
            print(dict(Counter(one.kind for one in chosen)))
        case ["run", *some]:
            sys.exit(run([*map(int, some)]) > 15)
        case _:
            sys.exit(__doc__)
