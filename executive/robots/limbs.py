"""Arms, grippers, torso and neck: compositions of a self-model, or tables of a robot file, bound to a URDF."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from executive.robots.mechanism import Mechanism, Naming
from executive.robots.robot import Arm, Axis, Composition, Gripper, SelfModel, side_of
from executive.robots.robot_file import ArmNumbers, GripperNumbers, RobotFile
from planlang.designators import local_name, unused_name
from planlang.diagnostics import Diagnostic, error, note, warning
from planlang.geometry.matrices import inverse, moved, product, rotated
from planlang.words import Blank, Option, Text

URDF = Option("urdf", Blank("FILE"))
"""The option that names a URDF."""
FINGER = 0.05
"""Least length of a finger, used if its frame is not behind the tip frame [m]."""
UPWARDS = 0.5
"""Least sine of the angle between a torso's slide and the floor."""
_TOOL = re.compile(r"tool|tcp|grip_?point|grasp", re.IGNORECASE)


def is_gripper(model: SelfModel, composition: Composition) -> bool:
    """Check whether a composition is a gripper or hand, even if it is an arm as well, as in one published file."""
    return _is_a(model, composition, ("GripperComponent", "HolderGripper", "Hand", "LeftHand", "RightHand"))


def is_arm(model: SelfModel, composition: Composition) -> bool:
    """Check whether a composition is an arm."""
    arm = _is_a(model, composition, ("ArmComponent", "Arm", "LeftArm", "RightArm"))
    return arm and not is_gripper(model, composition)


def _is_a(model: SelfModel, composition: Composition, names: Sequence[str]) -> bool:
    ancestors = {local_name(a) for cls in composition.types for a in model.ontology.ancestors(cls)}
    return not ancestors.isdisjoint(names)


