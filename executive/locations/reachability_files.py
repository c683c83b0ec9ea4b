"""Reachability maps as files: those that come with planlang, those in the user's cache, and what is in such a file.

A file is sealed with a key made of the chain, the sampling and a version (:func:`map_key`), and named by its beginning.
So a map is never taken for that of another arm, and what is damaged or stale is built anew.
"""

from __future__ import annotations

import hashlib
import zlib
from collections.abc import Callable

import numpy as np

from executive.locations.reachability import (
    CELL,
    YAWS,
    GraspClass,
    ReachabilityMap,
    carried,
    is_bound,
    row_keys,
    rows_of,
)
from executive.locations.reachability_building import DRAWN, POSTURES, SAMPLING, blocks, build_map, joint_step
from executive.robots.arms import ArmModel
from planlang.cache import Cache, sealed, unsealed
from planlang.files import Bundled

VERSION = 4
"""Raised whenever maps come out otherwise for the same arm, or their files."""
SCORES = 255
"""A score is a whole number of parts of this, so that it is a byte."""
MAPS = Bundled.ROBOT.folder / "maps"
"""Where the maps of the bundled robots are; ``make maps`` writes them."""
_CACHE = Cache("reachability", most=60)

Say = Callable[[str], None]


def reachability_map(
    arm: ArmModel, grasp: GraspClass, robot: str = "", say: Say = lambda line: None
) -> ReachabilityMap:
    """Return the map of an arm and class: the one that came with planlang, from the user's cache, or built now.

    ``say`` is told when it is built, which takes seconds, and if ``robot`` names a bundled robot, why.
    """
    key = map_key(arm, grasp)
    content, why = _bundled_map(arm, grasp, robot, key)
    if content is None:
        content = _CACHE.load(key)
    if content is None:
        say(f"building the reachability map of arm {arm.name}, {grasp.value} grasps, once for this robot{why}")
        content = packed(build_map(arm, grasp))
        _CACHE.keep(key, content)
    return unpacked(content, arm, grasp)


def bundled_file(arm: ArmModel, grasp: GraspClass, robot: str) -> tuple[str, bytes]:
    """Return the name and the content of the file with the map of a bundled robot's arm, built now."""
    key = map_key(arm, grasp)
    return _file_name(arm, grasp, robot, key), sealed(key, packed(build_map(arm, grasp)))


def _bundled_map(arm: ArmModel, grasp: GraspClass, robot: str, key: str) -> tuple[bytes | None, str]:
    """Return a map that came with planlang; None if there is none, and for a bundled robot the reason."""
    name = _file_name(arm, grasp, robot, key)
    path = MAPS / name
    if path.is_file():
        return unsealed(key, path.read_bytes()), f": {path} is damaged"
    others = MAPS.glob(f"{name.removesuffix(_suffix(key))}-*.map")
    return None, ": the URDF is not the one of which planlang has maps" if any(others) else ""


def _file_name(arm: ArmModel, grasp: GraspClass, robot: str, key: str) -> str:
    return f"{robot}-{arm.name}-{grasp.value}{_suffix(key)}"


def _suffix(key: str) -> str:
    return f"-{key[:16]}.map"


def map_key(arm: ArmModel, grasp: GraspClass) -> str:
    """Return a digest of all that a map depends on; the same on all processors, so computed numbers are rounded."""
    lift = None if arm.lift is None else (arm.lift.column, round(arm.lift.per_unit, 9))
    sampling = (POSTURES, DRAWN) if is_bound(arm) else SAMPLING
    facts = (
        VERSION,
        sampling,
        CELL,
        YAWS,
        carried(arm).digest,
        lift,
        grasp.value,
        (arm.frame.approach, arm.frame.closing),
        (arm.seeds.round(9) + 0.0).tolist(),
    )
    return hashlib.sha256(repr(facts).encode()).hexdigest()


def packed(built: ReachabilityMap) -> bytes:
    """Return a map as its file keeps it.

    Rows as steps from key to key, scores as bytes, and which of the postures of its block a row has; postures in steps
    of :func:`joint_step`, in the order of blocks. Bytes of equal significance are together, which compresses well.
    """
    rows, step = built.rows, joint_step(built.arm)
    count = max(len(built.postures), 1)
    pairs, pair = np.unique(blocks(rows, built.arm) * count + rows["posture"], return_inverse=True)
    block, posture = np.divmod(pairs, count)
    _, first, number = np.unique(block, return_index=True, return_inverse=True)
    columns = (
        np.array([len(rows), len(pairs)]),
        np.diff(row_keys(rows), prepend=0),
        np.maximum(np.rint(rows["score"].astype(float) * SCORES), 1).astype(np.uint8),
        (np.arange(len(pairs)) - first[number])[pair].astype(np.uint8),
        np.rint(built.postures[posture] / step).astype(np.int32).ravel(),
    )
    return zlib.compress(
        b"".join(column.view(np.uint8).reshape(-1, column.itemsize).T.tobytes() for column in columns), 9
    )


def unpacked(content: bytes, arm: ArmModel, grasp: GraspClass) -> ReachabilityMap:
    """Return the map of a file; the inverse of :func:`packed`."""
    plain, chain = np.frombuffer(zlib.decompress(content), np.uint8), carried(arm)
    begin = 0

    def column(count: int, kind: type[np.generic]) -> np.ndarray:
        nonlocal begin
        size = np.dtype(kind).itemsize
        planes = plain[begin : begin + count * size].reshape(size, count)
        begin += count * size
        return np.ascontiguousarray(planes.T).view(kind)[:, 0]

    count, postures = column(2, np.int64).tolist()
    rows = rows_of(np.cumsum(column(count, np.int64)))
    rows["score"] = column(count, np.uint8) / SCORES
    number = column(count, np.uint8).astype(np.int64)
    _, rows["posture"] = np.unique(blocks(rows, arm) * (SCORES + 1) + number, return_inverse=True)
    q = column(postures * chain.dof, np.int32).reshape(postures, chain.dof) * joint_step(arm)
    rows.flags.writeable = False
    return ReachabilityMap(arm, grasp, rows, chain.functions.within(q.T).T)
