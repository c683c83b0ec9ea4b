"""Count what a reader has to hold in their head: lines, files, circles, second ways of doing one thing.

    python tests/counts.py                                  make counts
    python tests/counts.py --checkout ../main --checkout .  side by side; make counts CHECKOUTS="../main ."
    python tests/counts.py --places boolean                 file and line of each that is counted in such rows

Each count is defined by the function of its name below. The product is what is in planlang, executive and sim.
"""

from __future__ import annotations

import argparse
import ast
import io
import json
import subprocess
import sys
import tokenize
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import networkx

PRODUCT = ("planlang", "executive", "sim")
LARGEST_FILE, LONG_FUNCTION, SHORT_HELPER = 500, 50, 2
"""Lines."""
POSES = ("set_pose", "set_joint", "set_configuration")
"""Methods that engines alone have."""
CHANGES = ("attach", "release", "remove", "restore", "lead", "let_go", "do")
"""Methods of engines whose names others use, too: lists, locks, stores."""
ENGINES = ("world", "truth", "believed", "physics", "engine", "scene")
"""Last name of an expression that is an engine: ``control.scene.world``, ``self._physics``."""
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

Function = ast.FunctionDef | ast.AsyncFunctionDef


@dataclass
class Source:
    """A file of Python."""

    place: str
    """Its path in the checkout."""
    path: Path
    text: str

    @property
    def module(self) -> str:
        """The name with which it is imported."""
        return self.place.removesuffix(".py").removesuffix("/__init__").replace("/", ".")

    @cached_property
    def tree(self) -> ast.Module:
        """Its syntax tree."""
        return ast.parse(self.text)

    @cached_property
    def nodes(self) -> list[ast.AST]:
        """All nodes of the tree."""
        return list(ast.walk(self.tree))

    @property
    def functions(self) -> Iterator[Function]:
        """All functions, methods included."""
        return (node for node in self.nodes if isinstance(node, Function))

    @property
    def calls(self) -> Iterator[ast.Call]:
        """All calls."""
        return (node for node in self.nodes if isinstance(node, ast.Call))

    @cached_property
    def lines(self) -> Counter[str]:
        """How many lines are code, comment, docstring and blank."""
        lines = self.text.splitlines()
        kinds = ["code" if line.strip() else "blank" for line in lines]
        for node in self.nodes:
            if isinstance(node, ast.Expr) and is_text(node.value):
                kinds[node.lineno - 1 : node.end_lineno] = ["docstring"] * (ending(node) - node.lineno + 1)
        for token in tokenize.generate_tokens(io.StringIO(self.text).readline):
            if token.type == tokenize.COMMENT and lines[token.start[0] - 1].lstrip().startswith("#"):
                kinds[token.start[0] - 1] = "comment"  # one behind code shares its line with the code
        return Counter(kinds)

    def at(self, node: ast.stmt | ast.expr | ast.arg) -> str:
        """Return file and line of a node."""
        return f"{self.place}:{node.lineno}"


