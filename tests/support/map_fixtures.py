"""Small maps, written down in Manchester syntax."""

from collections.abc import Callable, Sequence
from pathlib import Path

import pytest

from executive.maps import SemanticMap, read_map
from planlang.ontology import load

HEADER = """
Prefix: : <http://example.org/map.owl#>
Prefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>
Prefix: xsd: <http://www.w3.org/2001/XMLSchema#>
Ontology: <http://example.org/map.owl>
"""


def _thing(name: str, cls: str, size: Sequence[float | None] = (None, None, None), *facts: str) -> str:
    """A thing with extents along x, y, z and further facts."""
    names = ("depthOfObject", "widthOfObject", "heightOfObject")
    stated = [f"{prop} {float(value)}" for prop, value in zip(names, size, strict=True) if value is not None]
    lines = ", ".join(f"knowrob:{fact}" for fact in ("describedInMap map1", *stated, *facts))
    return f"Individual: {name}\n    Types: knowrob:{cls}\n    Facts: {lines}\n"


def _seen(
    name: str,
    position: Sequence[float],
    rotation: Sequence[float] = (1, 0, 0, 0, 1, 0, 0, 0, 1),
    *,
    number: int = 1,
    time: str | None = None,
    relative_to: str | None = None,
) -> str:
    """A perception of a thing at a position [m] with a rotation matrix, row by row."""
    entries = [f"knowrob:m{i}{j} {float(rotation[3 * i + j])}" for i in range(3) for j in range(3)]
    entries += [f"knowrob:m{i}3 {float(position[i])}" for i in range(3)]
    if relative_to:
        entries.append(f"knowrob:relativeTo {relative_to}")
    facts = [f"knowrob:objectActedOn {name}", f"knowrob:eventOccursAt pose{number}_{name}"]
    if time:
        facts.append(f"knowrob:startTime {time}")
    return (
        f"Individual: seen{number}_{name}\n    Types: knowrob:SemanticMapPerception\n    Facts: {', '.join(facts)}\n"
        f"Individual: pose{number}_{name}\n    Types: knowrob:RotationMatrix3D\n    Facts: {', '.join(entries)}\n"
    )


@pytest.fixture
def map_of(tmp_path: Path) -> Callable[..., SemanticMap]:
    """Reads a map that consists of these frames; with ``ignore_unread``, warns of what cannot be read."""

    def read(*frames: str, ignore_unread: bool = False) -> SemanticMap:
        path = tmp_path / "map.omn"
        path.write_text(HEADER + "\n".join(frames), encoding="utf-8")
        return read_map(load(path), ignore_unread=ignore_unread)

    return read


@pytest.fixture
def thing() -> Callable[..., str]:
    """Writes the frame of a thing: name, class, extents, further facts."""
    return _thing


@pytest.fixture
def seen() -> Callable[..., str]:
    """Writes the frames of a perception: name, position, rotation, and number, time, relative_to by keyword."""
    return _seen