class Limbs:
    """Builds the arms of one robot; problems and assumptions are appended to ``diagnostics``."""

    def __init__(self, mechanism: Mechanism, numbers: RobotFile | None, diagnostics: list[Diagnostic]) -> None:
        self.mechanism, self.numbers, self.diagnostics = mechanism, numbers, diagnostics

    # From a robot file alone

    def from_numbers(self, numbers: RobotFile) -> tuple[Arm, ...]:
        """Build the arms of a robot file whose links have been checked."""
        torso = self.torso([arm.tip for arm in numbers.arms])
        return tuple(self._arm(n.name, None, n.side, n.tip, n.hand, n, n.gripper, None, torso) for n in numbers.arms)

    # From a self-model

    def from_model(self, model: SelfModel, naming: Naming) -> tuple[Arm, ...]:
        """Build the arms that the compositions of a self-model describe."""
        grippers = {}
        for composition in model.compositions:
            if is_gripper(model, composition) and composition.base is not None:
                base = naming.link(composition.base, composition.span)
                if base is None:
                    self._report_missing(composition, composition.base)
                else:
                    grippers[base] = composition
        located = []
        for composition in model.compositions:
            if is_arm(model, composition):
                links = self._links(composition, naming, grippers)
                if links is not None:
                    located.append((composition, *links))
        torso = self.torso([tip for _, tip, _, _ in located])
        arms = []
        for composition, tip, hand, gripper in located:
            labels = [text for text in (composition.label, local_name(composition.iri)) if text]
            side = side_of(*(local_name(cls) for cls in composition.types)) or side_of(*labels) or side_of(tip)
            numbers = self._numbers_for(hand)
            name = numbers.name if numbers else side or local_name(composition.iri)
            fingers = self._finger_names(hand, tip, model)
            hand_numbers = (
                numbers.gripper if numbers and numbers.gripper and set(numbers.gripper.opened) <= set(fingers) else None
            )
            if hand_numbers is None and fingers:
                hand_numbers = self._guess_gripper(fingers, tip)
            if gripper is not None and hand_numbers is None:
                message = f"the gripper {local_name(gripper.iri)} has no moving joint; it is left out"
                self.diagnostics.append(warning("B006", message, gripper.span))
            iri = gripper.iri if gripper and hand_numbers else None
            arm = self._arm(name, composition.iri, side, tip, hand, numbers, hand_numbers, iri, torso)
            self._check_known(arm, model, composition)
            arms.append(arm)
        return tuple(arms)

    def _links(
        self, composition: Composition, naming: Naming, grippers: dict[str, Composition]
    ) -> tuple[str, str, Composition | None] | None:
        """Find the tip link, hand link and gripper of an arm; None, with an error, if the URDF lacks its ends."""
        iris = [iri for iri in (composition.base, *composition.ends) if iri]
        links = {iri: naming.link(iri, composition.span) for iri in iris}
        for iri, link in links.items():
            if link is None:
                self._report_missing(composition, iri)
        ends = [link for iri in composition.ends if (link := links[iri])]
        if None in links.values() or not ends:
            return None
        gripper = next((g for g in grippers if self._continues(g, ends)), None)
        hand = gripper or self.mechanism.common_ancestor(ends)
        tool = naming.link(composition.tool_frame, composition.span) if composition.tool_frame else None
        tip = tool or self._tip(hand, ends)
        return tip, hand, grippers.get(gripper or "")

    def _continues(self, gripper: str, ends: Sequence[str]) -> bool:
        """Check whether a gripper that begins at a link continues an arm with these ends."""
        above = self.mechanism.ancestors(gripper)
        return any(end in above or gripper in self.mechanism.ancestors(end) for end in ends)

    def _tip(self, hand: str, ends: Sequence[str]) -> str:
        numbers = self._numbers_for(hand)
        group = self.mechanism.rigid_with(hand)
        if numbers is not None:
            return numbers.tip
        candidates = [link for link in (*ends, *group) if link in group and _TOOL.search(link)]
        return candidates[0] if candidates else hand

    def _numbers_for(self, hand: str) -> ArmNumbers | None:
        """Find the arm of the robot file that has this hand."""
        group = self.mechanism.rigid_with(hand)
        return next((arm for arm in self.numbers.arms if arm.tip in group), None) if self.numbers else None

    def _report_missing(self, composition: Composition, iri: str) -> None:
        message = f"{local_name(composition.iri)} begins or ends at {local_name(iri)}, which is not in"
        help = Text("give ", URDF, " with the URDF of the self-model")
        self.diagnostics.append(error("B004", f"{message} {self.mechanism.file_name}", composition.span, help))

    def _check_known(self, arm: Arm, model: SelfModel, composition: Composition) -> None:
        known = set(model.joints.values())
        unknown = [joint for joint in arm.joints if joint not in known]
        if unknown:
            message = (
                f"{local_name(composition.iri)} has joints in {self.mechanism.file_name} that the self-model lacks"
            )
            help = Text("add the joints to the self-model, or give ", URDF, " with its URDF")
            self.diagnostics.append(error("B005", f"{message}: {', '.join(unknown)}", composition.span, help))

    # From either

    def torso(self, tips: Sequence[str]) -> str | None:
        """Find the joint that carries all arms: the one that is stated, else the last slide upwards before others.

        Slides along the floor, such as those of a telescope, are parts of an arm.
        """
        if self.numbers is not None and self.numbers.torso is not None:
            return self.numbers.torso
        leading = []
        for tip in tips:
            slides = []
            for name in self.mechanism.movers(tip):
                joint = self.mechanism.joints[name]
                if joint.kind != "prismatic":
                    break
                if abs((self.mechanism.frame(joint.child)[:3, :3] @ joint.axis)[2]) > UPWARDS:
                    slides.append(name)
            leading.append(slides)
        shared = [name for name in leading[0] if all(name in slides for slides in leading)] if leading else []
        return shared[-1] if shared else None

    def _arm(
        self,
        name: str,
        iri: str | None,
        side: str | None,
        tip: str,
        hand: str,
        numbers: ArmNumbers | None,
        gripper: GripperNumbers | None,
        gripper_iri: str | None,
        torso: str | None,
    ) -> Arm:
        joints = tuple(joint for joint in self.mechanism.movers(tip) if joint != torso)
        base = self.mechanism.joints[joints[0]].parent if joints else self.mechanism.root
        approach, closing = (numbers.approach, numbers.closing) if numbers else self._axes(tip, hand, name)
        bound = None
        if gripper is not None:
            names = tuple(name for name in gripper.opened if self.mechanism.actuated(name))
            fingers = gripper.fingers or tuple(self.mechanism.joints[joint].child for joint in names)
            gripper_name = local_name(gripper_iri) if gripper_iri else f"{name}_gripper"
            opened, closed = ({name: side[name] for name in names} for side in (gripper.opened, gripper.closed))
            bound = Gripper(gripper_name, gripper_iri, names, opened, closed, fingers, gripper.max_opening)
            hand = self.mechanism.joints[names[0]].parent if numbers is None else numbers.hand
        payload = math.inf if numbers is None else numbers.payload
        return Arm(name, iri, side, joints, base, tip, hand, approach, closing, bound, payload)

    def _axes(self, tip: str, hand: str, name: str) -> tuple[Axis, Axis]:
        """Assume the approach and closing axes of a tip."""
        message = f"the hand of the {name} arm is assumed to approach along x of {tip}, and to close along y"
        help = f"state approach and closing in [arms.{name}] of a robot file (TOML) beside the URDF"
        self.diagnostics.append(note("B010", message, help=help))
        return (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)

    def _finger_names(self, hand: str, tip: str, model: SelfModel) -> tuple[str, ...]:
        """List the actuated finger joints at a hand that the self-model has."""
        above = {joint.name for joint in self.mechanism.chain(tip)}
        known = set(model.joints.values())
        fingers = (joint.name for joint in self.mechanism.fingers(hand) if joint.name not in above)
        moving = tuple(name for name in fingers if name in known and self.mechanism.actuated(name))
        return tuple(name for name in moving if "finger" in name.lower()) or moving

    def _guess_gripper(self, joints: tuple[str, ...], tip: str) -> GripperNumbers | None:
        """Derive a gripper whose fingers are open at the limits farther from the approach axis."""
        opened, closed, room = {}, {}, 0.0
        links: list[str] = []
        line = self.mechanism.frame(tip)
        for name in joints:
            joint = self.mechanism.joints[name]
            link = joint.child
            finger = self.mechanism.frame(link)
            length = max(float(line[:3, 0] @ (line[:3, 3] - finger[:3, 3])), FINGER)
            reach = length * rotated(finger[:3, :3].T, line[:3, 0])
            sides = []
            for value in (joint.lower, joint.upper):
                point = moved(product(inverse(line), self.mechanism.frame(link, value, of=name)), reach)
                sides.append(float(np.hypot(point[1], point[2])))
            widest = int(sides[1] >= sides[0])
            limits = (joint.lower, joint.upper)
            opened[name], closed[name] = limits[widest], limits[1 - widest]
            followers = [j.child for j in self.mechanism.joints.values() if j.mimic and j.mimic.joint == name]
            links += [link, *(child for child in followers if "finger" in child.lower())]
            room += (max(sides) - min(sides)) * (2 if len(followers) else 1)
        help = "state opened, closed and max_opening in [arms.*.gripper] of a robot file (TOML) beside the URDF"
        message = f"{', '.join(joints)}: opened and closed positions are assumed from the URDF's limits"
        self.diagnostics.append(note("B010", message, help=help))
        return GripperNumbers(opened, closed, tuple(links), max(0.9 * room, 0.01))


def with_camera_neck(mechanism: Mechanism, link: str, arms: Sequence[Arm], torso: str | None) -> tuple[str, ...]:
    """List the joints that move the camera but no arm."""
    of_arms = {torso, *(joint for arm in arms for joint in arm.joints)}
    return tuple(joint for joint in mechanism.movers(link) if joint not in of_arms)


def renamed(arms: Sequence[Arm]) -> tuple[Arm, ...]:
    """Make the names of arms unique."""
    names: list[str] = []
    for arm in arms:
        names.append(unused_name(arm.name, names))
    return tuple(replace(arm, name=name) for arm, name in zip(arms, names, strict=True))
