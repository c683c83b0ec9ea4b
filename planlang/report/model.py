"""All data of a page as one JSON object, whose keys docs/guides/report.md documents."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import field
from typing import TYPE_CHECKING, Any

from planlang.designators import local_name
from planlang.diagnostics import Diagnostic
from planlang.records import dataclass
from planlang.report.failures import Failures, cards_of, reasons_in
from planlang.report.sources import Source
from planlang.report.story import story_of
from planlang.report.tree import lanes_of, marks_of, nodes_of, pose_text, shown
from planlang.report.wording import Wording
from planlang.runs.run_tree import RunTree
from planlang.visible import visible
from planlang.words import COMMAND_LINE, said

if TYPE_CHECKING:
    from planlang.compiler.drawing.task_graph import TaskGraph

NEAR = 5
"""Maximum number of lines of a plan between ``at_location`` and the relations of its location."""
_RELATION = re.compile(r"([a-z_]+)\(")
SCHEMA = 1
"""Version of the model."""


@dataclass(slots=True)
class Told:
    """The state of a run as far as its records, added one by one, describe it."""

    header: Mapping[str, Any] = field(default_factory=dict)
    tree: RunTree = field(default_factory=RunTree)
    last: int = 0
    """Step of the last record."""
    reasons: dict[str, Mapping[str, Any]] = field(default_factory=dict)
    """Message of a failure -> data about the failed search, see :func:`planlang.report.failures.reasons_in`."""
    is_interrupted: bool = False

    def add(self, record: Mapping[str, Any]) -> None:
        """Read the next record."""
        self.tree.add(record)
        self.last = max(self.last, record["step"])
        match record:
            case {"event": "header"}:
                self.header = dict(record)
            case {"event": "interrupted"}:
                self.is_interrupted = True
            case {"event": "answer" | "performed", "failure": _}:
                self.reasons.update(reasons_in(record))

    @staticmethod
    def of(records: Iterable[Mapping[str, Any]]) -> Told:
        """Read all records of a trace."""
        run = Told()
        for record in records:
            run.add(record)
        return run


@dataclass(frozen=True, slots=True)
class Context:
    """Data of a page besides the trace: sources of plan and recipe, labels and graph of the recipe.

    ``labels`` maps classes of actions (local names) to the labels of the recipe, ``vocabulary`` to those of imported
    ontologies. ``missing`` are sentences about parts that the page lacks, ``facts`` are shown beside those of the
    header. ``notes`` are diagnostics from before the run, ``remedies`` map a part (local name) that the robot lacks to
    advice.
    """

    plan: Source | None = None
    recipe: Source | None = None
    labels: Mapping[str, str] = field(default_factory=dict)
    vocabulary: Mapping[str, str] = field(default_factory=dict)
    graph: TaskGraph | None = None
    missing: Sequence[str] = ()
    facts: Mapping[str, object] = field(default_factory=dict)
    notes: Sequence[Diagnostic] = ()
    remedies: Mapping[str, str] = field(default_factory=dict)

    @property
    def wording(self) -> Wording:
        """What steps are called."""
        return Wording(self.labels, self.vocabulary)


def model_of(run: Told, context: Context | None = None, **parts: Any) -> dict[str, Any]:
    """Build the model of a run; ``parts`` are further entries, such as scene, map and questions."""
    context = context or Context()
    tree, rate = run.tree, run.tree.rate
    end = round(run.last / rate, 4)
    remedies = {part: said(advice, COMMAND_LINE) for part, advice in context.remedies.items()}
    failures = Failures(tree, run.reasons, remedies)
    wording = context.wording
    nodes = nodes_of(tree, context.labels, failures.index)
    sources = [source for source in (context.plan, context.recipe) if source is not None]
    places = _places(tree, context.plan)
    for node in nodes:
        lines = [[k, *found] for k, one in enumerate(sources) if (found := _extent(one, node)) is not None]
        if node["id"] in places and context.plan is not None:
            line = places[node["id"]]
            lines += [[0, line, line]]
            drive = None if context.recipe is None else context.recipe.extent(context.plan.drives.get(line, ""))
            lines += [] if drive is None else [[1, *drive]]
        node |= {"lines": lines} if lines else {}
    name = str(run.header.get("plan", tree.roots[0].name if tree.roots else "run"))
    model = {
        "schema": SCHEMA,
        "title": shown(name, 120),
        "outcome": _outcome(run, failures),
        "facts": {
            key: shown(said(value, COMMAND_LINE) if isinstance(value, str) else value, 200)
            for key, value in {**_facts(run, end), **context.facts}.items()
        },
        "rate": rate,
        "end": end,
        "nodes": nodes,
        "failures": failures.table,
        "cards": cards_of(tree, failures, wording),
        "lanes": lanes_of(tree),
        "marks": marks_of(tree),
        "story": story_of(tree, wording, failures, end),
        "sources": [{"name": one.name, "text": one.text} for one in sources],
        "graph": None if context.graph is None else _graph(context.graph),
        "missing": list(context.missing),
        "notes": [
            {"severity": one.severity.value, "code": one.code, "message": shown(one.message)}
            | ({"help": shown(one.help)} if one.help else {})
            for one in (note.said(COMMAND_LINE) for note in context.notes)  # what a page advises goes into a shell
        ],
        **parts,
    }
    return {key: _visible(value) for key, value in model.items()}


def _visible(data: Any) -> Any:
    """Escape all texts in a part of the model; names stay equal to each other."""
    if isinstance(data, str):
        return visible(data)
    if isinstance(data, dict):
        return {_visible(key): _visible(value) for key, value in data.items()}
    if isinstance(data, list | tuple):
        return [_visible(one) for one in data]
    return data


def _graph(graph: TaskGraph) -> dict[str, Any]:
    from planlang.report.graph import graph_of  # slow to import, and not needed for a page without a recipe

    return graph_of(graph)


def _places(tree: RunTree, plan: Source | None) -> dict[int, int]:
    """Map ``at_location`` constructs to lines of the plan, assuming that a function visits its places in order.

    Recoveries and process modules also use ``at_location``, but have no line: a line counts only if a relation of the
    location follows it closely.
    """
    line_of: dict[int, int] = {}
    visited: dict[int, list[object]] = {}
    rows = [] if plan is None else plan.text.splitlines()
    for number, node in tree.numbered.items():
        caller = node.parent
        while caller is not None and not any(one.event == "plan" for one in caller.happened) and caller.kind != "plan":
            caller = caller.parent
        lines = plan.places.get(caller.name.partition("#")[0], ()) if plan is not None and caller is not None else ()
        if node.kind != "at_location" or caller is None or not lines:
            continue
        text = str(node.parameters.get("location"))
        relations = _RELATION.findall(text)
        ends = [min(line + NEAR, after) for line, after in zip(lines, [*lines[1:], len(rows) + 1], strict=True)]
        fitting = [
            line
            for line, end in zip(lines, ends, strict=True)
            if any(f"{one}=" in row for row in rows[line - 1 : end - 1] for one in relations)
        ]
        if not fitting:
            continue
        seen = visited.setdefault(caller.number, [])
        if text not in seen:
            seen.append(text)
        line_of[number] = fitting[min(seen.index(text), len(fitting) - 1)]
    return line_of


def _extent(source: Source, node: Mapping[str, Any]) -> tuple[int, int] | None:
    if (extent := source.extent(node.get("class", ""))) is not None:
        return extent
    return source.extent(node["name"].partition("#")[0]) if node["kind"] in ("plan", "branch") else None


def _outcome(run: Told, failures: Failures) -> dict[str, Any]:
    root = run.tree.roots[0] if run.tree.roots else None
    status = "interrupted" if run.is_interrupted else "running" if root is None else root.status
    failure = failures.index.get(root.number) if root is not None else None
    text = {"succeeded": "done", "failed": "failed", "evaporated": "ended", "running": "not ended"}.get(status, status)
    return {"status": status, "text": text, "failure": failure}


def _facts(run: Told, end: float) -> dict[str, object]:
    header = run.header
    facts: dict[str, object] = {"plan time": f"{end:.1f} s"}
    if isinstance(start := header.get("start"), list):
        facts["start"] = pose_text(start)
    for key, label in (("robot", "robot"), ("map", "environment"), ("seed", "seed"), ("schedule", "schedule")):
        value = header.get(key)
        if value is not None:
            facts[label] = local_name(str(value)).partition(".")[0] if key == "map" else value
    if isinstance(world := header.get("world"), dict) and "map" in world:
        there, changes = local_name(str(world["map"])).partition(".")[0], world.get("changes")
        facts["world"] = f"{there}, changed" if changes else there
    versions = header.get("versions")
    if isinstance(versions, dict) and versions.get("planlang"):
        facts["planlang"] = versions["planlang"]
    return facts