class Checkout:
    """The sources of a checkout."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.product = [one for package in PRODUCT for one in self._sources(package)]

    @cached_property
    def tests(self) -> list[Source]:
        """The tests."""
        return self._sources("tests")

    def _sources(self, folder: str) -> list[Source]:
        paths = sorted((self.root / folder).rglob("*.py"))
        return [Source(path.relative_to(self.root).as_posix(), path, path.read_text("utf-8")) for path in paths]

    @cached_property
    def modules(self) -> dict[str, Source]:
        """The product's modules by name; templates of users' files are in no package."""
        return {one.module: one for one in self.product if one.path.with_name("__init__.py").exists()}

    @cached_property
    def imports(self) -> networkx.DiGraph:
        """Which module imports which: at the top, in functions, for types only, by string."""
        edges = (
            (name, other)
            for name, one in self.modules.items()
            for other in (*self._stated(one), *(imported for imported, _ in self.by_string(one)))
        )
        return networkx.DiGraph(edge for edge in edges if edge[0] != edge[1])

    def _stated(self, source: Source) -> Iterator[str]:
        for node in source.nodes:
            if isinstance(node, ast.Import):
                yield from (one.name for one in node.names if one.name in self.modules)
            elif isinstance(node, ast.ImportFrom) and node.module is not None:
                inside = [f"{node.module}.{one.name}" for one in node.names]
                yield from (name for name in inside if name in self.modules)
                if node.module in self.modules and any(name not in self.modules for name in inside):
                    yield node.module

    def by_string(self, source: Source) -> Iterator[tuple[str, int]]:
        """Yield the modules that a file imports by string, each with a line of the file.

        They are named in full, with a colon before what is meant in them, in the file or in the JSON beside it; or by
        the words of the file that complete an f-string: ``import_module(f"executive.cli.{name}")``.
        """
        unmeant = {id(node.value) for node in source.nodes if isinstance(node, ast.Assign) and is_name_of_home(node)}
        words = {
            node.value: node.lineno
            for node in source.nodes
            if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in unmeant
        }
        table = source.path.with_suffix(".json")
        if table.exists():
            words |= dict.fromkeys(table.read_text("utf-8").split('"'), 1)
        for word, line in words.items():
            if "." in (name := word.partition(":")[0]) and name in self.modules:
                yield name, line
        for node in source.calls:
            if is_import(node) and isinstance(node.args[0], ast.JoinedStr):
                package = node.args[0].values[0]
                if isinstance(package, ast.Constant):
                    names = {f"{package.value}{last_word(word)}" for word in words}
                    yield from ((name, node.lineno) for name in sorted(names & {*self.modules}))


def is_text(node: ast.AST) -> bool:
    """Return whether a node is a string, as docstrings are."""
    return isinstance(node, ast.Constant) and isinstance(node.value, str)


def is_name_of_home(node: ast.Assign) -> bool:
    """Return whether a statement says where a class is imported from: ``Failure.__module__ = "planlang.failures"``."""
    return any(isinstance(one, ast.Attribute) and one.attr == "__module__" for one in node.targets)


def is_import(node: ast.Call) -> bool:
    """Return whether a call imports by string."""
    return last_name(node.func) in ("import_module", "import__") and bool(node.args)


def ending(node: ast.stmt) -> int:
    """Return the last line of a statement."""
    return node.end_lineno or node.lineno


def last_word(text: str) -> str:
    """Return what names a command's module: inspect of ``robot inspect``, sweep_merge of ``sweep-merge``."""
    return text.split()[-1].replace("-", "_") if text.strip() else " "


def last_name(node: ast.expr) -> str:
    """Return ``c`` of ``a.b.c`` and of ``c``, without the underscore of private names."""
    name = node.attr if isinstance(node, ast.Attribute) else node.id if isinstance(node, ast.Name) else ""
    return name.lstrip("_")


def calls_of(sources: Iterable[Source], *methods: str) -> Iterator[tuple[Source, ast.Call, str]]:
    """Yield the calls of methods with these names, each with the last name of what it is called on."""
    for source in sources:
        for node in source.calls:
            if isinstance(node.func, ast.Attribute) and node.func.attr in methods:
                yield source, node, last_name(node.func.value)


def calls_that_write_into_an_engine_outside_sim(checkout: Checkout) -> Iterator[str]:
    """Calls of POSES on anything, and of CHANGES on an engine; outside of sim."""
    outside = [one for one in checkout.product if not one.place.startswith("sim/")]
    for source, node, receiver in calls_of(outside, *POSES, *CHANGES):
        if node.func.attr in POSES or receiver in ENGINES:  # type: ignore[attr-defined]
            yield source.at(node)


def callers_of_observe(checkout: Checkout) -> Iterator[str]:
    """Calls of a method observe."""
    return (source.at(node) for source, node, _ in calls_of(checkout.product, "observe"))


def calls_of_sync_on_a_belief_or_platform(checkout: Checkout) -> Iterator[str]:
    """Calls of a method sync in executive and sim; planlang's are those of files, which are written through."""
    sources = [one for one in checkout.product if not one.place.startswith("planlang/")]
    return (source.at(node) for source, node, _ in calls_of(sources, "sync"))


