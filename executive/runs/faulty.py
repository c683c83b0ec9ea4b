"""The simulated world of a run with faults, and what is said of them at its end."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from typing import TYPE_CHECKING

from executive.runs.fault_report import FaultReport
from executive.runs.prepared import RunFiles
from executive.runs.simulated import SimulatedWorld
from planlang.diagnostics import BadInput, Diagnostic, error, warning
from planlang.faults.drawing import Draw, Drawn
from planlang.faults.named import NamedFault, WrongFault, read_faults
from planlang.faults.stated import DONE
from planlang.faults.steps import Fault, Injector, is_of_step
from planlang.spelling import similar
from sim.faults.faulty_robot import FaultyRobot
from sim.faults.faulty_world import FaultyWorld
from sim.faults.injection import Injection

if TYPE_CHECKING:
    from executive.belief import Belief
    from executive.robots import Robot
    from executive.robots.robot import Arm
    from planlang.kernel.tree import Node
    from sim import Scene


class FaultyRun(SimulatedWorld):
    """The simulated world of a run in which things go wrong."""

    def __init__(self, files: RunFiles, scene: Scene, robot: Robot) -> None:
        """Make the world. Raises BadInput for a fault that names what is not there."""
        options, seed = files.options, files.seed
        named, rate = read_faults(options.fault or ()), options.fault_rate or 0.0
        _check_names(named, scene, robot)
        truth = FaultyWorld(scene, robot.body(), gui=options.gui, seed=seed)
        self._named, self._expected, self._is_strict = named, files.expected, options.faults is not None
        self._draw = Draw(named, rate, seed)
        self._injection = Injection(truth, self._draw)
        self._steps = Injector([str(one) for one in named if is_of_step(one)], self._fails)
        hands = {arm.tip: _names(arm) for arm in robot.arms}
        super().__init__(truth, FaultyRobot(self._injection, hands))

    def told_by(self, belief: Belief) -> None:
        """Record by a belief what goes wrong."""
        self._injection.tell = lambda event, details: belief.tell(event, details)

    def begins(self, node: Node) -> None:
        """Let a step fail that is stated to, as it begins; raises its failure."""
        self._steps(node)

    def _fails(self, fault: Fault) -> None:
        """Count a step that fails, which is no opportunity of the world."""
        named = fault.named
        assert named is not None
        self._draw.happened(Drawn(named.kind, fault.step, 0, self._draw.seed, named.value, named), self._injection.now)

    def report(self) -> FaultReport:
        """Say what has gone wrong so far."""
        fired = tuple(
            {
                "time": round(one.time, 3),
                "fault": str(one.fault),
                "kind": str(one.fault.kind),
                "opportunity": one.fault.number,
            }
            for one in self._draw.fired
        )
        never = tuple(map(str, self._draw.never()))
        return FaultReport(fired, never, len(self._named), self._draw.opportunities, self._is_strict)

    def ended(self, outcome: str, failures: Sequence[str]) -> list[Diagnostic]:
        """Say what was stated and did not come true: in errors if a file states it, else in warnings."""
        say, found = error if self._is_strict else warning, list[Diagnostic]()
        for one in self._draw.never():
            advice = f"it happens at {one.kind.opportunity.value}: there was none, or not so often or so late"
            found.append(say("X040", f"the fault {one} did not happen", help=advice))
        expected, ended = self._expected or DONE, " < ".join(failures) or outcome
        if self._is_strict and expected not in (outcome, *failures):
            found.append(error("X042", f"the run was expected to end with {expected}, and ended with {ended}"))
        return found


def _names(arm: Arm) -> tuple[str, ...]:
    """List what an arm and its gripper are called."""
    return tuple(dict.fromkeys(filter(None, (arm.name, arm.side))))


def _wrong_step(fault: NamedFault) -> Iterator[Diagnostic]:
    """Say what is wrong with a stated fault of a step."""
    try:
        read = Fault.read(str(fault))
    except WrongFault as problem:
        yield error("X041", str(problem))
        return
    if any(one.at is not None for one in read):
        yield error("X041", f"{fault}: a step fails as it begins", help="state its number, such as @2, @2-4 or @always")


def _check_names(named: Sequence[NamedFault], scene: Scene, robot: Robot) -> None:
    """Raise BadInput for a fault of an arm, thing, person, door or device that is not there."""
    arms = [name for arm in robot.arms for name in _names(arm)]
    bodies = [body.name for body in scene.bodies]
    problems = list[Diagnostic]()
    for one in named:
        if is_of_step(one):
            problems += _wrong_step(one)
            continue
        known: Collection[str] = [*arms, *bodies] if one.kind.part in ("gripper", "arm") else bodies
        if one.of is not None and one.kind.part not in ("base", "head", "camera") and one.of not in known:
            alike = similar(one.of, known)
            advice = f"did you mean {alike[0]}?" if alike else f"there is {', '.join(known)}"
            problems.append(error("X041", f"{one}: there is no {one.kind.part} {one.of}", help=advice))
    if problems:
        raise BadInput(problems)
