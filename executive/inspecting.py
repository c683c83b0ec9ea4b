"""``planlang robot inspect``: what a robot is made of, what its arms reach, and what it lacks."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from executive.arms import arm_models
from executive.assembly import mapped
from executive.capabilities import Arm, Robot, bind_robot
from executive.carrying import with_carrying
from executive.console import Answer
from executive.locations import ArmModel
from executive.locations.reachability import CELL, YAWS, GraspClass, ReachabilityMap
from executive.locations.reachability_building import keep_maps, reachability_maps
from executive.outputs import replace
from planlang.diagnostics import BadInput, error
from sim import PyBulletWorld, Scene

USEFUL = ("carrying", "prepare_grasp", "handover")
"""Postures that plans and the executive ask for."""
SCALE = 6
"""Pixels of a cell."""
MARGIN, CAPTION = 12, 16
BACKGROUND, INK = (255, 255, 255), (40, 40, 40)

Maps = Mapping[GraspClass, ReachabilityMap]


@dataclass(frozen=True, slots=True)
class InspectOptions:
    """What to inspect, and where to draw what the arms reach."""

    robot: Path | str
    urdf: Path | None = None
    picture: Path | None = None
    progress: Callable[[str], None] = lambda line: None


def inspect(options: InspectOptions) -> Answer:
    """Bind a robot, map its arms, say and draw what was found; raises BadInput."""
    bare = bind_robot(options.robot, urdf=options.urdf)
    robot = with_carrying(bare)
    world = PyBulletWorld(Scene(()), robot.body())
    try:
        models = arm_models(robot, world)
        bounds = dict(world.robot.limits)
    finally:
        world.close()
    keep_maps(models, robot.torso, lambda *done: mapped(options.progress, *done))
    maps = {model.name: reachability_maps(model, robot.torso) for model in models}
    if options.picture is not None:
        if not models:
            raise BadInput([error("C004", f"{options.picture}: {robot.name} has no arm whose reach could be drawn")])
        replace(options.picture, lambda path: _drawn(robot, models, maps).save(path, format="PNG"))
    lacking = list(_lacking(bare))
    lines = [*_body_lines(robot)]
    for arm in robot.arms:
        lines += _arm_lines(robot, arm, maps[arm.name], bounds)
    lines += ["postures"]
    lines += [f"  {name}: {_positions(joints)}" for name, joints in robot.postures.items()]
    lines += ["missing", *(f"  {what}" for what in lacking or ["nothing"])]
    arms = [_arm_data(arm, maps) for arm in robot.arms]
    data: dict[str, Any] = {"robot": robot.name, "urdf": str(robot.urdf), "arms": arms}
    data |= {"torso": robot.torso, "neck": list(robot.neck), "camera": robot.camera.link if robot.camera else None}
    data |= {"postures": {name: dict(joints) for name, joints in robot.postures.items()}, "missing": lacking}
    return Answer(diagnostics=robot.diagnostics, text="\n".join(lines), data=data)


def _body_lines(robot: Robot) -> Iterator[str]:
    base = robot.base
    yield f"{robot.name} ({robot.urdf})"
    yield f"  base: {robot.base_link}, radius {base.radius:g} m, {base.speed:g} m/s, {base.turn_speed:g} rad/s"
    yield f"  torso: {robot.torso or 'none'}"
    camera = f"{robot.camera.link}, turned by {', '.join(robot.neck) or 'the base'}" if robot.camera else "none"
    yield f"  camera: {camera}"


def _arm_lines(robot: Robot, arm: Arm, maps: Maps, bounds: Mapping[str, tuple[float, float]]) -> Iterator[str]:
    yield f"arm {arm.name}, from {arm.base_link} to {arm.tip}"
    approach, closing = (" ".join(f"{value:g}" for value in axis) for axis in (arm.approach, arm.closing))
    opening = f"opens {arm.gripper.max_opening:g} m" if arm.gripper else "has no gripper"
    yield f"  hand: {arm.hand_link}, approaches along {approach}, closes along {closing}, {opening}"
    for joint in (*([robot.torso] if robot.torso else []), *arm.joints):
        lower, upper = bounds.get(joint, (-math.inf, math.inf))
        limits = robot.limits[joint]
        yield f"  {joint:32} {lower:8.3f} .. {upper:8.3f}   at most {limits.speed:g} per second"
    reached = ", ".join(f"{grasp.value} {len(found)}" for grasp, found in maps.items())
    yield f"  reaches, of poses {CELL:g} m and {360 // YAWS} degrees apart: {reached}"


def _arm_data(arm: Arm, maps: Mapping[str, Maps]) -> dict[str, Any]:
    reached = {grasp.value: len(found) for grasp, found in maps[arm.name].items()}
    return {"name": arm.name, "tip": arm.tip, "joints": list(arm.joints), "reachable": reached}


def _positions(joints: Mapping[str, float]) -> str:
    return ", ".join(f"{name} {value:.3f}" for name, value in joints.items())


def _lacking(robot: Robot) -> Iterator[str]:
    """What would be of use and is not there."""
    if not robot.arms:
        yield "arms"
    yield from (f"a gripper of the {arm.name} arm" for arm in robot.arms if arm.gripper is None)
    if robot.torso is None:
        yield "a torso that lifts the arms: they reach fewer heights"
    if robot.camera is None:
        yield "a camera: nothing can be looked for ([camera] in the robot file)"
    known = robot.postures
    yield from (f"a posture {name} ([postures.{name}] in the robot file)" for name in USEFUL if name not in known)


# Picture


def _drawn(robot: Robot, models: Sequence[ArmModel], maps: Mapping[str, Maps]) -> Image.Image:
    """A row per arm; per class of grasp the reach from above (x up, y left) and from the right side (x right, z up)."""
    rows = [[_panels(maps[model.name][grasp]) for grasp in GraspClass] for model in models]
    width = max(sum(panel.shape[1] + MARGIN for pair in row for panel in pair) for row in rows) + MARGIN
    heights = [max(panel.shape[0] for pair in row for panel in pair) + CAPTION + MARGIN for row in rows]
    image = Image.new("RGB", (width, sum(heights) + CAPTION + MARGIN), BACKGROUND)
    draw = ImageDraw.Draw(image)
    title = f"{robot.name}: share of headings in reach (blue none, yellow all), from above and from the side"
    draw.text((MARGIN, 4), title, fill=INK)
    top = CAPTION + MARGIN
    for model, row, height in zip(models, rows, heights, strict=True):
        left = MARGIN
        for grasp, pair in zip(GraspClass, row, strict=True):
            draw.text((left, top), f"{model.name}, {grasp.value}", fill=INK)
            for panel in pair:
                image.paste(Image.fromarray(panel), (left, top + CAPTION))
                left += panel.shape[1] + MARGIN
        top += height
    return image


def _panels(found: ReachabilityMap) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    rows = found.rows
    x, y, z = (np.asarray(rows[name], np.intp) for name in ("x", "y", "z"))
    heading = np.asarray(rows["yaw"], np.intp)
    return _panel(-x, -y, heading), _panel(-z, x, heading)


def _panel(down: NDArray[np.intp], right: NDArray[np.intp], heading: NDArray[np.intp]) -> NDArray[np.uint8]:
    """The share of headings of each cell (rows downwards, columns to the right), as pixels."""
    if not len(down):
        return np.full((SCALE, SCALE, 3), 230, np.uint8)
    shape = (int(np.ptp(down)) + 1, int(np.ptp(right)) + 1, YAWS)
    seen = np.zeros(shape, np.bool_)
    seen[down - down.min(), right - right.min(), heading] = True
    share = seen.mean(axis=2)[..., None]
    low, high = np.array([40.0, 60.0, 160.0]), np.array([250.0, 220.0, 60.0])
    pixels = np.where(share > 0, low + share * (high - low), 230.0)
    return np.asarray(np.kron(pixels, np.ones((SCALE, SCALE, 1))), np.uint8)
