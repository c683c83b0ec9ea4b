"""The last lines of a run about things, containers and devices, from the simulator's truth."""

from __future__ import annotations

from executive.robots import bind_robot
from executive.runs.options import state_lines
from planlang.changes import Switched
from planlang.files import bundled
from planlang.geometry import Pose
from planlang.state.matter import OFF, ON, Portion
from sim import Body, PyBulletWorld, Scene
from sim.joints import Articulation, JointKind
from sim.scene import Cavity

UP = (0.0, 0.0, 1.0)
DOOR = Articulation("door", JointKind.HINGED, (2.0, 0.3, 0.5), UP, 0.0, 1.57, "oven", ("handle",), "handle")


def test_a_thing_is_in_what_is_hollow_around_it_and_on_what_it_stands_on() -> None:
    floor = Body("room", Pose((0.0, 0.0, 1.3)), (6.0, 6.0, 2.6), "room")
    box = Body("toybox", Pose((1.0, 0.0, 0.1)), (0.4, 0.4, 0.2), wall=0.01, movable=True)
    cube = Body("cube", Pose((1.0, 0.0, 0.035)), (0.05, 0.05, 0.05), movable=True)
    shelf = Body(
        "shelf", Pose((2.0, 0.0, 0.5)), (0.4, 0.8, 1.0), cavities=(Cavity((-0.1, 0.0, 0.25), (0.6, 0.7, 0.4)),)
    )
    can = Body("can", Pose((1.95, 0.0, 0.6)), (0.06, 0.06, 0.1), "cylinder", movable=True)
    tin = Body("tin", Pose((2.0, 0.2, 1.05)), (0.06, 0.06, 0.1), "cylinder", movable=True)
    scene = Scene((floor, box, cube, shelf, can, tin), start=(-1.0, 0.0, 0.0))
    world = PyBulletWorld(scene, bind_robot(bundled("ontologies") / "robots" / "amigo.omn").body())
    try:
        assert list(state_lines(world, ["toybox", "cube", "can", "tin"])) == [
            "toybox: at rest on room",
            "cube: at rest in toybox",
            "can: at rest in shelf",
            "tin: at rest on shelf",
        ]
    finally:
        world.close()


def test_containers_devices_and_vessels_are_told_of_beside_where_things_are() -> None:
    oven = Body("oven", Pose((2.3, 0.0, 0.5)), (0.5, 0.6, 1.0))
    door = Body("door", Pose((2.0, 0.0, 0.5)), (0.02, 0.6, 1.0))
    handle = Body("handle", Pose((1.96, -0.25, 0.5)), (0.02, 0.02, 0.2))
    cup = Body("cup", Pose((2.3, 0.0, 1.05)), (0.08, 0.08, 0.1), "cylinder", movable=True)
    scene = Scene((oven, door, handle, cup), start=(0.0, 0.0, 0.0), joints=(DOOR,))
    robot = bind_robot(bundled("ontologies") / "robots" / "amigo.omn")
    world = PyBulletWorld(scene, robot.body())
    try:
        names = ("cup", "oven")
        assert list(state_lines(world, names)) == ["cup: at rest on oven", "door: closed"]
        world.set_joint("door", DOOR.last_shut)
        assert list(state_lines(world, ["oven"])) == ["door: closed"], "as for those who close it"
        world.set_joint("door", DOOR.last_shut + 0.001)
        assert list(state_lines(world, ["oven"])) == ["door: open by 3 degrees"]
        assert list(state_lines(world, ["oven", "door"])) == ["door: open by 3 degrees"], "it is said once"
        assert list(state_lines(world, ["cup"])) == ["cup: at rest on oven", "door: left open by 3 degrees"]
        world.set_joint("door", 1.0)
        world.bring_about(Switched("oven", ON))
        world.matter = world.matter.put("cup", Portion("http://example.org/x#Milk", 50.0, ()))
        told = ["cup: at rest on oven", "cup: holds 50 ml of Milk", "door: open by 57 degrees", "oven: on"]
        assert list(state_lines(world, names)) == told
        world.bring_about(Switched("oven", OFF))
        world.bring_about(Switched("cup", "Clean"))
        assert [line for line in state_lines(world, names) if line in ("oven: off", "cup: Clean")] == [
            "cup: Clean",
            "oven: off",
        ]
        world.attach(robot.arm("right").tip, "cup")
        assert next(iter(state_lines(world, ["cup"]))) == "cup: held by robot"
        held = {"cup": "in the right hand"}
        assert next(iter(state_lines(world, ["cup"], held))) == "cup: still held by robot, in the right hand"
    finally:
        world.close()
