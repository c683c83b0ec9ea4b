"""Breaks the product in ways that are drawn by lot, and shows how many of them its tests notice.

    python -m tests.mutants.drawn --seed 7 --count 100
    python -m tests.mutants.drawn --seed 7 --count 100 --beside ../before

Each mutant is a copy of the checkout in which one expression or statement of a function differs; the tests of its room
run against the copy until one fails: of ``executive/locations`` those of ``tests/executive/locations``, and so on.
With ``--beside`` mutants are drawn of functions that are the same in both checkouts, and run in both. A mutant that
changes nothing that can be noticed survives, too: the share says more than a single one.
"""

# ruff: noqa: T201 - a report

from __future__ import annotations

import argparse
import ast
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from planlang.records import dataclass

ROOT = Path(__file__).resolve().parents[2]
PRODUCT = ("planlang", "executive", "sim")
COPIED = ("planlang", "executive", "sim", "tests", "ontologies", "recipes", "docs")
CPU_TIME = 400
"""Seconds of computing after which the tests of a mutant are ended; it counts as caught, for they end otherwise."""
SWAPPED: dict[type[ast.cmpop], str] = {
    ast.Lt: "<=",
    ast.LtE: "<",
    ast.Gt: ">=",
    ast.GtE: ">",
    ast.Eq: "!=",
    ast.NotEq: "==",
    ast.Is: "is not",
    ast.IsNot: "is",
    ast.In: "not in",
    ast.NotIn: "in",
}
OTHER: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
}


@dataclass(frozen=True, slots=True)
class Mutant:
    """A change of one place of a file: what stands between two places of a function is another text."""

    file: str
    function: str
    begin: int
    end: int
    """Characters of the function's text."""
    before: str
    after: str

    def __str__(self) -> str:
        return f"{self.file} {self.function}: {_short(self.before)} -> {_short(self.after)}"


def _short(text: str) -> str:
    text = " ".join(text.split())
    return text if len(text) <= 60 else f"{text[:57]}..."


def functions_in(root: Path) -> dict[tuple[str, str], str]:
    """Return the texts of all functions of the product, by file and name."""
    found: dict[tuple[str, str], str] = {}
    for folder in PRODUCT:
        for path in sorted((root / folder).rglob("*.py")):
            source = path.read_text(encoding="utf-8")
            for name, node in _functions(ast.parse(source), ""):
                segment = ast.get_source_segment(source, node)
                if segment is not None and source.count(segment) == 1:
                    found[path.relative_to(root).as_posix(), name] = segment
    return found


def _functions(tree: ast.AST, prefix: str) -> Iterator[tuple[str, ast.FunctionDef | ast.AsyncFunctionDef]]:
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            yield prefix + node.name, node
        elif isinstance(node, ast.ClassDef):
            yield from _functions(node, f"{prefix}{node.name}.")


def mutants_of(file: str, function: str, text: str) -> list[Mutant]:
    """Return the mutants of a function, in the order of its text."""
    tree = ast.parse(text)
    lines = [0]
    for line in text.splitlines(keepends=True):
        lines.append(lines[-1] + len(line))
    plain = text.isascii()  # columns count bytes
    found = []
    for node in ast.walk(tree) if plain else ():
        after = _changed(node)
        if after is None or not isinstance(node, ast.expr | ast.stmt):
            continue
        assert node.end_lineno is not None
        assert node.end_col_offset is not None
        begin, end = lines[node.lineno - 1] + node.col_offset, lines[node.end_lineno - 1] + node.end_col_offset
        found.append(Mutant(file, function, begin, end, text[begin:end], after))
    return sorted(found, key=lambda one: (one.begin, one.end, one.after))


def _changed(node: ast.AST) -> str | None:
    """Return what may stand there instead; None if nothing does."""
    match node:
        case ast.Compare(left=left, ops=[operator], comparators=[right]):
            return f"({ast.unparse(left)}) {SWAPPED[type(operator)]} ({ast.unparse(right)})"
        case ast.BoolOp(op=operator, values=values):
            word = " or " if isinstance(operator, ast.And) else " and "
            return f"({word.join(f'({ast.unparse(value)})' for value in values)})"
        case ast.UnaryOp(op=ast.Not(), operand=operand):
            return f"bool({ast.unparse(operand)})"
        case ast.BinOp(left=left, op=operator, right=right) if type(operator) in OTHER:
            if isinstance(left, ast.Constant | ast.JoinedStr) or isinstance(right, ast.Constant | ast.JoinedStr):
                return None  # most of them are texts
            return f"({ast.unparse(ast.BinOp(left, OTHER[type(operator)](), right))})"
        case ast.Constant(value=bool() as value):
            return str(not value)
        case ast.Constant(value=int() as value):
            return str(value + 1)
        case ast.Return(value=ast.expr() as value) if not (isinstance(value, ast.Constant) and value.value is None):
            return "return None"
        case ast.Expr(value=ast.Call() | ast.Await()):
            return "pass"
    return None


