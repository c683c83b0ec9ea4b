"""Binding of robots: a self-model (SRDL) or a robot file (TOML) to the links and joints of a URDF."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from executive.robots.limbs import URDF, Limbs, described
from executive.robots.mechanism import Mechanism, Naming, base_joints, grounded, mounted, source_of
from executive.robots.robot import (
    Arm,
    JointLimits,
    Part,
    Robot,
    SelfModel,
    claims_of,
    inherent,
    parts_of,
    read_self_model,
)
from executive.robots.robot_file import (
    RobotFile,
    looks_like_toml,
    looks_like_urdf,
    read_robot,
    read_robot_file,
)
from executive.robots.vetting import vet
from planlang.designators import local_name
from planlang.diagnostics import BadInput, Diagnostic, Span, error, has_errors, note, warning
from planlang.files import Bundled
from planlang.geometry.matrices import inverse, product
from planlang.geometry.urdf import read_urdf
from planlang.ontology import Ontology, load
from planlang.words import Text, calling, joined
from sim import CameraModel
from sim.description import read_description

if TYPE_CHECKING:
    from executive.robots.draft import Draft


_DRIVING = ("BaseMotionCapability", "MobileBase", "WheeledBase")
"""Capabilities and components of a robot that drives."""


def bind_robot(source: Ontology | Path | str, urdf: Path | None = None, folders: Iterable[Path] = ()) -> Robot:
    """Bind the robot that a source describes to a URDF.

    ``source`` is a loaded ontology, a file (self-model, robot file or URDF, recognised by content), or the name of a
    bundled robot. Without ``urdf``, a self-model is bound to the bundled robot whose self-model it is, else to the one
    that has the most of its actuated joints, and all of at least one arm. With ``urdf``, numbers come from a robot file
    of the same stem beside it, if there is one, else from a bundled robot with the same arms, else from a draft.
    Raises BadInput with all errors.
    """
    if isinstance(source, Ontology):
        return _bind_model(read_self_model(source), urdf)
    path = Path(source)
    if not path.is_file():
        path = _bundled_file(str(source))
    if looks_like_toml(path):
        numbers = read_robot_file(path)
        model_path = numbers.self_model
        model = read_self_model(load(model_path, folders=tuple(folders))) if model_path is not None else None
        return _bind(model, numbers, _urdf_of(numbers, urdf))
    if looks_like_urdf(path):
        return _drafted(None, path)
    ontology = load(path, folders=tuple(folders))
    problems = [d for d in ontology.diagnostics if has_errors([d])]
    if problems:
        raise BadInput(problems)
    return _bind_model(read_self_model(ontology), urdf)


def _drafted(model: SelfModel | None, urdf: Path) -> Robot:
    """Bind a robot without a robot file, using the draft of one."""
    from executive.robots.draft import draft_of  # imported late: most robots have a robot file

    naming = None if model is None else Naming(model, Mechanism(grounded(urdf)), [])
    hands = [] if naming is None else [hand for _, hand, _ in described(naming)]
    draft = draft_of(urdf, hands=hands, drives="" if model is None else _drives(model))
    robot = bind_draft(draft, urdf, model)
    made = calling("robot make", urdf, output=Path(f"{urdf.stem}.toml"))
    advice = Text(made, " writes a robot file to complete")
    what = robot.name if model is None else f"what the self-model of {model.name} leaves open"
    origin = note("B010", f"{what} is derived from its URDF alone", Span(str(urdf)), advice)
    name = robot.name if model is None else model.name
    return replace(robot, name=name, diagnostics=(origin, *draft.diagnostics(), *robot.diagnostics), file=None)


def _drives(model: SelfModel) -> str:
    """Say where a self-model states that the base drives: by a capability, or by a part; empty if it does not."""
    stated = [*claims_of(model), *(cls for part in model.components for cls in model.ontology.types(part))]
    found = next((cls for cls in stated if local_name(cls) in _DRIVING), None)
    return "" if found is None else f"{model.name} has {local_name(found)} by its self-model"


def bind_draft(draft: Draft, path: Path, model: SelfModel | None = None) -> Robot:
    """Bind the robot of a draft as if it had been written to ``path``."""
    numbers = read_robot(draft.text().encode(), path)
    return _bind(model, numbers, numbers.urdf)


def robots() -> tuple[str, ...]:
    """List the names of the bundled robots, sorted."""
    return tuple(sorted(path.stem for path in Bundled.ROBOT.folder.glob("*.toml")))


def _bundled_file(name: str) -> Path:
    if name not in robots():
        help = f"give the path of a file, or the name of a bundled robot: {', '.join(robots())}"
        raise BadInput([error("B008", f"there is no robot {name}", None, help)])
    return Bundled.ROBOT.folder / f"{name}.toml"


def _bind_model(model: SelfModel, urdf: Path | None) -> Robot:
    if urdf is not None:
        beside = urdf.with_suffix(".toml")
        numbers_beside = read_robot_file(beside) if beside.is_file() else _numbers_for(urdf)
        if numbers_beside is not None:
            return _bind(model, numbers_beside, _urdf_of(numbers_beside, urdf))
        return _drafted(model, urdf)
    absent: dict[str, str] = {}
    numbers = _matching(model, absent)
    if numbers is None:
        span = model.span or Span(str(model.ontology.documents[0].path))
        compared = ", ".join(name for name in robots() if name not in absent)
        message = f"no bundled robot ({compared}) has the joints of an arm of {model.name}"
        others = (f"{name} was not compared ({how})" for name, how in absent.items())
        advice = joined("; ", [Text("give ", URDF, " with the robot's URDF"), *others])
        raise BadInput([error("B008", message, span, advice)])
    return _bind(model, numbers, numbers.urdf)


def _installed(absent: dict[str, str]) -> Iterator[RobotFile]:
    """Yield the bundled robots whose URDFs are installed; ``absent`` receives the others, with how to install them."""
    for name in robots():
        try:
            yield read_robot_file(_bundled_file(name))
        except BadInput as problem:
            if any(one.code != "B014" for one in problem.diagnostics):
                raise
            absent[name] = problem.diagnostics[0].help or ""


def _mentions(urdf: Path, joints: Iterable[str]) -> bool:
    """Check whether the text of a URDF contains one of these names: cheaper than parsing URDFs of other robots."""
    text = urdf.read_text(encoding="utf-8", errors="replace")
    return any(f'"{joint}"' in text for joint in joints)


def _urdf_of(numbers: RobotFile, urdf: Path | None) -> Path:
    """Choose the user's URDF, with what a robot file adds and changes, else the robot file's own URDF."""
    if urdf is None:
        return numbers.urdf
    return mounted(urdf, None, numbers.tools, numbers.ranges) if numbers.tools or numbers.ranges else urdf


def _matching(model: SelfModel, absent: dict[str, str]) -> RobotFile | None:
    """Find the bundled robot with this self-model, else the one with most of its joints and all of at least one arm.

    ``absent`` receives the robots that are not installed, and so not compared.
    """
    moving = set(model.joints.values())
    model_path = Path(model.ontology.documents[0].path).resolve()
    best: tuple[int, RobotFile] | None = None
    for numbers in _installed(absent):
        if numbers.self_model is not None and numbers.self_model.resolve() == model_path:
            return numbers
        if not _mentions(numbers.urdf, moving):
            continue
        mechanism = Mechanism(numbers.urdf)
        common = sum(mechanism.actuated(joint) for joint in sorted(moving))
        has_arm = any(moving.issuperset(mechanism.movers(arm.tip)) for arm in numbers.arms)
        if has_arm and (best is None or common > best[0]):
            best = (common, numbers)
    return best[1] if best else None


def _numbers_for(urdf: Path) -> RobotFile | None:
    """Find the bundled robot whose arms are those of a URDF: same joints, same lengths."""
    mechanism = Mechanism(urdf)
    for numbers in _installed({}):
        if not _mentions(numbers.urdf, mechanism.joints):
            continue
        bundled_one = Mechanism(numbers.urdf)
        if has_errors(_check(numbers, mechanism)) or not numbers.arms:
            continue
        if all(_same_arm(mechanism, bundled_one, arm.tip) for arm in numbers.arms):
            return numbers
    return None


def _same_arm(one: Mechanism, other: Mechanism, tip: str) -> bool:
    """Check whether the joints that move a link are the same in two URDFs, at the same poses relative to it."""
    movers = one.movers(tip)
    if not movers or movers != other.movers(tip):
        return False
    mine, others = (
        [product(inverse(robot.frame(tip)), robot.frame(robot.joints[mover].child)) for mover in movers]
        for robot in (one, other)
    )
    return bool(np.allclose(mine, others, atol=0.002))


def _bind(model: SelfModel | None, numbers: RobotFile, urdf: Path) -> Robot:
    still = grounded(urdf)
    mechanism = Mechanism(still)
    diagnostics = list(read_description(source_of(urdf)).diagnostics)
    if numbers.path.parent != Bundled.ROBOT.folder or urdf != numbers.urdf:
        vet(urdf)
    diagnostics += _check(numbers, mechanism)
    if has_errors(diagnostics):
        raise BadInput(diagnostics)
    limbs = Limbs(mechanism, numbers, diagnostics)
    if model is not None:
        _check_same(model, mechanism, diagnostics)
        naming = Naming(model, mechanism, diagnostics)
        arms = limbs.from_model(model, naming)
        _list_unknown(model, naming, diagnostics)
    else:
        arms = limbs.from_numbers()
    torso = limbs.torso([arm.tip for arm in arms])
    camera = numbers.camera if model is None or _has_camera(model) else None
    neck = _neck(numbers, mechanism, camera, arms, torso)
    if has_errors(diagnostics):
        raise BadInput(diagnostics)
    if model is not None and numbers.path.parent != urdf.parent and numbers.urdf.resolve() != urdf.resolve():
        help = f"to change them, add a robot file {urdf.stem}.toml beside the URDF"
        message = f"speeds, postures and hands are those of the bundled robot {numbers.name}"
        diagnostics.append(note("B010", message, None, help))
    limits = _limits(numbers, mechanism, arms, torso, neck)
    if numbers.path.parent != Bundled.ROBOT.folder and numbers.path != source_of(urdf):  # a draft has no file to mend
        diagnostics.extend(_unused(numbers, arms, camera, limits))
    if model is not None:
        parts: tuple[Part, ...] = parts_of(model)
        claims: Mapping[str, Span | None] = claims_of(model)
    else:
        parts, claims = inherent(arms, camera, numbers.base)
    return Robot(
        name=numbers.name,
        iri=model.iri if model else None,
        urdf=still,
        base_link=mechanism.root,
        base=numbers.base,
        torso=torso,
        arms=arms,
        neck=neck,
        camera=camera,
        postures=numbers.postures,
        limits=limits,
        allowed_contacts=numbers.allowed_contacts,
        parts=parts,
        claims=claims,
        model=model,
        diagnostics=tuple(diagnostics),
        file=numbers.path if model is None else None,
    )


def _unused(
    numbers: RobotFile, arms: tuple[Arm, ...], camera: CameraModel | None, limits: Mapping[str, JointLimits]
) -> Iterator[Diagnostic]:
    """Yield a warning for each part of a robot file of which nothing is used: the self-model lacks it, or no arm."""
    bound = {arm.name: arm for arm in arms}
    unused = {}
    for stated in numbers.arms:
        key, arm = f"arms.{stated.name}", bound.get(stated.name)
        if arm is None:
            unused[key] = "the self-model has no arm that ends there"
        elif stated.gripper is not None and (
            arm.gripper is None or arm.gripper.max_opening != stated.gripper.max_opening
        ):
            unused[f"{key}.gripper"] = "the self-model lacks its joints"
    if numbers.camera is not None and camera is None:
        unused["camera"] = "the self-model has no camera"
    for joint in numbers.limits:
        if joint not in limits:
            unused[f"joints.{joint}"] = "no arm, gripper, torso or neck has this joint; only its limits can be set"
    for key, why in unused.items():
        yield warning("B011", f"{key} is not used: {why}", numbers.span(key))


def _check_same(model: SelfModel, mechanism: Mechanism, diagnostics: list[Diagnostic]) -> None:
    """Report a URDF with none of the model's moving joints: it is that of another robot."""
    moving = [n for iri, n in model.joints.items() if not any("Fixed" in cls for cls in model.ontology.types(iri))]
    if moving and not any(name in mechanism.joints for name in moving):
        message = f"{mechanism.file_name} has none of the {len(moving)} moving joints of {model.name}"
        diagnostics.append(error("B012", message, model.span, Text("give ", URDF, " with the URDF of this robot")))


