"""Mutation score: how many small changes of the source the tests detect.

    python benchmarks/mutants.py                           # 40 mutants of all modules in TESTS, seed 1; an hour
    python benchmarks/mutants.py --seed 2 --count 10 src/fifthwheel/estimate/identify/doubts.py
    python benchmarks/mutants.py --seed 2 --narrow         # without the tests of the broadest paths
    python benchmarks/mutants.py --seed 2 --only 3 17      # two mutants of this sample again
    python benchmarks/mutants.py --list                    # the number of possible mutants of each file

A mutant is a copy of the package with one change: another comparison, `and` for `or`, another arithmetic operator,
another number, True for False, an inverted condition, None instead of a returned value, or no call or augmented
assignment. Texts, annotations, decorators and `strict` of `zip` keep their values. The tests of the narrowest paths run
first. A mutant that they pass, and all broader paths, has survived. Printed are the outcome of each mutant and the
score: the fraction that is killed, also by the time limit. Some survivors are equivalent to the source; a reader must
judge that.
"""

import argparse
import ast
import copy
import importlib
import os
import random
import shutil
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[1]
ONE_STAGE = "src/fifthwheel/estimate/identify/one_stage"
PROBLEM_TESTS = "tests/estimate/identify/one_stage/test_problem.py"
SOLVER_TESTS = "tests/frozen tests/estimate/identify/one_stage tests/results/diagnose"
STREAM_TESTS = "tests/frozen tests/estimate/observe tests/estimate/online"
FLEET_TESTS = "tests/apps/fleet tests/apps/cli/test_knowledge.py"
TESTS = {
    "src/fifthwheel/estimate/identify/verdict.py": ("tests/estimate/identify/test_verdict.py", SOLVER_TESTS),
    "src/fifthwheel/estimate/identify/doubts.py": (
        "tests/estimate/identify/test_doubts.py tests/estimate/identify/one_stage/test_doubt_limits.py",
        "tests/estimate/identify/one_stage/test_evidence.py tests/estimate/online/test_doubt_limits.py " + SOLVER_TESTS,
    ),
    "src/fifthwheel/estimate/stream.py": ("tests/estimate/stream tests/estimate/observe/test_limits.py", STREAM_TESTS),
    "src/fifthwheel/estimate/observe/monitor.py": (
        "tests/estimate/observe/test_limits.py tests/estimate/observe/test_settling.py",
        f"tests/estimate/observe/test_consistency.py {STREAM_TESTS} tests/apps/live",
    ),
    "src/fifthwheel/apps/fleet/manifest.py": ("tests/apps/fleet/test_manifest.py", FLEET_TESTS),
    "src/fifthwheel/apps/fleet": (
        "tests/apps/fleet/test_storage.py tests/apps/fleet/test_report.py tests/apps/fleet/test_combination.py",
        FLEET_TESTS,
    ),
    "src/fifthwheel/estimate/identify/fits.py": (
        "tests/estimate/identify/test_fits.py tests/estimate/identify/test_saturating_tyres.py",
        SOLVER_TESTS,
    ),
    f"{ONE_STAGE}/identify.py": (
        "tests/estimate/identify/knowledge/test_contradictions.py",
        f"tests/estimate/identify/knowledge {SOLVER_TESTS}",
    ),
    f"{ONE_STAGE}/problem.py": (
        f"{PROBLEM_TESTS} --deselect={PROBLEM_TESTS}::test_gradient",
        f"{PROBLEM_TESTS} tests/estimate/identify/one_stage/test_estimator.py",
        SOLVER_TESTS,
    ),
    f"{ONE_STAGE}/posterior.py": ("tests/estimate/identify/test_doubts.py", SOLVER_TESTS),
    f"{ONE_STAGE}/shared_information.py": (
        "tests/estimate/identify/knowledge/test_shared_information.py",
        SOLVER_TESTS,
    ),
    ONE_STAGE: ("tests/estimate/identify/one_stage/test_estimator.py", SOLVER_TESTS),
}
"""Paths of tests by file or folder, the narrowest first. `test_<module>.py` in one of the folders runs first."""
COMPARISONS: dict[type, list[type[ast.cmpop]]] = {
    **{ast.Lt: [ast.LtE, ast.GtE], ast.LtE: [ast.Lt, ast.Gt], ast.Gt: [ast.GtE, ast.LtE], ast.GtE: [ast.Gt, ast.Lt]},
    **{ast.Eq: [ast.NotEq], ast.NotEq: [ast.Eq], ast.Is: [ast.IsNot], ast.IsNot: [ast.Is]},
    **{ast.In: [ast.NotIn], ast.NotIn: [ast.In]},
}
OPERATORS: dict[type, type[ast.operator]] = {
    **{ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.Pow: ast.Mult},
    **{ast.FloorDiv: ast.Mult, ast.Mod: ast.Mult, ast.BitAnd: ast.BitOr, ast.BitOr: ast.BitAnd},
}
KEPT = {"annotation", "returns", "decorator_list", "bases"}
WITHOUT = ("-p", "no:cacheprovider", "-p", "no:xdist")
IMPORTED = (
    "casadi",
    "llvmlite.binding",
    "plotly.graph_objects",
    "pyarrow.parquet",
    "pydantic",
    "scipy.signal",
    "typer",
)
"""Packages that all runs of tests share, imported once."""
CRASHED = {2: "import", 3: "internal error of pytest"}
"""Exit codes of pytest that a mutant gives where the same tests pass without it, besides 1."""


