"""Nodes of a run, and its lanes, one per resource, for the page."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from planlang.designators import local_name
from planlang.relations import named as relation_named
from planlang.runs.run_tree import DECISIONS, Changes, Happened, RunTree, TaskNode, rounded

Held = tuple[str, TaskNode, int, int | None]
"""A resource, the node that held it, and its first and last step."""
PLUMBING = frozenset({"branch", "budget", "with_failure_handling", "using", "at_location", "achieve", "with_policies"})
"""Kinds of constructs that are rarely of interest: hidden unless all nodes are shown, or a failure arose in them."""
MOST_TEXT = 400
"""Maximum length of a text about a node; the middle of a longer one is left out."""
_KEYS = re.compile(r"(?<![^ ])([a-z_]+)=(True\b)?")
UNSAID = re.compile(r"after_failure=(?:\([^()]*\)|\w+)(?:, )?")
"""A property that names classes of failures: what follows a failure is told after it."""
_RELATION = re.compile(r"(?:\bto (?:location )?)?\b([a-z_]+)\((\w+)\)(?: with \w+)?")
_ON_THE_FLOOR = re.compile(r"\bpose \(([-\d.e]+), ([-\d.e]+), -?0; ([-\d.e]+)\)")
_GRASP = re.compile(r", (side|tilted|top)(?=, heading )")
_GRASPS = {"side": "from the side", "tilted": "at a tilt", "top": "from above"}
_FOLDERS = re.compile(r"(?<![\w:/.<])(?:[A-Za-z]:)?(?:[/\\][^\s/\\:'\"<>|]+)+[/\\](?=[^\s/\\:'\"<>|])")


def shown(text: object, longest: int = MOST_TEXT) -> str:
    """Remove folders of this machine from a text, and cut its middle to ``longest`` characters."""
    plain = _FOLDERS.sub("", str(text))
    return plain if len(plain) <= longest else f"{plain[: longest // 2]} ... {plain[-longest // 2 :]}"


def nodes_of(tree: RunTree, labels: Mapping[str, str], index: Mapping[int, int]) -> list[dict[str, Any]]:
    """Build the nodes in the order of their numbers; ``index`` maps them to the entries of their failures in the table.

    ``labels`` maps classes of actions (local names) to the labels of the recipe.
    """
    held = [(name, node, begun, ended) for node in tree.numbered.values() for name, begun, ended in _held(node)]
    within: dict[int, bool] = {}  # filled in one pass, because parents come before children
    nodes = []
    for number, node in sorted(tree.numbered.items()):
        parent = node.parent
        inside = parent is not None and (within[parent.number] or parent.is_request)
        within[number] = inside
        entry = _node(node, labels, inside, index.get(number), tree.rate)
        if node.kind == "branch" and parent is not None and parent.kind == "perform":  # the request of an action
            entry["wait"] = _wait(node, held, tree.rate, labels)
        nodes.append(entry)
    return nodes


def _wait(node: TaskNode, held: Sequence[Held], rate: float, labels: Mapping[str, str]) -> list[Any] | None:
    """``[end of the wait s or None, "base (held by Drive)"]`` if a request waits for its resources, else None.

    Steps that hold them are called by their labels, if they have any.
    """
    if node.begun is None:
        return None
    granted = next((one for one in node.happened if one.event == "acquired"), None)
    until = node.ended if granted is None else granted.step
    if until is not None and until <= node.begun:
        return None
    wanted = None if granted is None else {str(one) for one in granted.details.get("resources", ())}
    holders = {
        name: labels.get(class_of(holder) or "", holder.name)
        for name, other, begun, ended in held
        for holder in (other.parent if other.is_request and other.parent is not None else other,)
        if begun <= node.begun and (ended is None or ended > node.begun)
        if (wanted is None or name in wanted) and not _is_around(other, node)
    }
    what = " and ".join(f"{name} (held by {holder})" for name, holder in sorted(holders.items()))
    return [None if until is None else _seconds(until / rate), shown(what or ", ".join(sorted(wanted or ())), 120)]


def _is_around(other: TaskNode, node: TaskNode) -> bool:
    above: TaskNode | None = node
    while above is not None and above is not other:
        above = above.parent
    return above is other


def class_of(node: TaskNode) -> str | None:
    """Local name of the class that a node performs or follows; None for a construct."""
    iri = node.parameters.get("iri")
    return node.action or (local_name(iri) if isinstance(iri, str) else None)


def _node(
    node: TaskNode, labels: Mapping[str, str], is_inner: bool, failure: int | None, rate: float
) -> dict[str, Any]:
    cls = class_of(node)
    entry: dict[str, Any] = {
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
    return entry | {key: value for key, value in optional.items() if value or (value == 0 and value is not False)}


def is_minor(node: TaskNode) -> bool:
    """True if a node is hidden by default: a construct, or an internal node of a process module."""
    return node.inner or _is_plumbing(node)


def _is_plumbing(node: TaskNode) -> bool:
    """True if a construct is hidden by default; also a root whose only plan has the same name."""
    if node.parent is None:
        inner = node.children
        while len(inner) == 1 and inner[0].kind in PLUMBING and inner[0].name != node.name:
            inner = inner[0].children
        return len(inner) == 1 and inner[0].name == node.name
    return node.kind in PLUMBING and (node.is_request or not is_origin(node)) and not _is_named(node)


def _is_named(node: TaskNode) -> bool:
    """True if a branch belongs to the plan: it is parallel to others, or is a plan function itself."""
    if node.kind != "branch" or node.is_request or node.parent is None:
        return False
    is_beside = node.parent.kind not in PLUMBING and node.parent.kind not in ("perform", "plan")
    return is_beside or any(one.event == "plan" for one in node.happened)


def text_of(node: TaskNode) -> str:
    """Describe a node: its action, goal or location, or the parameters of a plan."""
    match node.parameters:
        case {"action": str(text)}:
            return shown(node.named(_parameters(node.name, rounded(text))))
        case {"goal": str(text)} | {"location": str(text)} | {"policy": str(text)}:
            return shown(node.named(text))
        case {"parameters": dict(values)} if values:
            return shown(node.named(", ".join(f"{name} = {value}" for name, value in values.items())))
    return ""


def _parameters(name: str, action: str) -> str:
    """Action without its class if the node has the same name, with parameters in words."""
    cls, opened, inside = action.partition("(")
    if cls != name.partition("#")[0] or not opened or not inside.endswith(")"):
        return action
    return properties_text(inside.removesuffix(")"))


def properties_text(properties: str, short: Mapping[str, str] | None = None) -> str:
    """Spell out the names of properties (``to_location=bed1``), or put what they are ``short`` for.

    One that is simply true is told by its name alone, one that names classes of failures not at all. Relations to a
    thing are in words, too: ``to_location=in_front_of(cup1) with gripper`` becomes ``in front of cup1``.
    """
    names, said = short or {}, UNSAID.sub("", properties)
    spelt = _KEYS.sub(lambda key: names.get(key[1], key[1].replace("_", " ") + ("" if key[2] else " ")), said)
    return in_words(spelt)


def in_words(text: str) -> str:
    """Put relations to a thing in words: ``in_reach_of(anna), right arm`` becomes ``in reach of anna, right arm``.

    A pose on the floor becomes that of a base: ``pose (1, 2, 0; 0.5)`` becomes ``x 1.00 y 2.00 yaw 0.50``; the class of
    a grasp says from where the hand comes: ``grasp cup1, top, heading 0.1`` becomes ``grasp cup1 from above, ...``.
    """

    def spoken(found: re.Match[str]) -> str:
        relation = relation_named(found[1])
        return f"{relation.forms[0] if relation else found[1].replace('_', ' ').strip()} {found[2]}"

    placed = _ON_THE_FLOOR.sub(lambda found: pose_text([float(number) for number in found.groups()]), text)
    return _RELATION.sub(spoken, _GRASP.sub(lambda found: f" {_GRASPS[found[1]]}", placed))


def event_text(one: Happened) -> str | None:
    """Describe an event of a node; None if its span or its lane shows it already."""
    failure = one.details.get("failure")
    because = f": {failure['message']}" if isinstance(failure, Mapping) else ""
    match one.event, one.details:
        case "attempt", {"attempt": int(number)}:
            return f"attempt {number}" if number > 1 else None
        case "recovery", {"decision": str(decision)}:
            return shown(f"{DECISIONS[decision]}{because}") if decision in DECISIONS else None
        case "solution", {"base": list(base), "attempt": int(number), **more}:
            return shown(f"base pose {number}: {pose_text(base)}{_arm(more.get('detail'))}")
        case "pose failed", _:
            return shown(f"nothing came of this place{because}")
        case "no more poses", {"attempt": 1}:
            return shown(f"there is no place to stand{because}")
        case "no more poses", _:
            return shown(f"there is no further place to stand{because}")
        case "transition", {"state": str(state), "to": to, **more}:
            return shown(f"{state} to {to}: {more.get('outcome', '')}{because}")
        case "plan" | "request" | "acquired" | "released", _:
            return None
    inside = ", ".join(f"{key} {value}" for key, value in one.details.items() if key != "failure")
    return shown(f"{one.event}: {inside}{because}" if inside else f"{one.event}{because}")


def pose_text(base: list[Any]) -> str:
    """Format a pose of the base: metres and radians in the map."""
    rounded = (round(number, 2) + 0.0 for number in base)  # no negative zero
    return " ".join(f"{name} {number:.2f}" for name, number in zip(("x", "y", "yaw"), rounded, strict=False))


def _arm(detail: object) -> str:
    match detail:
        case {"arm": str(arm), "reaches": list(reaches)}:
            return f", {arm} arm: {in_words('; '.join(map(str, reaches)))}"
        case {"arm": str(arm)}:
            return f", {arm} arm"
    return ""


def lanes_of(tree: RunTree) -> list[dict[str, Any]]:
    """Build a lane for each resource: its name, and spans [start s, end s, node, depth of nesting].

    A span without an end (None) lasts to the end of the trace. Process modules come after the robot's own resources.
    """
    lanes: dict[str, list[list[Any]]] = {}
    for number, node in tree.numbered.items():
        for resource, begun, ended in _held(node):
            end = None if ended is None else _seconds(ended / tree.rate)
            lanes.setdefault(resource, []).append([_seconds(begun / tree.rate), end, number, 0])
    for spans in lanes.values():
        spans.sort(key=lambda span: (span[0], span[2]))
        enclosing: list[list[Any]] = []
        for span in spans:
            enclosing = [other for other in enclosing if other[1] is None or other[1] > span[0]]
            span[3] = len(enclosing)
            enclosing.append(span)
    names = sorted(lanes, key=lambda name: (name.startswith("module "), name))
    return [{"name": shown(name, 60), "spans": lanes[name]} for name in names]


def _held(node: TaskNode) -> Iterator[tuple[str, int, int | None]]:
    """Yield the resources that a node has held, with first and last step."""
    begun: dict[str, int] = {}
    for one in node.happened:
        for resource in one.details.get("resources", ()) if one.event in ("acquired", "released") else ():
            if one.event == "acquired":
                begun[resource] = one.step
            elif resource in begun:
                yield str(resource), begun.pop(resource), one.step
    yield from ((str(resource), step, node.ended) for resource, step in begun.items())


def marks_of(tree: RunTree) -> list[list[Any]]:
    """List events in time: [time s, node or None, "attempt", "recovery", "failure" or "belief", text]."""
    marks: list[list[Any]] = []
    for number, node in tree.numbered.items():
        for one in node.happened:
            text = event_text(one)
            kind = {"attempt": "attempt", "recovery": "recovery", "pose failed": "failure"}.get(one.event)
            if kind is not None and text is not None:
                marks.append([_seconds(one.step / tree.rate), number, kind, text])
        if is_origin(node):
            marks.append([_seconds(node.end), number, "failure", shown(node.reason)])
    changes = Changes()
    for one in tree.belief:
        if (text := changes.text(one.details)) is not None:
            marks.append([_seconds(one.step / tree.rate), None, "belief", shown(text)])
    return sorted(marks, key=lambda mark: mark[0])


def is_origin(node: TaskNode) -> bool:
    """True if a failure arose in a node, instead of propagating to it from a child."""
    return node.failure is not None and not any(
        child.failure is not None and child.ended == node.ended for child in node.children
    )


def _seconds(time: float | None) -> float | None:
    return None if time is None else round(time, 4)


def names(paths: Iterable[str]) -> list[str]:
    """Names of files without folders."""
    return [path.replace("\\", "/").rsplit("/", 1)[-1] for path in paths]
