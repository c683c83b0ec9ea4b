"""Hands that cannot be measured: fingers or palms without a collision shape, or with a box for a missing mesh."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from pathlib import Path
from xml.etree.ElementTree import Element

from executive.robots.mechanism import Mechanism
from planlang.geometry.urdf import read_urdf, tree_of
from sim.description import read_description

REMEDY = "add such shapes to the URDF"
"""What to do about links without a collision shape."""
_SHOWN = 4
"""Number of links that are named."""


def bare_hand(mechanism: Mechanism, hand: str, solid: Collection[str]) -> str:
    """Word which links lack the shape that the opening of a hand follows from: "jaw has no <collision> shape".

    ``solid`` are the links with a collision shape. "" if two sides have one, which is enough to hold a thing: two
    fingers, or one and the palm.
    """
    fingers = {joint.name: _below(mechanism, joint.child) for joint in mechanism.fingers(hand)}
    return without_shapes(mechanism, hand, fingers, solid)


def without_shapes(
    mechanism: Mechanism, hand: str, fingers: Mapping[str, Sequence[str]], solid: Collection[str]
) -> str:
    """Word the same for known ``fingers``: the links that move with each."""
    bare = [links for links in fingers.values() if not any(link in solid for link in links)]
    touching = len(fingers) - len(bare)
    if not fingers or touching > 1:
        return ""
    links = {link.get("name", ""): link for link in read_urdf(mechanism.path).tree.iterfind("link")}
    lacking = _drawn((link for one in bare for link in one), links)  # others may be motors beside a finger
    if not lacking and not touching:
        lacking = [one[0] for one in bare]
    palm = mechanism.rigid_with(hand)
    if (len(fingers) == 1 or not lacking) and not any(link in solid for link in palm):
        lacking += _drawn(palm, links) or [hand]
    if not lacking:
        return ""
    usable = "usable " if any(links[link].find("collision") is not None for link in lacking) else ""
    return f"{in_series(lacking)} {'has' if len(lacking) == 1 else 'have'} no {usable}<collision> shape"


def replaced_meshes(urdf: Path, links: Collection[str]) -> list[str]:
    """List those of some links for whose collision meshes, which are missing or unreadable, there are boxes."""
    description = read_description(urdf)
    before, after = (
        {link.get("name", ""): len(link.findall("collision/geometry/mesh")) for link in tree.iterfind("link")}
        for tree in (read_urdf(urdf).tree, tree_of(description.text.encode()))
    )
    return [link for link in before if link in links and before[link] > after.get(link, before[link])]


def in_series(links: Iterable[str]) -> str:
    """Join the names of links: "a, b and c"."""
    *first, last = links
    if len(first) >= _SHOWN:
        return f"{', '.join(first[:_SHOWN])} and {len(first) + 1 - _SHOWN} others"
    return f"{', '.join(first)} and {last}" if first else last


def _drawn(names: Iterable[str], links: Mapping[str, Element]) -> list[str]:
    """Select the links that are drawn."""
    return [name for name in names if links[name].find("visual") is not None]


def _below(mechanism: Mechanism, link: str) -> list[str]:
    """List a link and all that hang from it."""
    links = [link]
    for one in links:
        links += [joint.child for joint in mechanism.joints.values() if joint.parent == one]
    return links
