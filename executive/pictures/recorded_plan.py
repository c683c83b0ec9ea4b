"""The plan in a recording for the rerun viewer: lanes of tasks and resources, and graphs coloured by status.

Importing it needs the package rerun-sdk.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import field

import numpy as np
import rerun
from numpy.typing import NDArray

from executive.pictures.recorded_world import times
from planlang.compiler.drawing import Order, TaskGraph
from planlang.compiler.drawing.layers import layered
from planlang.records import dataclass
from planlang.runs.run_tree import RunTree, TaskNode

LANES, TREE, RECIPE = "lanes", "plan", "recipe"
"""Root entities of this module."""
WAITING, RUNNING, EVAPORATED = (205, 208, 212), (66, 133, 244), (150, 150, 150)
SUCCEEDED, FAILED = (52, 168, 83), (217, 48, 37)
STATUS = {"running": RUNNING, "succeeded": SUCCEEDED, "failed": FAILED, "evaporated": EVAPORATED}
SHADES = ((66, 133, 244), (36, 97, 188))
"""Alternating colours of the tasks in a lane, which make their boundaries visible."""
SHOWN = ("plan", "perform", "state")
"""Kinds of nodes that are always tasks; other constructs are if they repeated something or resolved a location."""
FLASH = 0.5
"""Time for which a failure is shown in its lane [s]."""
MOST_COLOURS = 100_000
"""Largest number of node colours written over time; in large graphs changes are merged."""
COLUMN, ROW = 60.0, 34.0
"""Indentation per level of the tree, and distance of rows [pixels]."""


@dataclass(slots=True)
class Task:
    """A visible node, with its depth among the visible ones."""

    node: TaskNode
    depth: int
    label: str
    above: Task | None
    segments: list[tuple[int, int, str, bool]] = field(default_factory=list)
    """First and last world step, text, and whether this part failed."""


def tasks_of(tree: RunTree, end: int) -> list[Task]:
    """Tasks of a run in preorder; ``end`` is the last world step of the run."""
    tasks: list[Task] = []
    waiting: list[tuple[TaskNode, Task | None]] = [(root, None) for root in reversed(tree.roots)]
    while waiting:
        node, above = waiting.pop()
        if node.begun is not None and _is_task(node):
            above = Task(node, 0 if above is None else above.depth + 1, _label(node), above)
            above.segments = list(_segments(node, above.label, tree.rate, end))
            tasks.append(above)
        waiting += [(child, above) for child in reversed(node.children)]
    return tasks


def _is_task(node: TaskNode) -> bool:
    return node.kind in SHOWN or len(node.repeats) > 1 or any(one.event == "solution" for one in node.happened)


def _label(node: TaskNode) -> str:
    """Label of a task: its last base pose, else its action, else its name."""
    places = _places(node)
    return places[-1][1] if places else node.action or node.name


def _places(node: TaskNode) -> list[tuple[int, str]]:
    """World steps and texts of the base poses that were chosen for a task."""
    solutions = [one for one in node.happened if one.event == "solution"]
    return [(one.step, "at {:.2f}, {:.2f}".format(*one.details["base"][:2])) for one in solutions]


def _segments(node: TaskNode, label: str, rate: float, end: int) -> Iterator[tuple[int, int, str, bool]]:
    """Split a task into its base poses or attempts, if there were several."""
    assert node.begun is not None
    stop = end if node.ended is None else node.ended
    attempts = [(round(time * rate), f"attempt {number}") for number, time in enumerate(node.repeats, 1)]
    begins = next((some for some in (_places(node), attempts) if len(some) > 1), [(node.begun, label)])
    for number, ((begin, words), until) in enumerate(
        zip(begins, [*(at for at, _ in begins[1:]), stop], strict=True), 1
    ):
        if number < len(begins):
            yield begin, until, words, True
        elif node.status == "failed" and node.failure is not None:
            yield begin, until, f"{words}: {node.failure['type']}", True
        else:
            yield begin, until, words, False


def record_lanes(stream: rerun.RecordingStream, tree: RunTree, tasks: Sequence[Task], end: int) -> None:
    """Write lanes of tasks by depth, of failures, and of the holders of resources."""
    rate = round(tree.rate)
    rows: dict[int, list[list[Task]]] = {}
    for task in tasks:
        lanes = rows.setdefault(task.depth, [])
        lane = next((one for one in lanes if one[-1].segments[-1][1] <= task.segments[0][0]), None)
        if lane is None:
            lanes.append([task])
        else:
            lane.append(task)
    for depth, lanes in rows.items():
        for number, lane in enumerate(lanes):
            name = f"{LANES}/plan/{depth:02}" + (f"_beside_{number}" if number else "")
            _lane(stream, name, [part for task in lane for part in task.segments], rate)
    failed = [(task.segments[-1][1], task) for task in tasks if task.node.status == "failed" and _is_origin(task.node)]
    failed.sort(key=lambda one: one[0])
    flashes = [(step, step + round(FLASH * rate), task.segments[-1][2], True) for step, task in failed]
    if flashes:
        _lane(stream, f"{LANES}/failures", flashes, rate)
    for resource, parts in sorted(_holdings(tree, end).items()):
        name = rerun.escape_entity_path_part(resource.replace(" ", "_"))
        _lane(stream, f"{LANES}/resources/{name}", parts, rate)


def _is_origin(node: TaskNode) -> bool:
    """Check whether the failure of a node did not come from a task inside it."""
    waiting = list(node.children)
    for one in waiting:
        if one.status == "failed" and _is_task(one):
            return False
        waiting += one.children
    return True


def _holdings(tree: RunTree, end: int) -> dict[str, list[tuple[int, int, str, bool]]]:
    """Holders of each resource over time; of nested holders the innermost counts."""
    events = [
        (one.step, node.number, one.event, resource)
        for node in tree.numbered.values()
        for one in node.happened
        if one.event in ("acquired", "released")
        for resource in one.details["resources"]
    ]
    holdings: dict[str, list[tuple[int, int, str, bool]]] = {}
    holders: dict[str, list[tuple[int, int]]] = {}
    for step, number, event, resource in sorted(events, key=lambda one: one[0]):
        stack = holders.setdefault(resource, [])
        if stack:
            begin, holder = stack[-1]
            holdings.setdefault(resource, []).append((begin, step, _holder(tree.numbered[holder]), False))
        if event == "acquired":
            stack.append((step, number))
            continue
        stack[:] = [one for one in stack if one[1] != number]
        if stack:
            stack[-1] = (step, stack[-1][1])
    for resource, stack in holders.items():
        if stack:
            begin, holder = stack[-1]
            holdings.setdefault(resource, []).append((begin, end, _holder(tree.numbered[holder]), False))
    return {resource: [part for part in parts if part[1] > part[0]] for resource, parts in holdings.items()}


def _holder(node: TaskNode) -> str:
    """Label of the innermost task around a node that holds a resource."""
    ancestor: TaskNode | None = node
    while ancestor is not None:
        if _is_task(ancestor):
            return _label(ancestor)
        ancestor = ancestor.parent
    return node.name


def _lane(stream: rerun.RecordingStream, entity: str, parts: Iterable[tuple[int, int, str, bool]], rate: int) -> None:
    """Write a lane of parts in chronological order; failed parts are red, gaps are empty."""
    states, last = dict[int, str](), ""
    looks: dict[str, tuple[str, tuple[int, int, int]]] = {}
    """State -> label and colour."""
    for begin, end, words, failed in parts:
        state = f"{words} failed" if failed else words
        state = f"{state} again" if last == state else state  # the viewer would merge equal states
        shade = SHADES[looks.get(last, ("", WAITING))[1] == SHADES[0]]
        looks.setdefault(state, (words, FAILED if failed else shade))
        states[begin] = last = state
        states[max(end, begin + 1)] = ""  # at least one step long, else it would be invisible
    looks[""] = ("", WAITING)
    labels, colours = zip(*looks.values(), strict=True)
    visible = [state != "" for state in looks]  # rerun 0.32 draws the empty state like any other
    look = rerun.StateConfiguration(values=list(looks), labels=labels, colors=colours, visible=visible)
    stream.log(entity, look, static=True)
    steps = sorted(states)
    column = rerun.StateChange.columns(state=[states[step] for step in steps])
    stream.send_columns(entity, indexes=[times(steps, rate)], columns=column)


# Graphs


@dataclass(frozen=True, slots=True)
class _Graph:
    """Labelled nodes with positions [pixels], edges, and changes of colour (world step, node, colour)."""

    labels: Sequence[str]
    places: Sequence[tuple[float, float]]
    edges: Sequence[tuple[int, int]]
    changes: Sequence[tuple[int, int, tuple[int, int, int]]]


def record_tree(stream: rerun.RecordingStream, tree: RunTree, tasks: Sequence[Task]) -> None:
    """Write the tasks as an outline: one per row, indented by depth."""
    numbers = {task.node.number: number for number, task in enumerate(tasks)}
    places = [(COLUMN * task.depth + 4.0 * len(task.label), ROW * number) for number, task in enumerate(tasks)]
    edges = [(numbers[task.above.node.number], number) for number, task in enumerate(tasks) if task.above is not None]
    changes = [change for number, task in enumerate(tasks) for change in _changes(task.node, number)]
    _record_graph(stream, TREE, _Graph([task.label for task in tasks], places, edges, changes), round(tree.rate))


def record_recipe(stream: rerun.RecordingStream, graph: TaskGraph, tree: RunTree) -> None:
    """Write the graph of a recipe and its subrecipes, with steps in the colour of their action's status."""
    labels: list[str] = []
    places: list[tuple[float, float]] = []
    edges: list[tuple[int, int]] = []
    left = 0.0
    for group in graph.groups():
        index = {box.key: number for number, box in enumerate(group.boxes)}
        own = [
            (index[arrow.before], index[arrow.after])
            for arrow in group.of(Order.STATED, Order.ADDED, Order.TRANSITION)
            if arrow.before != arrow.after
        ]
        forward = [(min(edge), max(edge)) for edge in own] if group.of(Order.TRANSITION) else own
        layout = layered([(9.0 * len(box.name) + 20.0, 24.0) for box in group.boxes], forward)
        first = len(labels)
        for box, (x, y) in zip(group.boxes, layout.corners, strict=True):
            labels.append(box.name)
            places.append((left + x + 4.5 * len(box.name) + 10.0, y))
        edges += [(first + before, first + after) for before, after in own]
        left += layout.width + 60.0
    numbers = {label: number for number, label in reversed(list(enumerate(labels)))}
    nodes = (node for node in tree.numbered.values() if node.kind == "perform" and _label(node) in numbers)
    changes = [change for node in nodes for change in _changes(node, numbers[_label(node)])]
    _record_graph(stream, RECIPE, _Graph(labels, places, edges, changes), round(tree.rate))


