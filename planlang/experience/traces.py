"""Activities of a run, from the records of its trace, which may be untrusted.

:mod:`planlang.runs.schema` has checked the types of what is used here without looking.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import field, replace
from itertools import pairwise
from typing import Any

from planlang.designators import local_name
from planlang.experience.model import (
    About,
    Activity,
    Designator,
    Experience,
    Failure,
    Occurrence,
    Resolution,
    ResolvedTo,
    Role,
    State,
    Thing,
)
from planlang.records import dataclass
from planlang.runs.recorded_run import DamagedTrace, checked_records
from planlang.runs.run_tree import Happened, RunTree, TaskNode
from planlang.runs.schema import DEEPEST, LATEST

MOST_ACTIVITIES = 100_000
MOST_STEPS = 1e9
"""Maximum number of steps per second."""
LONGEST = 3e9
"""Maximum duration of a run [s], so that its time stamps are valid dates."""

_OCCURRENCES = frozenset(
    {"attempt", "recovery", "pose failed", "no more poses", "displaced", "skipped", "transition", "policy violated"}
)
_THINGS = ("Object", "Person", "Device")
_WORD = re.compile(r"[^\s(),=]+")
_FILLED = re.compile(r"(\w+)=")


def experience_of(records: Iterable[Mapping[str, Any]]) -> Experience:
    """Extract the experience from the records of a trace, the header first. Raises DamagedTrace."""
    reader = _Reader()
    for number, record in checked_records(records):
        try:
            reader.read(record)
        except (ValueError, TypeError, KeyError, RecursionError) as problem:
            raise DamagedTrace(_reason(problem), number) from None
    return reader.experience()


def _reason(problem: Exception) -> str:
    if isinstance(problem, RecursionError):
        return "too deeply nested"
    return f"{problem} is missing" if isinstance(problem, KeyError) else str(problem)


@dataclass(slots=True)
class _NodeData:
    """Data of a node beside its position in the tree."""

    designator: Designator | None = None
    resolutions: list[Resolution] = field(default_factory=list)
    occurrences: list[Occurrence] = field(default_factory=list)


class _Reader:
    def __init__(self) -> None:
        self._header: Mapping[str, Any] = {}
        self._tree, self._data = RunTree(), dict[int, _NodeData]()
        self._things: dict[str, Thing] = {}
        self._bound: dict[str, str] = {}
        self._lone: list[Resolution] = []
        """Resolutions of things, which belong to the whole run."""

    def read(self, record: Mapping[str, Any]) -> None:
        event, step, rate = str(record["event"]), int(record["step"]), self._tree.rate
        if event == "header":
            self._header, rate = record, record["rate"]
            if rate > MOST_STEPS:
                raise ValueError("the rate is not a valid number of steps per second")
            if "plan" not in record:
                raise KeyError("plan")
        if step > min(LATEST, rate * LONGEST):
            raise ValueError(f"step {step} is too late")
        self._find_things(record, step)
        if "node" in record:
            self._check(record)
        node = self._tree.add(record)
        if node is not None:
            self._in_node(event, step, node)

    def _check(self, record: Mapping[str, Any]) -> None:
        number = record["node"]
        if number in self._data:
            return
        if len(self._data) == MOST_ACTIVITIES:
            raise ValueError(f"more than {MOST_ACTIVITIES:,} nodes")
        parent = record["parent"]
        if parent is not None and (type(parent) is not int or parent not in self._data or parent > number):
            raise ValueError("the parent of a node has not started")
        self._data[number] = _NodeData()

    def _in_node(self, event: str, step: int, node: TaskNode) -> None:
        data = self._data[node.number]
        if event == "started":
            data.designator = _designator(node.parameters) or data.designator
        if node.kind == "plan" and event in ("started", "plan"):
            self._resolve(node, step, ResolvedTo.PLAN, _text(node.parameters.get("iri") or node.name))
        elif node.happened and node.happened[-1].event == event:
            self._happened(data, node, node.happened[-1])

    def _happened(self, data: _NodeData, node: TaskNode, event: Happened) -> None:
        more = dict(event.details)
        if event.event == "request":
            self._resolve(node, event.step, ResolvedTo.MODULE, more["module"])
        elif event.event == "solution" and data.designator is not None:
            base, at = tuple(map(float, more.pop("base"))), ResolvedTo.BASE_POSE
            data.resolutions.append(Resolution(event.step, data.designator, at, base=base, details=more))
        elif event.event in _OCCURRENCES:
            failure = failure_of(more.pop("failure")) if "failure" in more else None
            data.occurrences.append(Occurrence(event.step, event.event, more, failure))
            if event.event == "pose failed" and data.resolutions:
                data.resolutions[-1] = replace(data.resolutions[-1], failure=failure)

    def _resolve(self, node: TaskNode, step: int, to: ResolvedTo, value: str) -> None:
        """Note the solution of the action designator at the parent of a node."""
        above = None if node.parent is None else self._data[node.parent.number]
        if above is not None and above.designator is not None and above.designator.about is About.ACTION:
            above.resolutions.append(Resolution(step, above.designator, to, value))

    def _find_things(self, record: Mapping[str, Any], step: int) -> None:
        """Note the designators of things in a record, and the objects that the belief has bound them to."""
        stack: list[tuple[Any, int]] = [(record, 0)]
        while stack:
            value, depth = stack.pop()
            if depth > DEEPEST:
                raise ValueError(f"more than {DEEPEST} nested lists or objects")
            if isinstance(value, list):
                stack += ((one, depth + 1) for one in value)
            elif isinstance(value, dict):
                thing = _thing(value)
                if thing is not None:
                    self._things.setdefault(thing.name, thing)
                bound = value.get("bound")
                if isinstance(bound, list):
                    self._note_bound(bound, step)
                stack += ((one, depth + 1) for one in value.values())

    def _note_bound(self, bound: list[Any], step: int) -> None:
        for pair in bound:
            match pair:
                case [dict(what), str(name)]:
                    thing = _thing(what)
                    if thing is not None and self._bound.get(thing.name) != name:
                        self._bound[thing.name] = name
                        designator = Designator(About.OBJECT, thing.name)
                        self._lone.append(Resolution(step, designator, ResolvedTo.THING, name))

    def experience(self) -> Experience:
        header = self._header
        words = {name: text if isinstance(text := header.get(name), str) else None for name in ("iri", "robot", "map")}
        numbers = {
            name: number if type(number := header.get(name)) is int and abs(number) <= LATEST * LATEST else None
            for name in ("seed", "schedule")
        }
        activities = tuple(self._activities())
        return Experience(
            header["plan"],
            self._tree.rate,
            words["iri"],
            numbers["seed"],
            numbers["schedule"],
            words["robot"],
            words["map"],
            bool(activities) and activities[0].state is not State.RUNNING,
            activities,
            tuple(self._things[name] for name in sorted(self._things)),
        )

    def _activities(self) -> Iterator[Activity]:
        root = next(iter(self._data), None)
        for number, node in sorted(self._tree.numbered.items()):
            data = self._data[number]
            action = data.designator is not None and data.designator.about is About.ACTION
            text = "" if data.designator is None else data.designator.text
            named = [word for word in _WORD.findall(text.partition("(")[2] if action else text) if word in self._things]
            yield Activity(
                number,
                None if node.parent is None else node.parent.number,
                node.kind,
                node.name,
                State(node.status),
                node.begun,
                node.ended,
                node.parameters,
                node.result,
                None if node.failure is None else failure_of(node.failure),
                data.designator,
                tuple(roles_of(text)) if action else (),
                tuple(sorted(set(named))),
                (*data.resolutions, *(self._lone if number == root else ())),
                tuple(data.occurrences),
            )


def failure_of(json: Mapping[str, Any]) -> Failure:
    """Read a failure of a trace, with its causes."""
    cause = json.get("cause")
    others = ((relation, json.get(relation, ())) for relation in ("siblings", "members", "cleanup"))
    return Failure(
        json["type"],
        json["message"],
        json.get("where"),
        None if cause is None else failure_of(cause),
        tuple(
            (relation, branch, text)
            for relation, several in others
            for branch, text in (several.items() if isinstance(several, dict) else (("", one) for one in several))
        ),
    )


def roles_of(action: str) -> Iterator[Role]:
    """Parse the roles in the text of an action: ``Reaching(device_used=gripper, object_acted_on=cup)``."""
    inside = action.partition("(")[2].removesuffix(")")
    starts: list[int] = []
    depth = 0
    for index, character in enumerate(inside):
        depth += (character == "(") - (character == ")")
        if depth == 0 and (index == 0 or inside.endswith(", ", 0, index)) and _FILLED.match(inside, index):
            starts.append(index)
    for begin, end in pairwise([*starts, len(inside) + 2]):
        key, _, filler = inside[begin : end - 2].partition("=")
        first, *rest = key.split("_")
        yield Role(first + "".join(word.capitalize() for word in rest), filler)


def _designator(parameters: Mapping[str, Any]) -> Designator | None:
    """Designator among the parameters of a started node, if any."""
    for about in (About.ACTION, About.LOCATION, About.GOAL):
        if isinstance(parameters.get(about), str):
            return Designator(about, parameters[about])
    return None


def _thing(value: Mapping[str, Any]) -> Thing | None:
    match value:
        case {"$": str(kind), "type": str(type_), "iri": (str() | None) as iri} if kind in _THINGS:
            return Thing(local_name(iri or type_), kind, type_, iri)
    return None


def _text(value: object) -> str:
    if not isinstance(value, str):
        raise ValueError(f"expected a text, not {str(value)[:40]}")
    return value
