"""Measure what compiling costs: from files of 1,000 to 10,000 steps, each stage, and its growth; networkx beside.

First recipes from files, in each syntax: random orders with ten orderings a step. The peer is networkx, which of all
this does the transitive reduction alone. Then the stages, of recipes made in memory: the same orders, and
series-parallel ones. Every row is measured in a process of its own, so that its peak of memory is its own; "x" is the
growth from 1,000 to 10,000 steps, and in the rows of the reduction the ratio of networkx to ours, in the same process.
Last the bundled recipe, with the vocabulary read anew, and with the vocabulary and the recipe's ontology kept. Seconds
are of CPU time.

``--against CHECKOUT`` compares with another checkout instead: the CPU time of compiling 1,000 steps from a file, of the
whole command, the two by turns.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from tests.benchmarks.large_recipes import ACTION, BASE, KNOWROB, PER_STEP, SYNTAXES, random_orders, write_recipe  # noqa: E402

LOOKING = KNOWROB + ACTION
SIZES = (1_000, 10_000)
FILE_SIZES = (1_000, 3_000, 10_000)


def series_parallel_orders(size: int) -> list[tuple[int, int]]:
    """Steps in series and in parallel by turns, five of each, ten orderings a step at most."""
    pairs: list[tuple[int, int]] = []

    def ends(start: int, number: int, *, is_series: bool) -> tuple[list[int], list[int]]:
        if number == 1:
            return [start], [start]
        cuts = sorted({start + number * part // 5 for part in range(6)})
        parts = [ends(a, b - a, is_series=not is_series) for a, b in pairwise(cuts)]
        if not is_series:
            return [a for first, _ in parts for a in first], [b for _, last in parts for b in last]
        for (_, last), (first, _) in pairwise(parts):
            pairs.extend((a, b) for a in last for b in first[:PER_STEP])
        return parts[0][0], parts[-1][1]

    ends(0, size, is_series=True)
    return pairs


FORMS: dict[str, Callable[[int], list[tuple[int, int]]]] = {
    "random": random_orders,
    "series-parallel": series_parallel_orders,
}


def peak() -> float:
    """Peak resident memory of this process so far [MB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def stages(form: str, size: int) -> Iterator[tuple[str, float]]:
    """Names of the stages of one compilation and how long each took [s]."""
    from planlang.compiler.compile import emit
    from planlang.compiler.lowering import Lowering
    from planlang.ontology import load
    from planlang.recipe import Actions, Ordering, Recipe, RecipeSet, Source, Step
    from planlang.recipe.canonical import canonical
    from planlang.recipe.checks import CheckedFile, CheckedRecipe
    from planlang.recipe.checks.orderings import free_steps, missing_orders
    from planlang.recipe.checks.resources import shared_resources
    from planlang.recipe.order import recipe_cycle
    from planlang.recipe.statements import Statements

    ontology = load(ROOT / "recipes" / "serve_a_drink.omn")
    actions = Actions(ontology)
    names = [f"{BASE}step{number}" for number in range(size)]
    steps = tuple(Step(name, "LookingForSomething", primitive=LOOKING, cls=LOOKING) for name in names)
    orderings = tuple(Ordering(names[a], names[b]) for a, b in FORMS[form](size))
    recipe = Recipe(BASE + "Task", "PurposefulAction", steps, orderings)
    recipes = RecipeSet(recipe.iri, {recipe.iri: recipe}, Source("bench.omn", "0" * 64))
    began = time.process_time()

    def lap() -> float:
        nonlocal began
        now = time.process_time()
        passed, began = now - began, now
        return passed

    assert recipe_cycle(recipe) is None
    yield "cycle search", lap()
    checked = CheckedRecipe(CheckedFile(actions, recipes), recipe, Statements(recipe.iri, recipe.dialect, ()))
    for judged in (missing_orders, free_steps, shared_resources):
        list(judged(checked))
    yield "checks of orders", lap()
    recipes = canonical(recipes)
    yield "canonical order", lap()
    tree = Lowering(ontology, recipes, actions).tree()
    yield "graph, scopes, lowering", lap()
    source, _ = emit(tree, recipes, "bench")
    yield "emit", lap()
    compile(source, "<plan>", "exec")
    yield "import by Python", lap()


def reduction(form: str, size: int, *, with_networkx: bool) -> tuple[float, float, float]:
    """Seconds of the reduction and the decomposition by us, and of the reduction by networkx (0 if left out)."""
    import networkx as nx

    from planlang.compiler.structure import decomposed
    from planlang.recipe.order import Precedence, order_graph

    graph = order_graph(range(size), FORMS[form](size))
    began = time.process_time()
    order: Precedence[int] = Precedence(graph.nodes, graph.edges)
    reducing = time.process_time()
    decomposed(order)
    done = time.process_time()
    theirs = 0.0
    if with_networkx:
        expected = nx.transitive_reduction(graph)
        theirs = time.process_time() - done
        assert set(expected.edges) == set(order.reduction())
    return reducing - began, done - reducing, theirs


def from_file(path: Path) -> dict[str, float]:
    """Seconds of reading a file and of compiling what it says, of the whole process, and its peak of memory [MB]."""
    from planlang.compiler import compile_ontology
    from planlang.kernel.runner import quiet_collector
    from planlang.ontology import load

    with quiet_collector():
        began = time.process_time()
        ontology = load(path)
        read = time.process_time()
        compile_ontology(ontology)
        done = time.process_time()
    return {"reading": read - began, "compiling": done - read, "process": done, "peak": peak()}


def their_reduction(size: int) -> dict[str, float]:
    """Seconds that networkx takes for the reduction of the same orders, and the peak of memory [MB]."""
    import networkx as nx

    graph = nx.DiGraph(random_orders(size))
    began = time.process_time()
    nx.transitive_reduction(graph)
    return {"reduction": time.process_time() - began, "peak": peak()}


def report_files() -> None:
    """Print what recipes from files cost."""
    theirs = {size: measured("--their-reduction", str(size)) for size in FILE_SIZES}
    print(f"{'from a file':24}{'reading':>9}{'rest':>9}{'process':>9}{'peak':>8}{'x':>6}   networkx, reduction alone")
    with tempfile.TemporaryDirectory() as folder:
        for syntax in SYNTAXES:
            first = None
            for size in FILE_SIZES:
                path = write_recipe(Path(folder), syntax, size)
                found = measured("--from-file", str(path))
                path.unlink()
                total = found["reading"] + found["compiling"]
                first = first or total
                seconds = "".join(f"{found[name]:7.2f} s" for name in ("reading", "compiling", "process"))
                peer = theirs[size]
                beside = f"{peer['reduction']:7.2f} s ({peer['reduction'] / total:.1f} x), {peer['peak']:.0f} MB"
                row = f"{syntax}, {size:,} steps"
                print(f"{row:24}{seconds}{found['peak']:5.0f} MB{total / first:6.1f}   {beside}")
    print()


def files() -> Iterator[tuple[str, float]]:
    """Seconds of compiling the bundled recipe, the vocabulary read anew, and with the ontology kept."""
    from planlang.compiler import compile_ontology, compile_recipe
    from planlang.ontology import load

    recipe = ROOT / "recipes" / "serve_a_drink.omn"
    began = time.process_time()
    compile_recipe(recipe)
    yield "serve_a_drink, first in its process", time.process_time() - began

    def median(work: Callable[[], object]) -> float:
        times = []
        for _ in range(7):
            began = time.process_time()
            work()
            times.append(time.process_time() - began)
        return statistics.median(times)

    yield "serve_a_drink, again in the same process", median(lambda: compile_recipe(recipe))
    ontology = load(recipe)
    yield "serve_a_drink, from its ontology", median(lambda: compile_ontology(ontology))


def measured(*arguments: str) -> Any:
    """Return what a process of its own measures, told by JSON."""
    done = subprocess.run([sys.executable, __file__, *arguments], check=True, capture_output=True, text=True)
    return json.loads(done.stdout)


COMPARED = 7
"""Compilations of each checkout that are compared; medians count."""


def against(other: Path) -> None:
    """Print the CPU time of compiling 1,000 steps here and in another checkout, and their ratio."""
    command = [sys.executable, "-c", "import sys, planlang_command; sys.exit(planlang_command.main())", "compile"]

    def seconds(checkout: Path, path: Path) -> float:
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        environment = dict(os.environ, PYTHONPATH=str(checkout))
        subprocess.run([*command, str(path)], check=True, capture_output=True, cwd=checkout, env=environment)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime

    with tempfile.TemporaryDirectory() as folder:
        for syntax in SYNTAXES:
            path = write_recipe(Path(folder), syntax, SIZES[0])
            rounds = [(seconds(ROOT, path), seconds(other, path)) for _ in range(COMPARED + 1)][1:]  # caches filled
            ours, theirs = (statistics.median(times) for times in zip(*rounds, strict=True))
            row = f"{syntax}, {SIZES[0]:,} steps"
            print(f"{row:24}{ours:7.2f} s{theirs:7.2f} s there, ratio {ours / theirs:.2f}")


def report() -> None:
    """Print all measurements."""
    report_files()
    print(f"{'stage':38}{'1,000':>9}{'10,000':>9}{'x':>7}{'us/step':>9}")
    for form in FORMS:
        small, large = (measured("--stages", form, str(size)) for size in SIZES)
        for name, seconds in large["stages"].items():
            before = small["stages"][name]
            row = f"{form}: {name}"
            print(f"{row:38}{before:7.3f} s{seconds:7.3f} s{seconds / before:7.1f}{seconds / SIZES[1] * 1e6:9.0f}")
        one, other = (sum(found["stages"].values()) for found in (small, large))
        print(f"{form + ': all stages':38}{one:7.3f} s{other:7.3f} s{other / one:7.1f}{other / SIZES[1] * 1e6:9.0f}")
        print(f"{form + ': peak of the process':38}{small['peak']:6.0f} MB{large['peak']:6.0f} MB")
    print(f"\n{'random orders':38}{'ours':>9}{'networkx':>10}{'ratio':>7}")
    for size in SIZES:
        ours, decomposing, theirs = measured("--reduction", "random", str(size))["seconds"]
        print(f"{f'reduction, {size:,} steps':38}{ours:7.3f} s{theirs:8.3f} s{theirs / ours:7.1f}")
        print(f"{f'decomposition, {size:,} steps':38}{decomposing:7.3f} s")
    alone, both = (measured("--reduction", "random", str(SIZES[1]), *more)["peak"] for more in (["--alone"], []))
    print(f"{f'peak of the process, {SIZES[1]:,} steps':38}{alone:6.0f} MB{both:7.0f} MB{both / alone:7.1f}")
    print()
    for name, seconds in measured("--files")["stages"].items():
        print(f"{name:44}{seconds:7.3f} s")


def main() -> None:
    """Print the report, or measure one row of it."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--stages", nargs=2, metavar=("FORM", "SIZE"))
    parser.add_argument("--reduction", nargs=2, metavar=("FORM", "SIZE"))
    parser.add_argument("--from-file", type=Path, metavar="RECIPE")
    parser.add_argument("--their-reduction", type=int, metavar="SIZE")
    parser.add_argument("--alone", action="store_true", help="without networkx")
    parser.add_argument("--files", action="store_true")
    parser.add_argument("--against", type=Path, metavar="CHECKOUT")
    chosen = parser.parse_args()
    from planlang.kernel.runner import quiet_collector

    if chosen.stages:
        with quiet_collector():
            found = dict(stages(chosen.stages[0], int(chosen.stages[1])))
        print(json.dumps({"stages": found, "peak": peak()}))
    elif chosen.reduction:
        form, size = chosen.reduction
        print(json.dumps({"seconds": reduction(form, int(size), with_networkx=not chosen.alone), "peak": peak()}))
    elif chosen.from_file:
        print(json.dumps(from_file(chosen.from_file)))
    elif chosen.their_reduction:
        print(json.dumps(their_reduction(chosen.their_reduction)))
    elif chosen.against:
        against(chosen.against.resolve())
    elif chosen.files:
        print(json.dumps({"stages": dict(files())}))
    else:
        report()


if __name__ == "__main__":
    main()