def _list_unknown(model: SelfModel, naming: Naming, diagnostics: list[Diagnostic]) -> None:
    unknown = naming.unknown()
    if unknown:
        total = len(model.links) + len(model.joints)
        names = ", ".join(unknown[:8]) + (", ..." if len(unknown) > 8 else "")
        message = f"{len(unknown)} of {total} links and joints of {model.name} are not in {naming.mechanism.file_name}"
        diagnostics.append(note("B007", f"{message} and not used: {names}", model.span))


def _check(numbers: RobotFile, mechanism: Mechanism) -> list[Diagnostic]:
    """Check a robot file against the URDF: unknown links and joints, passive joints, positions beyond limits."""
    problems: list[Diagnostic] = []
    name = mechanism.file_name

    def link(value: str, key: str) -> None:
        if value not in mechanism.links:
            problems.append(error("B011", f"{key}: {name} has no link {value!r}", numbers.span(key)))

    of_base = base_joints(read_urdf(source_of(mechanism.path)))

    def joint(
        value: str, key: str, position: float | None = None, fits: Callable[[str], bool] = mechanism.actuated
    ) -> None:
        if value in of_base:
            message, help = f"{key}: {value} moves the base, not a part of it", "[base] describes how it drives"
            problems.append(error("B011", message, numbers.span(key), help))
        elif not fits(value):
            problems.append(error("B011", f"{key}: {name} has no actuated joint {value!r}", numbers.span(key)))
        elif position is not None and mechanism.joints[value].kind != "continuous":
            lower, upper = mechanism.joints[value].lower, mechanism.joints[value].upper
            if not lower - 1e-9 <= position <= upper + 1e-9:
                message = f"{key}: {position} is outside the limits {lower} to {upper} of {value}"
                problems.append(error("B011", message, numbers.span(key)))

    for arm in numbers.arms:
        link(arm.tip, f"arms.{arm.name}.tip")
        link(arm.hand, f"arms.{arm.name}.hand")
        for side, positions in (("opened", arm.gripper.opened), ("closed", arm.gripper.closed)) if arm.gripper else ():
            for moved, position in positions.items():
                joint(moved, f"arms.{arm.name}.gripper.{side}", position, mechanism.moves)
        if arm.gripper and not any(map(mechanism.actuated, arm.gripper.opened)):
            key = f"arms.{arm.name}.gripper.opened"
            problems.append(error("B011", f"{key}: none of these joints is actuated", numbers.span(key)))
        for finger in arm.gripper.fingers if arm.gripper else ():
            link(finger, f"arms.{arm.name}.gripper.fingers")
    if numbers.camera is not None:
        link(numbers.camera.link, "camera.link")
    for moved in numbers.neck:
        joint(moved, "camera.neck")
    if numbers.torso is not None:
        joint(numbers.torso, "torso")
        tips = [arm.tip for arm in numbers.arms]
        if mechanism.actuated(numbers.torso) and tips and not any(numbers.torso in mechanism.movers(t) for t in tips):
            message = f"torso: {numbers.torso} moves none of the arms"
            problems.append(error("B011", message, numbers.span("torso"), "name a joint that carries arms, or none"))
    for moved in (*numbers.limits, *numbers.ranges):
        joint(moved, f"joints.{moved}")
    for posture, positions in numbers.postures.items():
        for moved, position in positions.items():
            joint(moved, f"postures.{posture}.{moved}", position)
    for pair in numbers.allowed_contacts:
        for one in pair:
            link(one, "allowed_contacts")
    return problems