def draw(roots: list[Path], seed: int, count: int) -> list[Mutant]:
    """Return mutants of functions that are the same in all checkouts: each room has its share by its functions."""
    functions = functions_in(roots[0])
    for other in roots[1:]:
        there = functions_in(other)
        functions = {key: text for key, text in functions.items() if there.get(key) == text}
    lot = random.Random(seed)
    keys = sorted(functions)
    found: list[Mutant] = []
    while len(found) < count:
        file, name = lot.choice(keys)
        possible = mutants_of(file, name, functions[file, name])
        if possible:
            mutant = lot.choice(possible)
            found += [mutant] if mutant not in found else []
    return found


def tests_of(file: str, root: Path) -> list[str]:
    """Return the tests of a file's room: the folder that mirrors it, or else the test files that import the file."""
    folder = Path("tests") / Path(file).parent
    while len(folder.parts) > 2:
        if (root / folder).is_dir():
            return [str(folder)]
        folder = folder.parent
    module = file.removesuffix(".py").replace("/", ".")
    wanted = [module, module.rpartition(".")[0]] if Path(file).parent.name not in PRODUCT else [module]
    paths = sorted((root / "tests" / module.partition(".")[0]).rglob("test_*.py"))
    for name in wanted:
        found = [str(path.relative_to(root)) for path in paths if f"{name} import" in path.read_text(encoding="utf-8")]
        if found:
            return found
    return [str(path.relative_to(root)) for path in paths if path.parent.name == Path(module.partition(".")[0]).name]


def caught(mutant: Mutant, root: Path) -> tuple[bool, str]:
    """Return whether the tests of its room notice a mutant, and which one does."""
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder)
        for part in COPIED:
            shutil.copytree(root / part, copy / part)  # with what is compiled: a file that changes is compiled anew
        for part in ("pyproject.toml", "planlang_command.py", "README.md", "Makefile"):
            shutil.copy(root / part, copy / part)
        path = copy / mutant.file
        source = path.read_text(encoding="utf-8")
        text = functions_in_file(source)[mutant.function]
        path.write_text(
            source.replace(text, text[: mutant.begin] + mutant.after + text[mutant.end :]), encoding="utf-8"
        )
        environment = dict(os.environ, PYTHONPATH=folder, PYTHONDONTWRITEBYTECODE="", OPENBLAS_NUM_THREADS="1")
        command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", "-k", "not ctrl_c"]
        bounded = ["sh", "-c", f'ulimit -t {CPU_TIME} && exec "$@"', "sh", *command, *tests_of(mutant.file, root)]
        try:
            ended = subprocess.run(
                bounded, cwd=copy, env=environment, capture_output=True, text=True, timeout=4 * CPU_TIME
            )
        except subprocess.TimeoutExpired:
            return True, "a test that does not end"
    failed = [line for line in ended.stdout.splitlines() if line.startswith(("FAILED", "ERROR"))]
    if ended.returncode == -signal.SIGKILL:
        return True, "a test that does not end"
    why = failed[0].split(" - ")[0].rpartition("::")[2] if failed else f"pytest ended with {ended.returncode}"
    return ended.returncode != 0 and ended.returncode != 5, why


def functions_in_file(source: str) -> dict[str, str]:
    """Return the texts of the functions of a file, by name."""
    return {name: ast.get_source_segment(source, node) or "" for name, node in _functions(ast.parse(source), "")}


def main() -> None:
    """Draw, run and report."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--beside", type=Path, help="another checkout, in which the same mutants run")
    options = parser.parse_args()
    roots = [ROOT, *([options.beside.resolve()] if options.beside else [])]
    mutants = draw(roots, options.seed, options.count)
    begin, totals = time.monotonic(), [0] * len(roots)
    with ThreadPoolExecutor(options.jobs) as pool:
        results = [[pool.submit(caught, mutant, root) for root in roots] for mutant in mutants]
        for number, (mutant, found) in enumerate(zip(mutants, results, strict=True)):
            answers = [one.result() for one in found]
            for place, (good, _) in enumerate(answers):
                totals[place] += good
            said = " | ".join(f"{'caught' if good else 'SURVIVED'} ({why})" for good, why in answers)
            print(f"{number:3} {said}: {mutant}", flush=True)
    for root, total in zip(roots, totals, strict=True):
        print(f"{root.name}: {total} of {len(mutants)} mutants caught")
    print(f"{time.monotonic() - begin:.0f} s")


if __name__ == "__main__":
    main()
