"""A run as a short story: one sentence for each step of interest, with its time."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from planlang.object_changes import state_word
from planlang.records import dataclass
from planlang.report.failures import Failures
from planlang.report.tree import is_origin, pose_text, shown
from planlang.report.wording import Wording, duration
from planlang.runs.run_tree import CLOSED, DECISIONS, Happened, RunTree, TaskNode


def story_of(tree: RunTree, wording: Wording, failures: Failures, end: float) -> list[list[Any]]:
    """Write the sentences in the order of the trace: [time s, node or None, text, kind].

    Activities of process modules inside an action are left out. A failed step has a sentence at its start, and one with
    the cause at its end; steps that fail one after the other for the same reason tell it once.
    """
    sentences = [one for root in tree.roots for one in _ends(root, wording, failures, end)]
    for node in tree.numbered.values():
        sentences += _happened(node, tree.rate)
        if not node.inner and node.start is not None:
            sentences += _steps(node, wording, failures)
    leaves = dict[str, _Leaf]()
    learnt = ((_learnt(one.details, leaves), one) for one in tree.belief)
    told = {(one.step, text): one for text, one in learnt if text is not None}  # two hands take a thing once
    for (step, text), one in told.items():
        said = _sentence(text) if text.startswith("the robot ") else f"{text}."  # a name is written as it is
        sentences.append((one.place, [round(step / tree.rate, 4), None, said, "belief"]))
    ordered = [sentence for _, sentence in sorted(sentences, key=lambda one: one[0])]
    return [*_each_reason_once(ordered)]


_Placed = tuple[float, list[Any]]
"""Position of a record in the trace, and the sentence about it."""

_LEARNT = {
    "seen": "the robot sees {}",
    "found": "the robot finds {}",
    "felt": "the robot feels {}",
    "grasped": "the robot holds {}",
    "released": "the robot lets go of {}",
    "slipped": "{} slips in the hand",
    "dropped": "{} falls out of the hand",
    "not there": "{} is not where it was believed to be",
    "leads": "the robot takes {} by its handle",
    "slipped off": "the handle of {} slips out of the hand",
    "stuck": "{} does not follow the hand",
}
"""What the robot learns of a thing, as sentences."""
_FAILS = " fails: "


@dataclass(slots=True)
class _Leaf:
    """A door or drawer: its position [rad, m], and that in which a hand last let go of it."""

    value: float = 0.0
    before: float = 0.0

    def left(self, name: str) -> str | None:
        """Tell how far it is open, if it is, now that a hand lets go; large ones are moved in several pulls."""
        before, self.before = self.before, self.value
        if self.value < CLOSED:
            return None
        if before < CLOSED:
            return f"{name} stands open"
        return f"{name} is {'opened further' if self.value >= before else 'partly closed'}"


def _learnt(details: Mapping[str, Any], leaves: dict[str, _Leaf]) -> str | None:
    """Tell what the robot learns; None of what is of no interest. ``leaves`` are the doors and drawers so far."""
    name, change = shown(details.get("name", "something")), details.get("change")
    match details:
        case {"to": str(person)} if change in _LEARNT:
            return f"the robot hands {name} to {shown(person)}"
        case {"change": "switched", "state": str(state)}:
            return f"{name} is {state_word(state).lower()}"
        case {"change": "led", "value": int() | float() as value}:
            leaves.setdefault(name, _Leaf()).value = value
            return f"{name} is closed" if value < CLOSED else None
        case {"change": "let go"}:
            return None if (leaf := leaves.get(name)) is None else leaf.left(name)
        case {"change": "stays open", "because": str(reason)}:
            return f"{name} stays open: {shown(reason)}"
    return _LEARNT[change].format(name) if change in _LEARNT else None


def _each_reason_once(sentences: Iterable[list[Any]]) -> Iterator[list[Any]]:
    """Refer to the reason of a failure that was told last, instead of telling it again."""
    last = ""
    for time, node, text, kind in sentences:
        step, fails, reason = text.partition(_FAILS)
        if kind != "cause" or not fails:
            yield [time, node, text, kind]
        else:
            yield [time, node, f"{step} fails for the same reason." if reason == last else text, kind]
            last = reason


def _ends(root: TaskNode, wording: Wording, failures: Failures, end: float) -> Iterator[_Placed]:
    name = wording.step(_plan_of(root))
    yield root.first, [root.start or 0.0, root.number, _sentence(f"The plan begins: {shown(name, 80)}"), "opening"]
    time = end if root.end is None else round(root.end, 4)
    match root.status:
        case "succeeded":
            text = f"The plan is done after {time:.1f} s."
        case "failed":
            text = f"The plan fails after {time:.1f} s: {failures.lowered(root)}."
        case "running":
            text = "The trace ends here, before the plan does."
        case _:
            text = f"The plan is stopped from outside after {time:.1f} s."
    yield root.last, [time, root.number, text, "closing"]


def _plan_of(root: TaskNode) -> TaskNode:
    """The plan of a run, which has no other plan or action around it; the root if it runs none."""
    inside = [root]
    for node in inside:
        if node.kind == "plan":
            return node
        inside += [one for one in node.children if one.kind != "perform"]
    return root


def _steps(node: TaskNode, wording: Wording, failures: Failures) -> Iterator[_Placed]:
    if node.kind == "perform":
        how = {
            "succeeded": f"done in {duration(node)}",
            "running": "still running at the end of the trace",
            "evaporated": f"stopped after {duration(node)}",
            "failed": f"begins, and fails after {duration(node)}",
        }.get(node.status, node.status)
        mood = "done" if node.status == "succeeded" else "begin"
        if node.status != "failed" or node.end != node.start:
            text = _sentence(f"{wording.of(node)}: {how}")
            yield node.first, [round(node.start or 0.0, 4), node.number, text, mood]
    if node.failure is not None and node.parent is not None and (node.kind == "perform" or _is_bare(node)):
        name = "the search for a place" if node.kind == "at_location" else wording.of(node)
        why = _sentence(f"{name}{_FAILS}{failures.lowered(node)}")
        yield node.last, [round(node.end or 0.0, 4), node.number, why, "cause"]


def _is_bare(node: TaskNode) -> bool:
    """True if a failure arose in a node that no sentence about a step covers."""
    above = node.parent
    while above is not None and above.kind != "perform" and above.ended == node.ended:
        above = above.parent
    return is_origin(node) and not (above is not None and above.kind == "perform" and above.ended == node.ended)


def _happened(node: TaskNode, rate: float) -> Iterator[_Placed]:
    for before, one in zip((None, *node.happened), node.happened, strict=False):
        text = _event(one, before)
        if text is not None:
            yield one.place, [round(one.step / rate, 4), node.number, _sentence(text[0]), text[1]]


def _event(one: Happened, before: Happened | None) -> tuple[str, str] | None:
    match one.event, one.details:
        case "attempt", {"attempt": int(number)} if number > 1:
            is_told = before is not None and before.details.get("decision") == "retry"
            return None if is_told else (f"The plan tries again: attempt {number}", "recovery")
        case "recovery", {"decision": str(decision)} if decision in DECISIONS and decision != "propagate":
            return DECISIONS[decision], "recovery"
        case "solution", {"base": list(base), "attempt": 1}:
            return f"The robot chooses a place to stand: {pose_text(base)}", "begin"
        case "solution", {"base": list(base)}:
            failed = [] if before is None else before.details.get("base", [])  # what was learnt there may help there
            is_same = pose_text(failed) == pose_text(base)
            how = "tries again from the same place" if is_same else "chooses another place to stand"
            return f"The robot {how}: {pose_text(base)}", "recovery"
        case "no more poses", _:
            tried = before is not None and before.event in ("solution", "pose failed")
            return f"There is no {'other ' if tried else ''}place to stand", "cause"
    return None


def _sentence(text: str) -> str:
    return f"{text[:1].upper()}{text[1:]}{'' if text.endswith(('.', '!', '?')) else '.'}"