def files_that_parse_python(checkout: Checkout) -> Iterator[str]:
    """Files that make a tree of Python's syntax: ast.parse, or a library that does."""
    for source in checkout.product:
        libraries = {"libcst", "parso", "tokenize"} & {one.split(".")[0] for one in imported_names(source)}
        found = [node for _, node, receiver in calls_of([source], "parse") if receiver == "ast"]
        if found or libraries:
            yield source.at(found[0]) if found else source.place


def files_that_compile_a_plan_to_run_it(checkout: Checkout) -> Iterator[str]:
    """Files that call Python's compile."""
    for source in checkout.product:
        found = [one for one in source.calls if isinstance(one.func, ast.Name) and one.func.id == "compile"]
        if found and not any(one.name == "compile" for one in source.functions):
            yield source.at(found[0])


def imported_names(source: Source) -> Iterator[str]:
    """Yield the modules that a file's statements name, at the top and inside functions."""
    for node in source.nodes:
        if isinstance(node, ast.Import):
            yield from (one.name for one in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield node.module or ""


def import_circles(checkout: Checkout) -> Iterator[str]:
    """Strongly connected modules; imports inside functions, for types only and by string count."""
    knots = networkx.strongly_connected_components(checkout.imports)
    return (f"{len(knot)} modules: {' '.join(sorted(knot))}" for knot in knots if len(knot) > 1)


def modules_in_import_circles(checkout: Checkout) -> Iterator[str]:
    """The modules of these circles."""
    knots = networkx.strongly_connected_components(checkout.imports)
    return (name for knot in knots if len(knot) > 1 for name in sorted(knot))


def modules_that_import_the_root_of_planlang(checkout: Checkout) -> Iterator[str]:
    """Modules of the product that import planlang itself, the names of plan authors."""
    return iter(sorted(checkout.imports.predecessors("planlang")) if "planlang" in checkout.imports else ())


def private_helpers_of_two_lines_used_once(checkout: Checkout) -> Iterator[str]:
    """Functions and methods with a private name that occurs once in their file beside the definition, whose body
    without docstring stands on two lines at most."""
    for source in checkout.product:
        uses: Counter[str] = Counter()
        for node in source.nodes:
            match node:
                case ast.Name(id=name) | ast.Attribute(attr=name) | ast.alias(name=name):
                    uses[name] += 1
        for node in source.functions:
            is_private = node.name.startswith("_") and not node.name.startswith("__")
            if is_private and uses[node.name] == 1 and lines_of_body(node) <= SHORT_HELPER:
                yield source.at(node)


def lines_of_body(node: Function) -> int:
    """Return how many lines the body of a function stands on, without its docstring."""
    body = node.body[1:] if isinstance(node.body[0], ast.Expr) and is_text(node.body[0].value) else node.body
    return ending(body[-1]) - body[0].lineno + 1 if body else 0


def imports_inside_functions(checkout: Checkout) -> Iterator[str]:
    """Statements that import inside a function, and calls of import_module anywhere."""
    for source in checkout.product:
        inner = {
            (node.lineno, source.at(node))
            for function in source.functions
            for node in ast.walk(function)
            if isinstance(node, ast.Import | ast.ImportFrom)
        }
        by_string = {(node.lineno, source.at(node)) for node in source.calls if is_import(node)}
        yield from (place for _, place in sorted(inner | by_string))


def boolean_parameters(checkout: Checkout) -> Iterator[str]:
    """Parameters of functions whose annotation is bool."""
    for source in checkout.product:
        for node in source.functions:
            for one in (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs):
                if one.annotation is not None and ast.unparse(one.annotation) == "bool":
                    yield source.at(one)


def files_over_500_lines(checkout: Checkout) -> Iterator[str]:
    """Files of product and tests that have more than LARGEST_FILE lines, of whatever kind."""
    files = (*checkout.product, *checkout.tests)
    return (f"{one.place}:{one.lines.total()}" for one in files if one.lines.total() > LARGEST_FILE)


def functions_over_50_lines(checkout: Checkout) -> Iterator[str]:
    """Functions of the product with more than LONG_FUNCTION lines, of whatever kind."""
    for source in checkout.product:
        yield from (source.at(one) for one in source.functions if ending(one) - one.lineno >= LONG_FUNCTION)


def files_with_one_importer(checkout: Checkout) -> Iterator[str]:
    """Modules of the product that one other module imports."""
    return (name for name, number in checkout.imports.in_degree() if number == 1)


def file_names_that_exist_twice(checkout: Checkout) -> Iterator[str]:
    """Names of files, each folder's __init__ aside."""
    return twice(one.path.name for one in checkout.product if one.path.name != "__init__.py")


def class_names_that_exist_twice(checkout: Checkout) -> Iterator[str]:
    """Names of classes that are not private."""
    nodes = (node for one in checkout.product for node in one.nodes if isinstance(node, ast.ClassDef))
    return twice(node.name for node in nodes if not node.name.startswith("_"))


def twice(names: Iterable[str]) -> Iterator[str]:
    """Yield the names that occur more than once."""
    return (name for name, number in sorted(Counter(names).items()) if number > 1)


LISTED: tuple[Callable[[Checkout], Iterator[str]], ...] = (
    calls_that_write_into_an_engine_outside_sim,
    callers_of_observe,
    calls_of_sync_on_a_belief_or_platform,
    files_that_parse_python,
    files_that_compile_a_plan_to_run_it,
    import_circles,
    modules_in_import_circles,
    modules_that_import_the_root_of_planlang,
    private_helpers_of_two_lines_used_once,
    imports_inside_functions,
    boolean_parameters,
    files_over_500_lines,
    functions_over_50_lines,
    files_with_one_importer,
    file_names_that_exist_twice,
    class_names_that_exist_twice,
)
"""Counts whose items can be listed."""


def row_of(count: Callable[[Checkout], Iterator[str]]) -> str:
    """Return the name of a count's row."""
    return count.__name__.replace("_", " ")


def figures(checkout: Checkout) -> Iterator[tuple[str, object]]:
    """Yield every count with its name."""
    for name, files in (("product", checkout.product), ("tests", checkout.tests)):
        kinds = sum((one.lines for one in files), Counter[str]())
        yield f"{name}: lines", kinds.total()
        yield f"{name}: lines of code, no blanks, comments, docstrings", kinds["code"]
        yield f"{name}: files", len(files)
        yield f"{name}: comments, share of lines of code [%]", round(100 * kinds["comment"] / kinds["code"], 1)
    yield "modules that `planlang run serve_a_drink` loads", modules_of_a_run(checkout.root)
    for count in LISTED:
        yield row_of(count), sum(1 for _ in count(checkout))


def modules_of_a_run(root: Path) -> str:
    """Return how many modules of the product a run imports, in a process of its own, once its caches are filled."""
    command = [sys.executable, "-c", RUN, "/dev/null"]
    for _ in range(2):
        found = subprocess.run(command, cwd=root, capture_output=True, text=True, check=False)
    return found.stdout.strip() if found.returncode == 0 else f"failed: {found.stderr.strip().splitlines()[-1]}"


def main(words: Sequence[str] | None = None) -> None:
    """Print a table: one row a count, one column a checkout."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    here = Path(__file__).parents[1]
    parser.add_argument(
        "--checkout", type=Path, action="append", help="folder of a checkout; repeatable (default: this)"
    )
    parser.add_argument("--places", metavar="WORD", help="list what is counted in the rows whose names contain this")
    parser.add_argument("--json", action="store_true", help="print the counts as JSON")
    given = parser.parse_args(words)
    checkouts = [Checkout(root.resolve()) for root in given.checkout or [here]]
    if given.places:
        for count in (one for one in LISTED if given.places in row_of(one)):
            for checkout in checkouts:
                print(f"{row_of(count)}, {checkout.root.name}:", *count(checkout), sep="\n  ")
        return
    columns = [dict(figures(checkout)) for checkout in checkouts]
    if given.json:
        print(json.dumps({str(one.root): column for one, column in zip(checkouts, columns, strict=True)}, indent=2))
        return
    for row in columns[0]:
        print(f"{row:58}", *(f"{column[row]!s:>10}" for column in columns))


if __name__ == "__main__":
    main()
