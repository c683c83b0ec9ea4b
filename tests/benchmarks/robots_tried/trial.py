"""What is done with one robot: its file is made, its parts and reach are asked for, and it brings a bottle.

Each stage is a job of a sweep, in a process of its own with limits; the robot file lies in a folder between them.
"""

from __future__ import annotations

import resource
import time
import traceback
from collections.abc import Callable, Mapping
from contextlib import chdir, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from PIL import Image

from executive.cli import inspect, make
from executive.cli.authoring_arguments import InspectArguments, MakeArguments
from executive.pictures.scene_picture import picture
from executive.robots import Robot, bind_robot
from planlang.diagnostics import BadInput
from planlang.geometry.urdf import read_urdf
from sim import PyBulletWorld, Scene
from tests.benchmarks.robots_tried.truth import Drafted, differences, truth_of
from tests.support.scenarios import Scenario, judged
from tests.support.scenarios.drinks import held

Row = dict[str, Any]
OPENS = 0.07
"""Least opening of a hand that takes the bottle, which is 0.065 m wide [m]."""
SIZE = (150, 150)
"""Width and height of a robot's picture [pixels]."""
HEADER = """Prefix: : <http://robots.example/room.owl#>
Prefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>
Ontology: <http://robots.example/room.owl>
    Import: <http://knowrob.org/kb/knowrob.owl>

Individual: room
    Types: knowrob:SemanticEnvironmentMap
"""
ROOM = {
    "room1": ("RoomInAConstruction", "0 0 1.3", 0, "7 6 2.6"),
    "table1": ("Table-PieceOfFurniture", "2.4 0 0.375", 180, "0.8 1.4 0.75"),
    "bottle1": ("DrinkingBottle", "2.15 0.2 0.85", 0, "0.065 0.065 0.2"),
    "patient1": ("Patient", "-2.4 1.5 0.875", 0, "0.35 0.5 1.75"),
}
"""The room in which robots that drive bring the bottle: class, centre [m], heading [degrees] and size [m]."""
BENCH = {
    "room1": ("RoomInAConstruction", "0 0 1.3", 0, "7 6 2.6"),
    "table1": ("Table-PieceOfFurniture", "0.75 0 0.375", 180, "0.8 1.4 0.75"),
    "bottle1": ("DrinkingBottle", "0.45 -0.3 0.85", 0, "0.065 0.065 0.2"),
    "guest1": ("Person", "0.3 1.05 0.875", -90, "0.35 0.5 1.75"),
}
"""The room of robots that stand at the table; the person stands at its end."""
EXAMPLES = {False: ("serve_a_drink", ROOM, "patient1"), True: ("pass_a_drink", BENCH, "guest1")}
"""By whether the base is fixed: bundled recipe, room, and who gets the bottle."""


def drafted(world: Mapping[str, Any]) -> Row:
    """Make the robot file; return the CPU time [s] and the peak memory [MB] of that, and what was said."""
    file = Path(world["file"])
    with suppress(OSError):  # the process may have made other robots' files before: its peak begins anew
        Path("/proc/self/clear_refs").write_text("5", encoding="ascii")
    began = time.process_time()
    try:
        answer = make.command(MakeArguments(urdf=Path(world["urdf"]), output=file, force=True, quiet=True))
    except BadInput as problem:
        return {"refused": _text(problem)}
    told = [f"{one.severity.value} {one.code}: {one.message}" for one in answer.diagnostics]
    row = {"cpu": round(time.process_time() - began, 1), "memory": _peak(), "told": told}
    return row | _compared(world, bind_robot(file))


def _compared(world: Mapping[str, Any], robot: Robot) -> Row:
    """Return what was drafted, and what of it differs from the truth; draws the robot."""
    kinds = {joint.name: joint.kind for joint in read_urdf(Path(world["urdf"])).joints}
    arms: dict[str, Row] = {}
    for arm in robot.arms:
        turning = [joint for joint in arm.joints if kinds.get(joint) != "prismatic"]
        opening = arm.gripper.max_opening if arm.gripper else None
        arms[arm.name] = {"tip": arm.tip, "hand": arm.hand_link, "opening": opening, "joints": turning}
    found = Drafted(robot.base.fixed, robot.torso or "", robot.camera.link if robot.camera else "", arms)
    stated = world["truth"]
    differs = list(differences(truth_of(stated), found, Path(world["urdf"]))) if stated else None
    _draw(robot, world["picture"])
    return {"fixed": found.fixed, "torso": found.torso, "camera": found.camera, "arms": arms, "differs": differs}


