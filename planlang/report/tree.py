"""The nodes of a run and its lanes, one for each resource, as the page draws them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from planlang.designators import local_name
from planlang.runs.run_tree import Happened, RunTree, TaskNode

PLUMBING = frozenset({"branch", "budget", "with_failure_handling", "using", "at_location", "achieve", "with_policies"})
"""Kinds of constructs that a reader rarely asks about: shown with all nodes only, unless a failure arose in them."""
MOST_TEXT = 400
"""Characters of a text about a node; the middle of a longer one is left out."""
_KEYS = re.compile(r"(?<![^ ])([a-z_]+)=")
_FOLDERS = re.compile(r"(?<![\w:/.<])(?:[A-Za-z]:)?(?:[/\\][^\s/\\:'\"<>|]+)+[/\\](?=[^\s/\\:'\"<>|])")


def shown(text: object, longest: int = MOST_TEXT) -> str:
    """Return a text without folders of this machine, cut in its middle to ``longest`` characters."""
    plain = _FOLDERS.sub("", str(text))
    return plain if len(plain) <= longest else f"{plain[: longest // 2]} ... {plain[-longest // 2 :]}"


def nodes_of(tree: RunTree, labels: Mapping[str, str], index: Mapping[int, int]) -> list[dict[str, Any]]:
    """Return the nodes in the order of their numbers; ``index`` has the place of a node's failure in the table.

    ``labels`` has the words of a recipe for a class of actions, by its local name.
    """
    within: dict[int, bool] = {}  # parents come before children, and asking each for all above it would take long
    found = []
    for number, node in sorted(tree.numbered.items()):
        parent = node.parent
        inside = parent is not None and (within[parent.number] or parent.is_request)
        within[number] = inside
        found.append(_node(node, labels, inside, index.get(number), tree.rate))
    return found


def class_of(node: TaskNode) -> str | None:
    """Return the local name of the class that a node performs or follows, None for a construct."""
    iri = node.parameters.get("iri")
    return node.action or (local_name(iri) if isinstance(iri, str) else None)


def _node(
    node: TaskNode, labels: Mapping[str, str], is_inner: bool, failure: int | None, rate: float
) -> dict[str, Any]:
    cls = class_of(node)
    found: dict[str, Any] = {
        "id": node.number,
        "parent": None if node.parent is None else node.parent.number,
        "kind": node.kind,
        "name": shown(node.name, 120),
        "text": text_of(node),
        "status": node.status,
        "start": _seconds(node.start),
        "end": _seconds(node.end),
    }
    optional = {
        "class": cls,
        "label": labels.get(cls or ""),
        "minor": is_inner or _is_plumbing(node),
        "failure": failure,
        "events": [
            [_seconds(one.step / rate), one.event, text]
            for one in node.happened
            if (text := event_text(one)) is not None
        ],
    }
    return found | {key: value for key, value in optional.items() if value or (value == 0 and value is not False)}


def is_minor(node: TaskNode) -> bool:
    """Return whether a node is shown with all nodes only: a construct, or what a process module does by itself."""
    return node.inner or _is_plumbing(node)


def _is_plumbing(node: TaskNode) -> bool:
    """Return whether a construct is shown with all nodes only: also a root whose only plan is called like it."""
    if node.parent is None:
        inner = node.children
        while len(inner) == 1 and inner[0].kind in PLUMBING and inner[0].name != node.name:
            inner = inner[0].children
        return len(inner) == 1 and inner[0].name == node.name
    return node.kind in PLUMBING and (node.is_request or not is_origin(node)) and not _is_named(node)


def _is_named(node: TaskNode) -> bool:
    """Return whether a branch is one of the plan's own: side by side with others, or a plan function itself."""
    if node.kind != "branch" or node.is_request or node.parent is None:
        return False
    is_beside = node.parent.kind not in PLUMBING and node.parent.kind not in ("perform", "plan")
    return is_beside or any(one.event == "plan" for one in node.happened)


def text_of(node: TaskNode) -> str:
    """Return what a node does: the action, the goal, the location, or the parameters of a plan."""
    match node.parameters:
        case {"action": str(text)}:
            return shown(_parameters(node.name, text))
        case {"goal": str(text)} | {"location": str(text)} | {"policy": str(text)}:
            return shown(text)
        case {"parameters": dict(values)} if values:
            return shown(", ".join(f"{name} = {value}" for name, value in values.items()))
    return ""


def _parameters(name: str, action: str) -> str:
    """Return an action without its class where the node is called like that, its parameters in words."""
    cls, opened, inside = action.partition("(")
    if cls != name.partition("#")[0] or not opened or not inside.endswith(")"):
        return action
    return _KEYS.sub(lambda found: found[1].replace("_", " ") + " ", inside.removesuffix(")"))


