"""Count what a reader has to hold in their head: lines, files, modules entered by a run, import circles, names twice.

    python tests/counts.py [CHECKOUT ...]      make counts

Several checkouts stand side by side. Lines are counted with and without blank lines, comments and docstrings. Circles
are strongly connected modules; imports for types only, and inside functions, count.
"""

from __future__ import annotations

import ast
import io
import subprocess
import sys
import tokenize
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path

PRODUCT = ("planlang", "executive", "sim")
RUN = """
import contextlib, io, sys
from executive.__main__ import main
sys.argv = ["planlang", "run", "serve_a_drink", "--trace", sys.argv[1]]
try:
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        main()
except SystemExit as end:
    assert not end.code, end.code
print(sum(name.split(".")[0] in ("planlang", "executive", "sim") for name in sys.modules))
"""
CIRCLES = """
import grimp, networkx
graph = grimp.build_graph("planlang", "executive", "sim", cache_dir=None)
modules = networkx.DiGraph(
    (one, other) for one in graph.modules for other in graph.find_modules_directly_imported_by(one)
)
print(*sorted(len(knot) for knot in networkx.strongly_connected_components(modules) if len(knot) > 1))
"""


def main(checkouts: Iterable[Path]) -> None:
    """Print a table: one row a count, one column a checkout."""
    columns = [dict(counted(checkout.resolve())) for checkout in checkouts]
    for row in columns[0]:
        print(f"{row:52}", *(f"{column[row]!s:>16}" for column in columns))


def counted(checkout: Path) -> Iterator[tuple[str, object]]:
    """Yield every count of a checkout with its name."""
    product = [path for package in PRODUCT for path in sorted((checkout / package).rglob("*.py"))]
    tests = sorted((checkout / "tests").rglob("*.py"))
    for name, files in (("product", product), ("tests", tests)):
        kinds = sum((lines_of(path) for path in files), Counter[str]())
        yield f"{name}: lines", kinds.total()
        yield f"{name}: lines of code", kinds["code"]
        yield f"{name}: files", len(files)
        if files is product:
            yield f"{name}: comments, share of lines of code [%]", round(100 * kinds["comment"] / kinds["code"], 1)
            yield f"{name}: files over 500 lines", sum(lines_of(path).total() > 500 for path in files)
    yield "modules entered by `planlang run serve_a_drink`", asked(checkout, RUN, "/dev/null")
    yield "import circles: modules in each", asked(checkout, CIRCLES) or "none"
    yield "file names that exist twice", twice(path.name for path in product if path.name != "__init__.py")
    yield "class names that exist twice", twice(name for path in product for name in classes_of(path))


def lines_of(path: Path) -> Counter[str]:
    """Return how many lines of a file are code, comment, docstring and blank."""
    text = path.read_text()
    lines = text.splitlines()
    kinds = ["code" if line.strip() else "blank" for line in lines]
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            kinds[node.lineno - 1 : node.end_lineno] = ["docstring"] * (node.end_lineno - node.lineno + 1)
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.COMMENT and lines[token.start[0] - 1].lstrip().startswith("#"):
            kinds[token.start[0] - 1] = "comment"  # one behind code shares its line with the code
    return Counter(kinds)


def classes_of(path: Path) -> list[str]:
    """Return the names of a file's classes that are not private."""
    nodes = ast.walk(ast.parse(path.read_text()))
    return [node.name for node in nodes if isinstance(node, ast.ClassDef) and not node.name.startswith("_")]


def twice(names: Iterable[str]) -> int:
    """Return how many names occur more than once."""
    return sum(number > 1 for number in Counter(names).values())


def asked(checkout: Path, code: str, *arguments: str) -> str:
    """Return what a piece of Python prints that imports the packages of a checkout."""
    found = subprocess.run(
        [sys.executable, "-c", code, *arguments], cwd=checkout, capture_output=True, text=True, check=False
    )
    return found.stdout.strip() if found.returncode == 0 else f"failed: {found.stderr.strip().splitlines()[-1]}"


if __name__ == "__main__":
    main([Path(argument) for argument in sys.argv[1:]] or [Path(__file__).parents[1]])