@dataclass(frozen=True)
class Mutant:
    """One change of one file."""

    file: str
    line: int
    span: tuple[int, int]  # bytes
    text: str
    was: str

    def __str__(self) -> str:
        return f"{self.file}:{self.line}: {' '.join(self.was.split())[:90]}  ->  {self.text[:90]}"

    def applied(self, source: bytes) -> bytes:
        """The source with the change."""
        return source[: self.span[0]] + self.text.encode() + source[self.span[1] :]


def mutants(file: str) -> Iterator[Mutant]:
    """All mutants of a file."""
    source = (ROOT / file).read_bytes()
    starts = [0]
    for line in source.splitlines(keepends=True):
        starts.append(starts[-1] + len(line))
    for node, text in changes(ast.parse(source)):
        begin = starts[node.lineno - 1] + node.col_offset
        end = starts[node.end_lineno - 1] + node.end_col_offset
        yield Mutant(file, node.lineno, (begin, end), text, source[begin:end].decode())


def changes(node: Any) -> Iterator[tuple[Any, str]]:
    """The nodes below a node that can change, each with its new text."""

    def changed(**fields: Any) -> tuple[Any, str]:
        new = copy.copy(node)
        for name, value in fields.items():
            setattr(new, name, value)
        return node, f"({ast.unparse(new)})"

    match node:
        case ast.JoinedStr() | ast.keyword(arg="strict") | ast.Assign(targets=[ast.Name(id="__all__")]):
            return
        case ast.Compare():
            for i, operator in enumerate(node.ops):
                for other in COMPARISONS[type(operator)]:
                    yield changed(ops=[*node.ops[:i], other(), *node.ops[i + 1 :]])
        case ast.BoolOp():
            yield changed(op=ast.Or() if isinstance(node.op, ast.And) else ast.And())
        case ast.UnaryOp(op=ast.Not() | ast.USub()):
            yield node, f"({ast.unparse(node.operand)})"
        case ast.BinOp() if type(node.op) in OPERATORS:
            yield changed(op=OPERATORS[type(node.op)]())
        case ast.Constant(value=bool()):
            yield node, str(not node.value)
        case ast.Constant(value=int() | float() as value):
            yield node, str(value + 1 if isinstance(value, int) and value < 10 else value * 2 or 1.0)
        case ast.Return(value=ast.expr()) if not (isinstance(node.value, ast.Constant) and node.value.value is None):
            yield node, "return None"
        case ast.Expr(value=ast.Call()) | ast.AugAssign():
            yield node, "pass"
        case ast.Continue() | ast.Break():
            yield node, "break" if isinstance(node, ast.Continue) else "continue"
    tests = node.ifs if isinstance(node, ast.comprehension) else [getattr(node, "test", None)]
    for test in filter(None, tests):
        yield test, f"(not ({ast.unparse(test)}))"
    for name, value in ast.iter_fields(node):
        if name not in KEPT:
            for child in value if isinstance(value, list) else [value]:
                if isinstance(child, ast.AST):
                    yield from changes(child)


def stages(file: str) -> list[str]:
    """The paths of tests for a file, the narrowest first."""
    paths = next(found for place, found in TESTS.items() if file == place or file.startswith(f"{place}/"))
    words, name = " ".join(paths).split(), f"test_{Path(file).stem}.py"
    own = [f"{word}/{name}" for word in words if (ROOT / word / name).is_file() and name not in paths[0]]
    return list(dict.fromkeys([*own, *paths]))


