"""What the code measures, of one checkout or several: ``python -m tests.benchmarks.code [FOLDER ...]``.

Lines are those of Python without blank lines, comments and docstrings, of the product and of its tests.
"""

from __future__ import annotations

import argparse
import ast
import subprocess
import sys
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping
from pathlib import Path

PRODUCT = ("planlang", "executive", "sim")
LONG = 50
"""Lines of a function that count as long."""


def files_in(root: Path, *folders: str) -> dict[str, ast.Module]:
    """Return the parsed files of folders, by the name with which they are imported."""
    paths = (path for folder in folders for path in sorted((root / folder).rglob("*.py")))
    return {_name(path.relative_to(root)): ast.parse(path.read_text(encoding="utf-8")) for path in paths}


def _name(path: Path) -> str:
    return ".".join((path.parent if path.name == "__init__.py" else path.with_suffix("")).parts)


def lines(file: ast.Module) -> int:
    """Count the lines of code: those that a token of a statement stands on which is no docstring."""
    texts = {id(node.value) for node in ast.walk(file) if isinstance(node, ast.Expr) and _is_text(node.value)}
    found: set[int] = set()
    for node in ast.walk(file):
        if isinstance(node, ast.expr) and id(node) not in texts:
            found.update(range(node.lineno, (node.end_lineno or node.lineno) + 1))
        elif isinstance(node, ast.stmt) and not (isinstance(node, ast.Expr) and id(node.value) in texts):
            found.add(node.lineno)
            if not hasattr(node, "body"):
                found.update(range(node.lineno, (node.end_lineno or node.lineno) + 1))
        elif isinstance(node, ast.arg | ast.keyword | ast.alias):
            found.add(node.lineno)
    return len(found)


def _is_text(node: ast.expr) -> bool:
    return isinstance(node, ast.Constant) and isinstance(node.value, str)


def imported(file: ast.Module, names: Mapping[str, ast.Module]) -> Iterator[str]:
    """Yield the files that a file imports, of those that are known."""
    for node in ast.walk(file):
        if isinstance(node, ast.Import):
            yield from (one.name for one in node.names if one.name in names)
        elif isinstance(node, ast.ImportFrom) and node.module is not None:
            inside = [f"{node.module}.{one.name}" for one in node.names]
            yield from (name for name in inside if name in names)
            if node.module in names and any(name not in names for name in inside):
                yield node.module


def functions(file: ast.Module) -> Iterator[ast.FunctionDef | ast.AsyncFunctionDef]:
    """Yield all functions."""
    return (node for node in ast.walk(file) if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef))


def modules_of_a_run(root: Path) -> int:
    """Count the files of the product that ``planlang run serve_a_drink`` imports."""
    program = (
        "import sys; sys.argv = ['planlang', 'run', 'serve_a_drink', '--json']\n"
        "import atexit; from planlang_command import main\n"
        f"atexit.register(lambda: print(sum(name.split('.')[0] in {PRODUCT} for name in sys.modules)))\n"
        "main()"
    )
    done = subprocess.run([sys.executable, "-c", program], cwd=root, capture_output=True, text=True, check=True)
    return int(done.stdout.split()[-1])


def measures(root: Path) -> dict[str, int]:
    """Return what a checkout measures."""
    product, tests = files_in(root, *PRODUCT), files_in(root, "tests")
    importers: dict[str, set[str]] = defaultdict(set)
    for name, file in product.items():
        for other in imported(file, product):
            importers[other].add(name)
    classes = Counter(
        name for file in product.values() for name in {one.name for one in file.body if isinstance(one, ast.ClassDef)}
    )
    inner = {
        (name, node.lineno)
        for name, file in product.items()
        for function in functions(file)
        for node in ast.walk(function)
        if isinstance(node, ast.Import | ast.ImportFrom)
    }
    return {
        "lines of the product": sum(map(lines, product.values())),
        "lines of tests": sum(map(lines, tests.values())),
        "files of the product": len(product),
        "files with one importer": sum(len(one) == 1 for one in importers.values()),
        "imports inside functions": len(inner),
        "files that a run imports": modules_of_a_run(root),
        "class names in several files": sum(number > 1 for number in classes.values()),
        f"functions of more than {LONG} lines": sum(
            (one.end_lineno or 0) - one.lineno >= LONG for file in product.values() for one in functions(file)
        ),
    }


def main() -> None:
    """Print a column for each checkout."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folders", nargs="*", type=Path, default=[Path()], metavar="FOLDER")
    found = [measures(folder) for folder in parser.parse_args().folders]
    for name in found[0]:
        print(f"{name:32}", *(f"{one[name]:8}" for one in found))


if __name__ == "__main__":
    main()
