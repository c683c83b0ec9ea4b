"""Arms, grippers, torso and neck: compositions of a self-model, or tables of a robot file, bound to a URDF."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from executive.robots.mechanism import Mechanism, Naming
from executive.robots.robot import Arm, Composition, Gripper, SelfModel, side_of
from executive.robots.robot_file import ArmNumbers, GripperNumbers, RobotFile
from planlang.designators import local_name, unused_name
from planlang.diagnostics import Diagnostic, error, warning
from planlang.words import Blank, Option, Text

URDF = Option("urdf", Blank("FILE"))
"""The option that names a URDF."""


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


def described(naming: Naming) -> list[tuple[Composition, str, Composition | None]]:
    """List the arms that compositions of a self-model describe: composition, link of the hand, and gripper.

    An arm whose ends the URDF lacks is reported as an error.
    """
    model, mechanism = naming.model, naming.mechanism

    def missing(composition: Composition, iri: str) -> None:
        message = f"{local_name(composition.iri)} begins or ends at {local_name(iri)}, which is not in"
        help = Text("give ", URDF, " with the URDF of the self-model")
        naming.diagnostics.append(error("B004", f"{message} {mechanism.file_name}", composition.span, help))

    def continues(gripper: str, ends: Sequence[str]) -> bool:
        """Check whether a gripper that begins at a link continues an arm with these ends."""
        above = mechanism.ancestors(gripper)
        return any(end in above or gripper in mechanism.ancestors(end) for end in ends)

    grippers = {}
    for composition in model.compositions:
        if is_gripper(model, composition) and composition.base is not None:
            base = naming.link(composition.base, composition.span)
            if base is None:
                missing(composition, composition.base)
            else:
                grippers[base] = composition
    arms = []
    for composition in (one for one in model.compositions if is_arm(model, one)):
        iris = [iri for iri in (composition.base, *composition.ends) if iri]
        links = {iri: naming.link(iri, composition.span) for iri in iris}
        for iri in (iri for iri, link in links.items() if link is None):
            missing(composition, iri)
        ends = [link for iri in composition.ends if (link := links[iri])]
        if ends and None not in links.values():
            gripper = next((one for one in grippers if continues(one, ends)), None)
            arms.append((composition, gripper or mechanism.common_ancestor(ends), grippers.get(gripper or "")))
    return arms


class Limbs:
    """Builds the arms of one robot; problems are appended to ``diagnostics``."""

    def __init__(self, mechanism: Mechanism, numbers: RobotFile, diagnostics: list[Diagnostic]) -> None:
        self.mechanism, self.numbers, self.diagnostics = mechanism, numbers, diagnostics

    def from_numbers(self) -> tuple[Arm, ...]:
        """Build the arms of a robot file whose links have been checked."""
        torso = self.torso([arm.tip for arm in self.numbers.arms])
        return tuple(self._arm(arm, None, arm.side, arm.gripper, None, torso) for arm in self.numbers.arms)

    def from_model(self, model: SelfModel, naming: Naming) -> tuple[Arm, ...]:
        """Build the arms that the compositions of a self-model describe, as the robot file measures them."""
        measured = []
        for composition, link, gripper in described(naming):
            group = self.mechanism.rigid_with(link)
            numbers = next((arm for arm in self.numbers.arms if arm.tip in group), None)
            if numbers is not None:
                measured.append((composition, gripper, numbers))
            else:
                what = local_name(composition.iri)
                message = f"{what} ends at {link}, where the robot file has no arm; it is left out"
                help = "state its tip, approach, closing and gripper in a table [arms.NAME] of the robot file"
                self.diagnostics.append(warning("B006", message, composition.span, help))
        torso = self.torso([numbers.tip for _, _, numbers in measured])
        known, arms = set(model.joints.values()), []
        for composition, gripper, numbers in measured:
            labels = [text for text in (composition.label, local_name(composition.iri)) if text]
            side = side_of(*(local_name(cls) for cls in composition.types)) or side_of(*labels) or side_of(numbers.tip)
            moving = () if numbers.gripper is None else filter(self.mechanism.actuated, numbers.gripper.opened)
            hand = numbers.gripper if known.issuperset(moving) else None
            if gripper is not None and hand is None:
                message = f"the gripper {local_name(gripper.iri)} has no moving joint; it is left out"
                self.diagnostics.append(warning("B006", message, gripper.span))
            iri = gripper.iri if gripper and hand else None
            arm = self._arm(numbers, composition.iri, side, hand, iri, torso)
            if unknown := [joint for joint in arm.joints if joint not in known]:
                what, where = local_name(composition.iri), self.mechanism.file_name
                message = f"{what} has joints in {where} that the self-model lacks: {', '.join(unknown)}"
                help = Text("add the joints to the self-model, or give ", URDF, " with its URDF")
                self.diagnostics.append(error("B005", message, composition.span, help))
            arms.append(arm)
        return _renamed(arms)

    def torso(self, tips: Sequence[str]) -> str | None:
        """Find the joint that carries all arms: the one that is stated, else the one that raises them straight up."""
        if self.numbers.torso is not None:
            return self.numbers.torso
        lift = self.mechanism.lift(tips)
        return None if lift is None else lift.name

    def _arm(
        self,
        numbers: ArmNumbers,
        iri: str | None,
        side: str | None,
        gripper: GripperNumbers | None,
        gripper_iri: str | None,
        torso: str | None,
    ) -> Arm:
        joints = tuple(joint for joint in self.mechanism.movers(numbers.tip) if joint != torso)
        base = self.mechanism.joints[joints[0]].parent if joints else self.mechanism.root
        bound = None
        if gripper is not None:
            names = tuple(name for name in gripper.opened if self.mechanism.actuated(name))
            fingers = gripper.fingers or tuple(self.mechanism.joints[joint].child for joint in names)
            gripper_name = local_name(gripper_iri) if gripper_iri else f"{numbers.name}_gripper"
            opened, closed = ({name: side[name] for name in names} for side in (gripper.opened, gripper.closed))
            bound = Gripper(gripper_name, gripper_iri, names, opened, closed, fingers, gripper.max_opening)
        frame = numbers.tip, numbers.hand, numbers.approach, numbers.closing
        return Arm(numbers.name, iri, side, joints, base, *frame, bound, numbers.payload)


def _renamed(arms: Sequence[Arm]) -> tuple[Arm, ...]:
    """Make the names of arms unique."""
    names: list[str] = []
    for arm in arms:
        names.append(unused_name(arm.name, names))
    return tuple(replace(arm, name=name) for arm, name in zip(arms, names, strict=True))