def _changes(node: TaskNode, number: int) -> Iterator[tuple[int, int, tuple[int, int, int]]]:
    if node.begun is not None:
        yield node.begun, number, RUNNING
    if node.ended is not None:
        yield node.ended, number, STATUS[node.status]


def _record_graph(stream: rerun.RecordingStream, entity: str, graph: _Graph, rate: int) -> None:
    ids = [str(number) for number in range(len(graph.labels))]
    nodes = rerun.GraphNodes(ids, positions=graph.places, labels=list(graph.labels), show_labels=True)
    edges = rerun.GraphEdges([(ids[before], ids[after]) for before, after in graph.edges], graph_type="directed")
    stream.log(entity, nodes, *([edges] if graph.edges else []), static=True)
    if not graph.changes:
        return
    now = np.tile(np.array(WAITING, np.uint8), (len(ids), 1))
    changes = sorted(graph.changes, key=lambda change: change[0])
    stride = 1 + len(changes) * len(ids) // MOST_COLOURS  # changes merged into one row
    due, steps, rows = 0, list[int](), list[NDArray[np.uint8]]()
    for index, (step, number, colour) in enumerate(changes):
        now[number] = colour
        is_last = index + 1 == len(changes)
        if is_last or (changes[index + 1][0] != step and index >= due):
            due = index + stride
            steps.append(step)
            rows.append(now.copy())
    colours = rerun.GraphNodes.columns(colors=np.concatenate(rows)).partition([len(ids)] * len(rows))
    stream.send_columns(entity, indexes=[times(steps, rate)], columns=colours)
