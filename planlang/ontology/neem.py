"""Reader of NEEMs, the episodic memories of EASE: triples, and the poses that were recorded beside them.

A NEEM is a dump of collections of a database, in BSON (mongodump) or in JSON: an array, or documents one after another
(mongoexport). ``triples`` has documents with ``s``, ``p`` and ``o``; ``tf`` has transforms as ROS states them, of
``child_frame_id`` in ``header.frame_id``, at ``header.stamp``. The frame of an object is the local name of its IRI,
and of each frame the latest transform counts.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from planlang.designators import local_name
from planlang.diagnostics import BadInput, Diagnostic, Span, error, unread
from planlang.files import LARGEST_ONTOLOGY, decode, read_file
from planlang.geometry import Pose
from planlang.ontology.bson import documents, is_bson
from planlang.ontology.terms import XSD, BNode, Literal, Term, expand
from planlang.ontology.triples import Parsed, Triples, check_room

TRANSFORMS = ("tf.json", "tf.bson", "ros_tf.json", "ros_tf.bson")
"""Names of the file with the poses, beside the triples; mongodump has it in tf/DATABASE for triples/DATABASE."""
DEEPEST = 100
"""Greatest length of a chain of frames."""
MAP_FRAMES = frozenset(("map", "world", "odom_combined", "odom"))
_GAP = re.compile(r"[\s,\[\]]*")
_SHAPES, _PLACES = ("hasShape", "hasShapeRegion"), ("hasLocalization", "hasSpaceRegion", "pose")


def read_neem(path: Path, content: bytes, *, is_file: bool) -> Parsed:
    """Read the triples of a NEEM, and the poses of their objects from the file beside it. Raises BadInput."""
    file = str(path)
    triples = Triples(file)
    frames: dict[str, tuple[str, Span]] = {}
    shaped, placed = dict[str, Span](), set[str]()
    for document, line in _documents(content, file):
        span = Span(file, line)
        subject, predicate, value = (document.get(key) for key in "spo")
        if not isinstance(subject, str) or not isinstance(predicate, str) or value is None:
            raise BadInput([error("O020", "a triple of a NEEM has s, p and o", span)])
        check_room(triples, line, 1)
        triples.state(_resource(subject), predicate, _term(value), span)
        frames.setdefault(local_name(subject), (subject, span))
        if local_name(predicate) in _SHAPES:
            shaped.setdefault(subject, span)
        elif local_name(predicate) in _PLACES:
            placed.add(subject)
    transforms, recorded = (_recorded(path) if is_file else None) or ({}, b"")
    for name, (iri, span) in frames.items():
        if name in transforms:
            _state_pose(triples, iri, _resolved(name, transforms), span)
            placed.add(iri)
    lost = {iri: span for iri, span in shaped.items() if iri not in placed}
    found = [_without_poses(lost, path, is_recorded=bool(recorded))] if lost else []
    return Parsed(triples, others=(recorded,) if recorded else (), unread=found)


def _without_poses(lost: dict[str, Span], path: Path, *, is_recorded: bool) -> Diagnostic:
    iri, span = next(iter(lost.items()))
    where = f"is in {TRANSFORMS[0]}" if is_recorded else "is here"
    message = f"{len(lost)} objects of this NEEM, such as {local_name(iri)}, have a shape, and no pose of them {where}"
    help = f"poses are in the collection tf: put all of it beside {path.name}, as {TRANSFORMS[0]}"
    return unread("M033", message, span, help)


def _documents(content: bytes, file: str) -> Iterator[tuple[dict[str, Any], int]]:
    """Yield the documents of a file with their lines; those in BSON are all in the first. Raises BadInput."""
    if is_bson(content):
        try:
            yield from ((document, 1) for document in documents(content))
        except ValueError as problem:
            raise BadInput([error("O020", str(problem), Span(file))]) from None
        return
    text, decoder, position, line = decode(content, file), json.JSONDecoder(), 0, 1
    while True:
        gap = _GAP.match(text, position)
        start = gap.end() if gap else position
        line += text.count("\n", position, start)
        if start >= len(text):
            return
        try:
            document, position = decoder.raw_decode(text, start)
        except (ValueError, RecursionError) as problem:
            raise BadInput([error("O020", f"not JSON: {problem}"[:200], Span(file, line))]) from None
        if not isinstance(document, dict):
            raise BadInput([error("O020", f"not an object of JSON: {str(document)[:60]}", Span(file, line))])
        yield document, line
        line += text.count("\n", start, position)


def _resource(name: str) -> str | BNode:
    return BNode(name[2:]) if name.startswith("_:") else name


def _term(value: Any) -> Term:
    """Read a value of JSON; numbers may be those of MongoDB, as {"$numberDouble": "0.5"}."""
    if isinstance(value, dict) and len(value) == 1:
        value = next(iter(value.values()))
    if isinstance(value, bool):
        return Literal(str(value).lower(), XSD.boolean)
    if isinstance(value, int):
        return Literal(str(value), XSD.integer)
    if isinstance(value, float):
        return Literal(repr(value), XSD.double)
    if isinstance(value, list):
        return Literal(" ".join(map(str, value)))
    text = str(value)
    return _resource(text) if re.match(r"_:|[A-Za-z][\w+.-]*:(//|\w+:)", text) and " " not in text else Literal(text)


# Poses

_Transforms = dict[str, tuple[str, Pose]]
"""Frame -> the frame that it is relative to, and its pose there."""


def _recorded(path: Path) -> tuple[_Transforms, bytes] | None:
    """Read the latest transform of each frame from the file beside the triples; None if there is none."""
    dump, database = path.parent.parent.parent, path.parent.name
    dumped = (dump / name.partition(".")[0] / database / name for name in TRANSFORMS)
    places = (*(path.parent / name for name in TRANSFORMS), *dumped)
    place = next((place for place in places if place.is_file()), None)
    if place is None:
        return None
    content = read_file(place, "O001", largest=LARGEST_ONTOLOGY, code_if_large="O003")
    transforms: _Transforms = {}
    latest: dict[str, str] = {}
    for document, line in _documents(content, str(place)):
        several = document.get("transforms")
        for one in several if isinstance(several, list) else [document]:
            try:
                child, header, moved = one["child_frame_id"], one["header"], one["transform"]
                x, y, z = (_number(moved["translation"][axis]) for axis in "xyz")
                a, b, c, d = (_number(moved["rotation"][axis]) for axis in "xyzw")
                if not any((a, b, c, d)):
                    raise ValueError("its rotation is zero")
                pose, parent, stamp = Pose((x, y, z), (a, b, c, d)), header["frame_id"], _stamp(header.get("stamp"))
            except (AttributeError, KeyError, TypeError, ValueError) as problem:
                message = f"a transform of a NEEM has a header, a child_frame_id and a transform: {problem}"
                raise BadInput([error("O020", message[:200], Span(str(place), line))]) from None
            name = str(child).strip("/")
            if stamp >= latest.get(name, ""):
                latest[name], transforms[name] = stamp, (str(parent).strip("/"), pose)
    return transforms, content


def _number(value: Any) -> float:
    number = float(next(iter(value.values()), "") if isinstance(value, dict) else value)
    if not math.isfinite(number):
        raise ValueError(f"not a finite number: {value}")
    return number


def _stamp(value: Any) -> str:
    """Key by which times are ordered: an ISO date, or seconds since 1970, also in an object of MongoDB or ROS."""
    if isinstance(value, dict):
        seconds: Any = value.get("secs", value.get("sec"))
        if seconds is not None:
            nanoseconds: Any = value.get("nsecs", value.get("nanosec", 0))
            return f"{int(seconds):020d}.{int(nanoseconds):09d}"
        return _stamp(next(iter(value.values()), ""))
    return f"{float(value):030.9f}" if isinstance(value, (int, float)) else str(value)


def _resolved(name: str, transforms: _Transforms) -> Pose:
    """Compose a transform with those of its parents, up to the frame that nothing moves."""
    parent, pose = transforms[name]
    for _ in range(DEEPEST):
        if parent in MAP_FRAMES or parent not in transforms:
            break
        parent, above = transforms[parent]
        pose = above @ pose
    return pose


def _state_pose(triples: Triples, iri: str, pose: Pose, span: Span) -> None:
    place = f"{iri}_recorded_pose"
    triples.state(iri, expand("pose"), place, span)
    for prop, row in (("translation", pose.position), ("quaternion", pose.orientation)):
        text = " ".join(repr(round(float(one), 9) + 0.0) for one in row)
        triples.state(place, expand(prop), Literal(text), span)