def event_text(one: Happened) -> str | None:
    """Return what happened in a node, in words; None for what its span or its lane shows already."""
    failure = one.details.get("failure")
    because = f": {failure['message']}" if isinstance(failure, Mapping) else ""
    match one.event, one.details:
        case "attempt", {"attempt": int(number)}:
            return f"attempt {number}" if number > 1 else None
        case "recovery", {"decision": "propagate"}:
            return shown(f"the recovery gives up{because}")
        case "recovery", {"decision": str(decision)}:
            return shown(f"recovery: {decision}{because}") if decision != "none" else None
        case "solution", {"base": list(base), "attempt": int(number), **more}:
            return shown(f"base pose {number}: {pose_text(base)}{_arm(more.get('detail'))}")
        case "pose failed" | "no more poses", _:
            return shown(f"{one.event}{because}")
        case "transition", {"state": str(state), "to": to, **more}:
            return shown(f"{state} to {to}: {more.get('outcome', '')}{because}")
        case "plan" | "request" | "acquired" | "released", _:
            return None
    inside = ", ".join(f"{key} {value}" for key, value in one.details.items() if key != "failure")
    return shown(f"{one.event}: {inside}{because}" if inside else f"{one.event}{because}")


def pose_text(base: list[Any]) -> str:
    """Return a pose of the base in words: metres and radians in the map."""
    return " ".join(f"{name} {number:.2f}" for name, number in zip(("x", "y", "yaw"), base, strict=False))


def _arm(detail: object) -> str:
    match detail:
        case {"arm": str(arm), "reaches": list(reaches)}:
            return f", {arm} arm: {'; '.join(map(str, reaches))}"
        case {"arm": str(arm)}:
            return f", {arm} arm"
    return ""


def lanes_of(tree: RunTree) -> list[dict[str, Any]]:
    """Return a lane for each resource: its name, and spans [start s, end s, node, how many hold it around that].

    A span without an end lasts to the end of the trace (None). Process modules come behind the robot's own resources.
    """
    lanes: dict[str, list[list[Any]]] = {}
    for number, node in tree.numbered.items():
        for resource, begun, ended in _held(node):
            end = None if ended is None else _seconds(ended / tree.rate)
            lanes.setdefault(resource, []).append([_seconds(begun / tree.rate), end, number, 0])
    for spans in lanes.values():
        spans.sort(key=lambda span: (span[0], span[2]))
        around: list[list[Any]] = []
        for span in spans:
            around = [other for other in around if other[1] is None or other[1] > span[0]]
            span[3] = len(around)
            around.append(span)
    names = sorted(lanes, key=lambda name: (name.startswith("module "), name))
    return [{"name": shown(name, 60), "spans": lanes[name]} for name in names]


def _held(node: TaskNode) -> Iterator[tuple[str, int, int | None]]:
    """Yield the resources that a node has held, from which step to which."""
    begun: dict[str, int] = {}
    for one in node.happened:
        for resource in one.details.get("resources", ()) if one.event in ("acquired", "released") else ():
            if one.event == "acquired":
                begun[resource] = one.step
            elif resource in begun:
                yield str(resource), begun.pop(resource), one.step
    yield from ((str(resource), step, node.ended) for resource, step in begun.items())


def marks_of(tree: RunTree) -> list[list[Any]]:
    """Return what happened at a moment: [time s, node or None, "attempt", "recovery", "failure" or "belief", words]."""
    found: list[list[Any]] = []
    for number, node in tree.numbered.items():
        for one in node.happened:
            text = event_text(one)
            kind = {"attempt": "attempt", "recovery": "recovery", "pose failed": "failure"}.get(one.event)
            if kind is not None and text is not None:
                found.append([_seconds(one.step / tree.rate), number, kind, text])
        if is_origin(node):
            found.append([_seconds(node.end), number, "failure", shown(node.reason)])
    for one in tree.belief:
        found.append([_seconds(one.step / tree.rate), None, "belief", belief_text(one.details)])
    return sorted(found, key=lambda mark: mark[0])


def is_origin(node: TaskNode) -> bool:
    """Return whether a failure arose in a node, and did not pass through it from one inside of it."""
    return node.failure is not None and not any(
        child.failure is not None and child.ended == node.ended for child in node.children
    )


def belief_text(details: Mapping[str, Any]) -> str:
    """Return a change of the belief in words, without an end: ``bottle1 seen``."""
    word = str(details.get("change", "changed")).replace("_", " ")
    return shown(f"{details.get('name', 'something')} {_CHANGES.get(word, word)}")


_CHANGES = {
    "leads": "held by its handle",
    "led": "moved by its handle",
    "let go": "released",
    "not there": "not where it was believed to be",
    "not seen": "not seen from there",
}


def _seconds(time: float | None) -> float | None:
    return None if time is None else round(time, 4)


def names(paths: Iterable[str]) -> list[str]:
    """Return names of files without folders."""
    return [path.replace("\\", "/").rsplit("/", 1)[-1] for path in paths]
