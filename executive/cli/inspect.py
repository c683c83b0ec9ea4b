"""``planlang robot inspect``: the parts of a robot, the reach of its arms, and what is missing."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from executive.cli.authoring_arguments import InspectArguments
from executive.cli.capabilities import capability_data, doorway_lines, holding_lines, holds_data, warning_lines
from executive.cli.console import Answer, ExitCode, progress_of
from executive.locations.capabilities import ArmReach, Capabilities, capabilities_of
from executive.locations.reachability import YAWS, GraspClass
from executive.locations.reachability_maps import reachability_map
from executive.options.declaring import check_written
from executive.pictures.drawn import drawn_in
from executive.pictures.reach_picture import save_reach_picture
from executive.robots import CARRYING, Arm, Robot, bind_robot
from executive.robots.arms import arm_models, called, with_carrying
from executive.robots.draft import sunk_in_floor
from executive.robots.mechanism import source_of
from executive.robots.openings import REMEDY
from executive.runs.files import check_files, refuse
from planlang.diagnostics import BadInput, Diagnostic, error
from planlang.extras import no_recorder
from planlang.files import Bundled
from planlang.outputs import replace
from planlang.words import Option
from sim import PlanningWorld, Scene

NAMED = ("prepare_grasp", "handover")
"""Postures that published recipes name as the place of a hand; the recipes of the library name none of them."""


def command(arguments: InspectArguments) -> Answer:
    """Bind a robot, compute the reach of its arms, list and draw it. Raises BadInput."""
    source, urdf = Bundled.ROBOT.find(arguments.robot), arguments.urdf
    problems: list[Diagnostic] = []
    check_files(problems, urdf=urdf)
    problems += check_written(arguments, InspectArguments, {"the robot": source, Option("urdf"): urdf})
    problems += no_recorder() if arguments.record is not None else []
    refuse(problems)
    bare = bind_robot(source, urdf=urdf)
    robot = with_carrying(bare, report=progress_of(arguments))
    world = PlanningWorld(Scene(()), robot.body())
    try:
        return _inspect(bare, robot, world, arguments, urdf or source)
    finally:
        world.close()


def _inspect(bare: Robot, robot: Robot, world: PlanningWorld, arguments: InspectArguments, file: Path) -> Answer:
    picture, record = arguments.picture, arguments.record
    models = arm_models(robot, world)
    bounds = dict(world.robot.limits)
    for output in (picture, record):
        if output is not None and not models:
            raise BadInput([error("C004", f"{output}: {robot.name} has no arm whose reach could be drawn")])
    maps = {
        model.name: {grasp: reachability_map(model, grasp, robot.name, progress_of(arguments)) for grasp in GraspClass}
        for model in models
    }
    if record is not None:
        from executive.pictures.reach_recording import save_reach_recording  # needs an extra

        drawn = drawn_in(world)
        replace(record, lambda path: save_reach_recording(path, drawn, models, maps))
    if picture is not None:
        replace(picture, lambda path: save_reach_picture(path, robot, world, models, maps))
    can = capabilities_of(robot, models, maps, progress_of(arguments))
    lacking = [*_lacking(bare, {model.name: model.bare for model in models}), *filter(None, [sunk_in_floor(world)])]
    lines = [*_body_lines(robot, file), *doorway_lines(can)]
    for arm, reach in zip(robot.arms, can.reaches, strict=True):
        lines += _arm_lines(robot, arm, reach, can, bounds)
    lines += ["postures"]
    for name, joints in robot.postures.items():
        lines.append(f"  {name}: " + ", ".join(f"{joint} {value:.3f}" for joint, value in joints.items()))
    lines += ["missing", *(f"  {what}" for what in lacking or ["nothing"])]
    lines += warning_lines(can)
    arms = [_arm_data(arm, reach, can) for arm, reach in zip(robot.arms, can.reaches, strict=True)]
    data: dict[str, Any] = {"robot": robot.name, "file": str(file), "urdf": str(source_of(robot.urdf)), "arms": arms}
    data |= {"torso": robot.torso, "neck": list(robot.neck), "camera": robot.camera.link if robot.camera else None}
    data |= {"postures": {name: dict(joints) for name, joints in robot.postures.items()}, "missing": lacking}
    data |= capability_data(can)
    code = ExitCode.DONE if robot.arms else ExitCode.MISSING_CAPABILITY
    return Answer(code, robot.diagnostics, text="\n".join(lines), data=data)


def summary(robot: Robot, file: Path) -> Iterator[str]:
    """Summarise a robot in a few lines, without computing its reach."""
    yield from _body_lines(robot, file)
    for arm in robot.arms:
        hand = f"opens {arm.gripper.max_opening:g} m" if arm.gripper else "has no gripper"
        yield f"  {_named(arm)}: {len(arm.joints)} joints from {arm.base_link} to {arm.tip}, {hand}"
    yield f"  postures: {', '.join(robot.postures) or 'none'}"
    yield f"  missing: {'; '.join(_lacking(robot, {})) or 'nothing'}"


def _named(arm: Arm) -> str:
    return arm.name if "arm" in arm.name.split() else f"arm {arm.name}"


def _body_lines(robot: Robot, file: Path) -> Iterator[str]:
    base = robot.base
    yield f"{robot.name} ({file})"
    moves = "fixed" if base.fixed else f"{base.speed:g} m/s, {base.turn_speed:g} rad/s"
    yield f"  base: {robot.base_link}, radius {base.radius:g} m, {moves}"
    yield f"  torso: {robot.torso or 'none'}"
    camera = f"{robot.camera.link}, turned by {', '.join(robot.neck) or 'the base'}" if robot.camera else "none"
    yield f"  camera: {camera}"
    if robot.camera is not None and not (noise := robot.camera.noise).is_exact:
        deviations = f"{noise.position:g} m, {noise.position_per_metre:g} m/m and {noise.angle:g} rad"
        confused = f", confuses {len(noise.confusions)} pairs of classes" if noise.confusions else ""
        yield f"    errs by {deviations}, misses {100 * noise.missing(1.0, 0.5):.0f} % half-way to its range{confused}"


def _arm_lines(
    robot: Robot, arm: Arm, reach: ArmReach, can: Capabilities, bounds: Mapping[str, tuple[float, float]]
) -> Iterator[str]:
    """Describe an arm: hand and what it holds, joints with limits, and reachable poses by grasp."""
    yield f"{_named(arm)}, from {arm.base_link} to {arm.tip}"
    approach, closing = (" ".join(f"{value:g}" for value in axis) for axis in (arm.approach, arm.closing))
    opening = f"opens {arm.gripper.max_opening:g} m" if arm.gripper else "has no gripper"
    yield f"  hand: {arm.hand_link}, approaches along {approach}, closes along {closing}, {opening}"
    yield from holding_lines(can, arm)
    for joint in (*([robot.torso] if robot.torso else []), *arm.joints):
        lower, upper = bounds.get(joint, (-math.inf, math.inf))
        limits = robot.limits[joint]
        yield f"  {joint:32} {lower:8.3f} .. {upper:8.3f}   at most {limits.speed:g} per second"
    grid = " x ".join(f"{100 * step:g}" for step in sorted({*reach.spacing}))
    yield f"  reach, on a grid of {grid} cm and {360 // YAWS} degrees: {', '.join(map(str, reach.reaches))}"
    yield f"  own body: {reach.own_body}"


def _arm_data(arm: Arm, reach: ArmReach, can: Capabilities) -> dict[str, Any]:
    reached = {one.grasp.value: one.poses for one in reach.reaches}
    heights = {one.grasp.value: [one.lowest, one.highest] for one in reach.reaches if one.poses}
    own = {"share": round(reach.own_body.share, 3), "link": reach.own_body.link}
    data = {"name": arm.name, "tip": arm.tip, "joints": list(arm.joints), "reachable": reached, "heights": heights}
    return data | {"own_body": own, "opening": arm.gripper.max_opening if arm.gripper else None} | holds_data(can, arm)


def _lacking(robot: Robot, bare: Mapping[str, str]) -> Iterator[str]:
    """Parts that plans use and the robot lacks; ``bare`` says, by arm, which links of its hand have no shape."""
    if not robot.arms:
        yield "arms"
    for arm in robot.arms:
        if arm.gripper is None:
            cause = bare.get(arm.name)
            yield f"a gripper of {called(arm.name)}" + (f": {cause}; {REMEDY}" if cause else "")
    if robot.torso is None:
        yield "a torso that lifts the arms: they reach fewer heights"
    if robot.camera is None:
        yield "a camera: the robot cannot look for things ([camera] in the robot file)"
    known = robot.postures
    if CARRYING not in known:
        yield "a posture carrying: hands level and close to the body are used ([postures.carrying] in the robot file)"
    for name in NAMED:
        if name not in known:
            yield f"a posture {name}: only recipes that name it need it ([postures.{name}] in the robot file)"
