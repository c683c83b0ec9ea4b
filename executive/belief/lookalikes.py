"""Things that look alike: by what a thing that is meant was taken for what a picture shows, where others could be it.

What the map states of it decides, a mark, a colour or a face, if need be after a closer look; where the map states
nothing, the rule of the association does: each is what is nearest to its place, over all together.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import replace
from enum import StrEnum

from executive.belief.association import Associator
from executive.belief.memory import Memory
from planlang.geometry import Pose
from planlang.protocols import Detection
from planlang.records import dataclass
from planlang.state import WorldState
from sim.camera import READABLE


class By(StrEnum):
    """What decided."""

    MARK = "its mark"
    FACE = "its face"
    COLOUR = "its colour"
    LOOK = "a closer look"
    PLACE = "its place"


@dataclass(frozen=True, slots=True)
class Alike:
    """A thing that is one of several which its class and size, within its gate, do not tell apart."""

    name: str
    others: tuple[str, ...]
    by: By | None
    """What decided which one it is; None if the mark that the map states has to be read first."""
    same: tuple[str, ...] = ()
    """Those of the others that nothing which is known distinguishes from it."""

    def as_change(self) -> dict[str, object]:
        """What a record of the belief says of it."""
        by = None if self.by is None else str(self.by)
        return {"change": "alike", "name": self.name, "others": list(self.others), "by": by}


ShouldShow = Callable[[Collection[str]], Collection[str]]
"""Selects the things that a picture would show."""


def look_alikes(
    found: Mapping[str, Detection],
    associator: Associator,
    state: WorldState,
    memory: Memory,
    should_show: ShouldShow,
) -> dict[str, Alike]:
    """Find the things that plans mean of which a picture shows several; see :func:`look_alike`.

    What was looked for in vain from elsewhere, and is told by a mark now, is told by a closer look.
    """
    carried, named = state.carried(), memory.meant()
    meant = (one for one in found if one in named and one not in carried and not associator.moves_on_a_way(one))
    each = (look_alike(one, found, associator, state.poses, carried, should_show) for one in meant)
    return {
        one.name: replace(one, by=By.LOOK) if one.by not in (None, By.PLACE) and one.name in memory.in_vain else one
        for one in each
        if one is not None
    }


def look_alike(
    name: str,
    found: Mapping[str, Detection],
    associator: Associator,
    poses: Mapping[str, Pose],
    out: Collection[str],
    should_show: ShouldShow,
) -> Alike | None:
    """Find the others that a thing in a picture could be as well; None without any.

    ``found`` are the things that the picture shows, ``poses`` the believed ones before it; ``out`` are no others, as
    hands hold them. ``should_show`` selects things that the picture would show where they are believed: they are not.
    """
    mine, known = found[name], associator.features(name)
    seen = [
        other
        for other, shown in found.items()
        if other != name and other not in out and associator.is_of_kind(shown, name)
        if associator.is_in_gate(shown, name)
    ]
    elsewhere = (one for one in associator.fitting(mine) if one in poses and one not in (name, *found, *out))
    hidden = [one for one in elsewhere if associator.may_be_at(name, poses[one])]
    if hidden:
        missing = should_show(hidden)
        hidden = [one for one in hidden if one not in missing]
    if not seen and not hidden:
        return None
    marked = By.MARK if mine.face_of is None else By.FACE
    features = (marked, known.mark, _mark), (By.COLOUR, known.colour, _colour)
    stated = [one for one in features if one[1] is not None]
    differ = dict[str, By]()
    for by, said, read in features:
        if said is not None or read(mine) is None:  # a map that states no mark means a thing that shows none
            unlike = (one for one in seen if _is_read(found[one], read) and read(found[one]) != said)
            differ |= {one: by for one in unlike if one not in differ}
    like = [one for one in (*seen, *hidden) if one not in differ]
    if like and any(read(mine) is None for _, _, read in stated):
        return Alike(name, (*seen, *hidden), None, tuple(like))

    surely, same = list[str](), list[str]()
    for other in like:  # what cannot be read of others, the map states of those that it has
        of_map = associator.features(other)
        its = {_mark: of_map.mark, _colour: of_map.colour}
        unread = [by for by, said, read in features if not (other in found and _is_read(found[other], read))]
        told = [by for by, said, read in features if by in unread and its[read] != said]
        if "#" in other and unread and told:
            same.append(other)  # what no map has may have the same mark
        elif told:
            differ[other] = told[0]
        else:
            surely.append(other)
    decided = By.PLACE if surely or not (stated or differ) else [*differ.values(), *(by for by, _, _ in stated)][0]
    return Alike(name, (*seen, *hidden), decided, (*surely, *same))


Read = Callable[[Detection], str | None]


def _is_read(shown: Detection, read: Read) -> bool:
    """Check whether a picture shows what a mark is, or that there is none."""
    return read(shown) is not None or shown.visible >= READABLE


def _mark(shown: Detection) -> str | None:
    return shown.label or shown.face_of


def _colour(shown: Detection) -> str | None:
    return shown.colour