def _has_camera(model: SelfModel) -> bool:
    classes = (cls for iri in model.components for cls in model.ontology.types(iri))
    return any(local_name(above) == "Camera" for cls in classes for above in model.ontology.ancestors(cls))


def _neck(
    numbers: RobotFile, mechanism: Mechanism, camera: CameraModel | None, arms: tuple[Arm, ...], torso: str | None
) -> tuple[str, ...]:
    """List the joints that aim the camera: those that are stated, else those that move it but no arm."""
    if camera is None or numbers.neck:
        return numbers.neck if camera is not None else ()
    of_arms = {torso, *(joint for arm in arms for joint in arm.joints)}
    return tuple(joint for joint in mechanism.movers(camera.link) if joint not in of_arms)


def _limits(
    numbers: RobotFile, mechanism: Mechanism, arms: tuple[Arm, ...], torso: str | None, neck: tuple[str, ...]
) -> Mapping[str, JointLimits]:
    """Collect the limits of all used joints; without stated limits, the lower of the default and the URDF's speed."""
    used = dict.fromkeys([torso] if torso else [])
    for arm in arms:
        used.update(dict.fromkeys((*arm.joints, *(arm.gripper.joints if arm.gripper else ()))))
    used.update(dict.fromkeys(neck))
    defaults, limits = numbers.default_limits, {}
    for name in used:
        speed = mechanism.joints[name].velocity
        slower = JointLimits(min(defaults.speed, speed or defaults.speed), defaults.acceleration, defaults.jerk)
        limits[name] = numbers.limits.get(name, slower)
    return limits
