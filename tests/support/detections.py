"""What a camera recognises of believed things."""

from __future__ import annotations

from executive.belief import Belief
from planlang.geometry import Pose
from planlang.protocols import Detection


def detected(belief: Belief, name: str, pose: Pose, visible: float = 1.0) -> Detection:
    """What a camera recognises of a thing as the belief knows it, at a pose."""
    known = belief.features(name)
    return Detection(known.types[0], pose, visible, known.size, label=known.mark, colour=known.colour)


def recognise(belief: Belief, name: str, pose: Pose, visible: float = 1.0) -> None:
    """Let the camera recognise a thing at a pose, and see that it is not where it was believed to be."""
    shown = detected(belief, name, pose, visible)
    in_hands = {name: pose} if name in belief.held else {}
    assert list(belief.see([shown], lambda names: {name}.intersection(names), in_hands)) == [name]


def put(belief: Belief, name: str, pose: Pose) -> None:
    """Let the camera recognise a thing at a pose, and the others of its class where they are believed to be."""
    types, carried = belief.features(name).types, belief.state.carried()
    others = [one for one in belief.names() if one in belief.boxes() and one != name and one not in carried]
    alike = [detected(belief, one, belief.pose(one)) for one in others if belief.features(one).types == types]
    belief.see([detected(belief, name, pose), *alike], lambda names: {name}.intersection(names))