class Copy:
    """A copy of the package, and the tests with it."""

    def __init__(self, folder: Path, limit: float | None) -> None:
        self.folder = folder
        shutil.copytree(ROOT / "src", folder / "src")
        self.environment = {"PYTHONPATH": str(folder / "src"), "PYTHONDONTWRITEBYTECODE": "1"}  # of child processes
        self.silent = os.open(os.devnull, os.O_WRONLY)
        self.limit = cache(self._limit) if limit is None else lambda _: limit

    def outcome(self, mutant: Mutant, *, narrow: bool) -> str:
        """Killed, timed out or survived, and by which tests; with `narrow` without those of the broadest paths."""
        path = self.folder / mutant.file
        for tests in stages(mutant.file)[: -1 if narrow else None]:
            limit = self.limit(tests)
            source, times = path.read_bytes(), path.stat()
            path.write_bytes(mutant.applied(source))
            try:
                code = self._exit_code(tests, limit)
            finally:
                path.write_bytes(source)
                os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))  # for the compiled modules of Python
            if code is None:
                return f"time-out ({tests})"
            if code == 1 or code < 0 or code in CRASHED:
                return f"killed ({CRASHED.get(code, tests)})"
            if code:
                sys.exit(f"exit code {code} of pytest with {tests} and {mutant}")
        return "SURVIVED"

    def _limit(self, tests: str) -> float:
        """Time limit, s: three times that of the source without a change, which must pass."""
        start = time.monotonic()
        if code := self._exit_code(tests, None):
            sys.exit(f"exit code {code} of pytest with {tests} and no mutant")
        return 30 + 3 * (time.monotonic() - start)

    def _exit_code(self, tests: str, limit: float | None) -> int | None:
        """Of pytest in a child process, which has the imported packages of this one; None after the time limit."""
        child = os.fork()
        if not child:
            try:
                os.setsid()
                os.dup2(self.silent, 1)
                os.dup2(self.silent, 2)
                os.chdir(ROOT)
                os.environ |= self.environment
                sys.path[:0] = [str(ROOT), str(self.folder / "src")]
                sys.dont_write_bytecode = True
                os._exit(pytest.main(["-x", "-q", *WITHOUT, "-m", "not slow", *tests.split()]))
            finally:
                os._exit(max(CRASHED))
        start = time.monotonic()
        while limit is None or time.monotonic() - start < limit:
            done, status = os.waitpid(child, os.WNOHANG)
            if done:
                return os.waitstatus_to_exitcode(status)
            time.sleep(0.1)
        os.killpg(child, signal.SIGKILL)
        os.waitpid(child, 0)
        return None


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="*", help="files of the package, by default all of TESTS")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=40, help="mutants")
    parser.add_argument("--only", type=int, nargs="+", help="numbers of mutants of the sample")
    parser.add_argument("--limit", type=float, help="time limit of tests, s; by default by the tests without a mutant")
    parser.add_argument("--narrow", action="store_true", help="leave out the tests of the broadest paths")
    parser.add_argument("--list", action="store_true", help="print numbers of mutants, run nothing")
    given = parser.parse_args()
    paths = {path for place in TESTS for path in [ROOT / place, *(ROOT / place).glob("*.py")] if path.suffix == ".py"}
    files = given.files or sorted(str(path.relative_to(ROOT)) for path in paths)
    every = [mutant for file in files for mutant in mutants(file)]
    if given.list:
        for file, count in Counter(mutant.file for mutant in every).items():
            print(f"{count:5d} {file}: {', then '.join(stages(file))}")
        return
    os.environ |= {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    for name in IMPORTED:
        importlib.import_module(name)
    sample = list(enumerate(random.Random(given.seed).sample(every, given.count), 1))
    outcomes = Counter[str]()
    with tempfile.TemporaryDirectory() as folder:
        package = Copy(Path(folder), given.limit)
        for number, mutant in sample:
            if not given.only or number in given.only:
                outcome = package.outcome(mutant, narrow=given.narrow)
                outcomes[outcome.split()[0]] += 1
                print(f"{number:3d} {outcome}: {mutant}", flush=True)
    total = outcomes.total()
    print(f"{dict(outcomes)}: {(total - outcomes['SURVIVED']) / total:.0%} of {total}, of {len(every)} possible ones")


if __name__ == "__main__":
    main()
