"""Takes files through everything that reads or writes them, in a process of its own with little memory.

One JSON line in (kind, path), one JSON line out. Whatever is no diagnostic is an answer with a "problem": the
exception with its traceback, or what does not hold.
"""

from __future__ import annotations

import ast
import json
import resource
import signal
import sys
import traceback
import warnings
from collections.abc import Iterable
from pathlib import Path

from planlang.diagnostics import BadInput, Diagnostic
from tests.support.codes import CODES

MEGABYTES = 1500
SECONDS = 20.0
"""Of computing for one way through one file; what others do on the machine does not count."""

MOST_TASKS = 3


def checked(found: Iterable[object], path: Path, lines: int) -> None:
    """Every diagnostic can be shown, and stands inside its file."""
    for one in found:
        assert isinstance(one, Diagnostic)
        json.dumps(one.as_json())
        assert one.code in CODES, f"{one.code} is no code"
        assert len(str(one)) < 20_000, f"{one.code} has a message of {len(str(one))} characters"
        if one.span is not None and one.span.file == str(path):
            assert 1 <= one.span.line <= lines + 1, f"{one} is behind the last line, {lines}"
            assert one.span.column >= 1, f"{one} is left of the first column"


def refused(problem: BadInput, path: Path, lines: int) -> None:
    """Assert that what is refused is refused for a reason."""
    assert problem.diagnostics, "refused without a reason"
    checked(problem.diagnostics, path, lines)


def recipe(path: Path, lines: int) -> None:
    """Read, check, compile every task, draw it, and fix."""
    from planlang.compiler import compile_ontology
    from planlang.compiler.drawing import FORMATS, task_graph
    from planlang.ontology import load
    from planlang.recipe.actions import Actions
    from planlang.recipe.fixes.fixing import fix_recipe
    from planlang.recipe.reading import stated_tasks

    ontology = load(path)
    checked(ontology.diagnostics, path, lines)
    for task in (None, *stated_tasks(Actions(ontology))[:MOST_TASKS]):
        try:
            plan = compile_ontology(ontology, task=task)
        except BadInput as problem:
            refused(problem, path, lines)
            continue
        checked(plan.diagnostics, path, lines)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            compile(ast.parse(plan.source), "plan.py", "exec")
        graph = task_graph(plan.recipes, plan.added)
        for draw in FORMATS.values():
            draw(graph)
        fix_recipe(path, task=task)


def environment(path: Path, lines: int) -> None:
    from executive.maps import read_map
    from planlang.ontology import load

    ontology = load(path)
    checked(ontology.diagnostics, path, lines)
    read_map(ontology)


def robot(path: Path, lines: int) -> None:
    from executive.robots.robot import read_self_model
    from planlang.ontology import load

    ontology = load(path)
    checked(ontology.diagnostics, path, lines)
    read_self_model(ontology)


def conversion(path: Path, lines: int) -> None:
    """Write what was read in one of the syntaxes; what those of RDF say is what was read."""
    from planlang.ontology.canonical import differences
    from planlang.ontology.convert import Target, convert
    from planlang.ontology.documents import read_syntax

    target = list(Target)[path.stat().st_size % len(Target)]
    converted = convert(path, target)
    checked(converted.diagnostics, path, lines)
    if target in (Target.TURTLE, Target.NTRIPLES) and converted.triples:
        again = read_syntax(converted.text.encode(), "the text", base=f"file:///{path.name}", label="z").triples
        assert differences(converted.triples, again) == ([], []), f"{target.value} says something else"


WAYS = {
    "recipes": (recipe, conversion),
    "environments": (environment, conversion),
    "objects": (environment,),
    "robots": (robot,),
    "ontologies": (recipe, environment, conversion),
}


class TooLong(BaseException):
    """A file keeps the processor for too long."""


def too_long(*_: object) -> None:
    raise TooLong(f"more than {SECONDS:.0f} seconds of computing")


def problem_of(kind: str, path: Path) -> str | None:
    """Return what went wrong other than by a diagnostic, as text; None if nothing did."""

    content = path.read_bytes()
    lines = max(content.count(b"\n"), content.count(b"\r"), content.count(b"\n\0")) + 1
    for way in WAYS[kind]:
        signal.setitimer(signal.ITIMER_PROF, SECONDS)
        try:
            way(path, lines)
        except BadInput as problem:
            try:
                refused(problem, path, lines)
            except Exception:
                return traceback.format_exc(limit=-12)
        except (Exception, TooLong):
            return traceback.format_exc(limit=-12)
        finally:
            signal.setitimer(signal.ITIMER_PROF, 0)
    return None


def main() -> None:
    limit = MEGABYTES * 1_000_000
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    signal.signal(signal.SIGPROF, too_long)
    answers = sys.stdout
    sys.stdout = sys.stderr  # nothing that is run may speak in between
    for line in sys.stdin:
        kind, path = json.loads(line)
        problem = problem_of(kind, Path(path))
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024
        answers.write(json.dumps({"problem": problem, "megabytes": peak}) + "\n")
        answers.flush()


if __name__ == "__main__":
    main()
