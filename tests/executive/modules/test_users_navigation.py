"""A user's navigation module is asked whenever the base has to drive, whatever module needs that."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path

import pytest
from click.testing import CliRunner

from executive.cli.app import app
from executive.modules.bundled import bundled_registry
from executive.modules.platform import Platform, PlatformModule
from executive.runs.assembly import RobotExecutive
from planlang import SimulationHost, Trace, perform, process_module, run
from planlang.designators import Action, Device, action, an_object
from planlang.geometry import Pose
from planlang.motion_constraints import a_constraint, a_feature
from planlang.runs import with_paths
from sim import Body, PyBulletWorld
from sim.scene import Handle
from tests.executive.conftest import PLACE, MakeStage
from tests.support.leaves import drawn, room

TABLE = Body("table", Pose((1.0, 0.0, 0.37)), (0.6, 1.4, 0.74), type="KitchenTable")
BARS = tuple(Handle(Pose((0.0, side * 0.32, 0.02)), (0.12, 0.015, 0.015)) for side in (1, -1))
TRAY = Body(
    "tray", Pose((0.9, 0.0, 0.755)), (0.4, 0.6, 0.03), type="Tray", movable=True, hands=2, mass=0.8, handles=BARS
)
START = (-1.5, 0.0, 0.0)


class Asked(Exception):
    """The user's module was asked."""


@process_module
class Wheels(PlatformModule):
    """A user's navigation module, which ends the run."""

    name = "wheels"
    actions = ("Translation-LocationChange",)
    failures = ()

    async def execute(self, action: Action) -> None:
        raise Asked(str(action))


def ask(truth: PyBulletWorld, platform: Platform, wanted: Action) -> list[str]:
    """Perform an action with the user's module; return the paths of what was performed before it ended the run."""
    executive, trace = RobotExecutive(platform, (Wheels, *bundled_registry().resolve([])), truth), Trace()
    with pytest.raises(Asked):
        run(lambda: perform(wanted), host=SimulationHost(truth), executive=executive, max_steps=20_000, trace=trace)
    return [str(one["path"]) for one in with_paths(trace.events) if one["event"] == "request"]


def test_it_is_asked_by_what_opens_a_door() -> None:
    with ExitStack() as stack:
        home = room(stack, drawn(1), start=START)
        wanted = action("OpeningAContainerArtifact", object_acted_on=home.designator("leaf"))
        assert ask(home.truth, home.platform, wanted)[-1].endswith("container/Translation-LocationChange/wheels")


def test_it_is_asked_by_what_takes_a_tray(make_stage: MakeStage) -> None:
    stage = make_stage(TABLE, TRAY, start=START)
    wanted = action("PickingUpAnObject", object_acted_on=an_object("Tray", PLACE + "tray"))
    assert ask(stage.truth, stage.platform, wanted)[-1].endswith("two_hands/Translation-LocationChange/wheels")


def test_it_is_asked_by_motions_under_constraints_such_as_pouring(make_stage: MakeStage) -> None:
    stage = make_stage(TABLE, start=START)
    hand = Device("Hand", stage.platform.robot.arm("left").iri)
    up = (0.0, 0.0, 1.0)
    tip = a_feature("LINE", of=hand, position=(0.0, 0.0, 0.0), direction=up)
    top = a_feature("PLANE", of=an_object("KitchenTable", PLACE + "table"), position=(0.0, 0.0, 0.37), direction=up)
    asked = (
        a_constraint("HEIGHT", tip, top, lower=0.1, upper=0.4, name="over"),
        a_constraint("DISTANCE", tip, top, upper=0.6, name="near"),
    )
    requests = ask(stage.truth, stage.platform, action("ITaSCMotion", constrained_by=asked))
    assert requests[-1].endswith("constrained_motion/Translation-LocationChange/wheels")


WHEELS = """
from executive.modules.platform import PlatformModule
from planlang import process_module
from planlang.failures import NavigationFailure, NavigationPoseUnreachable
from executive.motion import MotionError


@process_module
class Wheels(PlatformModule):
    name = "wheels"
    actions = ("Translation-LocationChange",)
    failures = (NavigationFailure,)

    def resources(self, action):
        return ("base",)

    async def execute(self, action):
        goal = action.get("x"), action.get("y"), action.get("yaw")
        try:
            path = self.platform.drive.path(goal)
        except MotionError as problem:
            raise NavigationPoseUnreachable(target=goal) from problem
        await self.platform.follow("base", path)
        self.platform.drive.moved()
"""


@pytest.mark.long
def test_a_cabinet_is_opened_and_closed_with_all_drives_by_a_users_module(tmp_path: Path) -> None:
    (tmp_path / "wheels.py").write_text(WHEELS)
    trace = tmp_path / "run.jsonl"
    command = ["run", "fetch_from_cabinet", "--modules", str(tmp_path / "wheels.py"), "--trace", str(trace)]
    ended = CliRunner().invoke(app, command)
    assert ended.exit_code == 0, ended.output
    assert "cabinet_door1: closed" in ended.output
    asked = [line for line in trace.read_text().splitlines() if '"event": "request"' in line]
    assert sum('"module": "wheels"' in line for line in asked) >= 3
    assert not any('"module": "navigation"' in line for line in asked)
