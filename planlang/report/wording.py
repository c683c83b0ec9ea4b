"""Describe actions by labels of the recipe, else by those of the vocabulary, else by their names."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import field

from planlang.designators import local_name
from planlang.records import dataclass
from planlang.report.tree import UNSAID, class_of, pose_text, properties_text, shown
from planlang.runs.run_tree import TaskNode

_WORDS = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z0-9]+|[^\sA-Za-z0-9_-]+")
_NUMBERED = re.compile(r"[A-Z]?[a-z]*_?\d+")
"""Name of a step that says nothing of it, such as ``Step2``: the class above it does."""
_CONSTRAINTS = re.compile(r"constrained_by=(?:\([^()]*\)|\w+)(?:, )?")
_SEVERAL = re.compile(r"=\(([^()]*)\)")
"""Several values of a property."""
_POSE = re.compile(r"[^(]+\(x=([-\d.]+), y=([-\d.]+), yaw=([-\d.]+)\)")
_HOW = re.compile(r"(device_used=(?:\([^()]*\)|[^,()]+)), (.+)")
"""With what, which is told after what it is done to."""
_SIDE = re.compile(r"(?<==)(left|right)_?(arm|gripper|hand)\b", re.IGNORECASE)
"""A device whose name says which it is, such as ``RightArm``."""
_SHORT = {"object_acted_on": "", "to_location": "to ", "recipient": "to ", "device_used": "with "}
LONGEST = 160
"""Maximum length of the description of an action."""


@dataclass(frozen=True, slots=True)
class Wording:
    """Labels of the recipe and of the vocabulary for classes of actions (local names)."""

    labels: Mapping[str, str] = field(default_factory=dict)
    vocabulary: Mapping[str, str] = field(default_factory=dict)

    def step(self, node: TaskNode) -> str:
        """What a node does: the label of its class or of the plan that performs it, else the words of its name."""
        performing = (one for one in node.children if one.kind == "plan")
        classes = [class_of(one) or "" for one in (node, *performing)]
        above = map(local_name, node.parameters.get("classes", ())) if _NUMBERED.fullmatch(classes[0]) else ()
        found = (*map(self.labels.get, classes), *map(self.vocabulary.get, (classes[0], *above)))
        return next(filter(None, found), None) or words(node.name)

    def of(self, node: TaskNode) -> str:
        """Describe the action of a node, with its goal if that is a pose of the base.

        A label of another class than its own, or a name, fits many actions, so the parameters of the action follow it.
        """
        cls, action = class_of(node) or "", node.named(str(node.parameters.get("action", "")))
        pose = _POSE.fullmatch(action)
        about = f"to {pose_text([float(one) for one in pose.groups()])}" if pose else ""
        if cls not in self.labels and not pose and action.endswith(")"):
            said = UNSAID.sub("", _CONSTRAINTS.sub("", action.partition("(")[2].removesuffix(")")))
            inside = _HOW.sub(r"\2, \1", said)  # before several values lose their brackets
            about = properties_text(_SIDE.sub(_lowered, _SEVERAL.sub(r"=\1", inside)), _SHORT)
        return shown(self.step(node), LONGEST) + (f" ({shown(about, LONGEST)})" if about else "")


def _lowered(side: re.Match[str]) -> str:
    return f"{side[1]} {side[2]}".lower()


def duration(node: TaskNode) -> str:
    """Format the duration of a node."""
    return f"{(node.end or 0.0) - (node.start or 0.0):.1f} s"


def words(name: str) -> str:
    """Split a name of a class or function into words: ``MoveBaseToGraspPose#2`` becomes ``move base to grasp pose``."""
    parts = _WORDS.findall(name.partition("#")[0])
    return " ".join(part if part.isupper() and len(part) > 1 else part.lower() for part in parts) or name