def inspected(world: Mapping[str, Any]) -> Row:
    """Ask what the drafted robot reaches."""
    file = Path(world["file"])
    reach = Path(world["reach"]) if world.get("reach") and world["arms"] else None
    answer = inspect.command(InspectArguments(robot=str(file), picture=reach, force=True, quiet=True))
    return {"reach": {one["name"]: list(one["reachable"].values()) for one in answer.data["arms"]}}


def brought(world: Mapping[str, Any]) -> Row:
    """Let the robot take the bottle from the table and bring it to a person, judged by the simulator's truth."""
    recipe, things, person = EXAMPLES[world["fixed"]]
    mount, file = world["truth"].get("mount"), Path(world["file"]).resolve()
    with TemporaryDirectory() as name, chdir(name):
        folder = Path(name)
        if mount:
            text = file.read_text(encoding="utf-8").replace('urdf = "', f'urdf = "{file.parent.as_posix()}/', 1)
            file = folder / file.name
            file.write_text(f"{text}\n[mount]\nsize = {mount}\n", encoding="utf-8")
        room = folder / "room.omn"
        room.write_text(room_text(things), encoding="utf-8")
        start = "0,0,0" if world["fixed"] else "0,-1,0"
        arguments = (recipe, "--robot", str(file), "--environment", str(room), f"--start={start}")
        sees = () if world["camera"] else ("--trust-map",)
        try:
            found = judged(Scenario("bring", (*arguments, *sees), held("bottle1", person)))
        except BadInput as problem:
            return {"outcome": "refused", "message": _text(problem)}
    unmet = "; ".join(found.unmet)
    said = found.result.message if found.result.failures else unmet
    return {"outcome": found.result.outcome.value, "reached": found.reached, "message": said[:2000]}


def room_text(things: Mapping[str, tuple[str, str, int, str]]) -> str:
    """Return a map of these things, in Manchester syntax."""
    frames = [HEADER]
    for name, (cls, centre, heading, size) in things.items():
        facts = f'knowrob:translation "{centre}", knowrob:heading {heading}, knowrob:boundingBoxSize "{size}"'
        frames.append(
            f"Individual: {name}\n    Types: knowrob:{cls}\n    Facts: knowrob:describedInMap room, {facts}\n"
        )
    return "\n".join(frames)


def safely(job: Callable[[Mapping[str, Any]], Row], world: Mapping[str, Any]) -> Row:
    """Do a stage; an exception that no user should see becomes a row as well."""
    try:
        return job(world)
    except BadInput as problem:
        return {"refused": _text(problem)}
    except Exception as problem:
        where = traceback.extract_tb(problem.__traceback__)[-1]
        return {"internal": f"{type(problem).__name__} at {Path(where.filename).name}:{where.lineno}: {problem}"}


def draft_job(world: Mapping[str, Any]) -> Row:
    """Do the first stage of a sweep."""
    return safely(drafted, world)


def inspect_job(world: Mapping[str, Any]) -> Row:
    """Do the second stage."""
    return safely(inspected, world)


def bring_job(world: Mapping[str, Any]) -> Row:
    """Do the third stage."""
    return safely(brought, world)


def _draw(robot: Robot, to: str) -> None:
    """Draw the robot alone, small."""
    world = PyBulletWorld(Scene(()), robot.body())
    try:
        image = Image.fromarray(picture(world, size=(4 * SIZE[0], 4 * SIZE[1])))
        image.resize(SIZE, Image.Resampling.LANCZOS).save(to)
    finally:
        world.close()


def _peak() -> int:
    """Return the peak memory of this process [MB]."""
    with suppress(OSError, StopIteration):
        lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
        return int(next(line for line in lines if line.startswith("VmHWM")).split()[1]) // 1000
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1000


def _text(problem: BadInput) -> str:
    return "; ".join(f"{one.code} {one.message}" for one in problem.diagnostics[:3])
