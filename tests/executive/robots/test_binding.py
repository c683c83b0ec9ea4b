"""Binding of robots: bundled ones, real self-models, and their errors."""

import shutil
from dataclasses import replace
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

import numpy as np
import pybullet
import pybullet_data
import pytest
from robot_files import BASE, PANDA_ARM

from executive.motion import Chain
from executive.robots import Robot, bind_robot, robots
from executive.robots.mechanism import Mount, NotInstalled, mounted, packaged
from planlang import files
from planlang.designators import Device
from planlang.diagnostics import BadInput
from planlang.geometry import Pose
from planlang.protocols import Configuration
from sim import Body, PlanningWorld, Scene
from tests.support.extras import HAS_PR2
from tests.support.refusals import refusal

ARM = ("shoulder_yaw", "shoulder_pitch", "shoulder_roll", "elbow_pitch", "elbow_roll", "wrist_pitch", "wrist_yaw")


@pytest.fixture(scope="module")
def world(amigo: Robot) -> PlanningWorld:
    """Amigo, with a bottle out of its way."""
    bottle = Body("bottle", Pose((3.0, 3.0, 0.1)), (0.065, 0.065, 0.2), "cylinder", movable=True)
    return PlanningWorld(Scene((bottle,)), amigo.body())


def assert_is_amigo(robot: Robot) -> None:
    assert robot.torso == "spindle_joint"
    assert robot.neck == ("neck_pan_joint", "neck_tilt_joint")
    assert robot.camera
    assert {arm.side for arm in robot.arms} == {"left", "right"}
    for arm in robot.arms:
        assert arm.joints == tuple(f"{joint}_joint_{arm.side}" for joint in ARM)
        assert (arm.base_link, arm.tip) == (f"shoulder_mount_{arm.side}", f"grippoint_{arm.side}")
        assert arm.gripper
        assert arm.gripper.joints == (f"finger1_joint_{arm.side}", f"finger2_joint_{arm.side}")
        assert arm.gripper.finger_links == (f"finger1_{arm.side}", f"finger2_{arm.side}")


def test_amigo_binds_without_diagnostics(amigo: Robot) -> None:
    assert_is_amigo(amigo)
    assert amigo.diagnostics == ()
    assert "amigo" in robots()


def test_every_moving_joint_has_limits(amigo: Robot) -> None:
    used = {amigo.torso, *amigo.neck, *(j for arm in amigo.arms for j in arm.joints)}
    used |= {joint for arm in amigo.arms if arm.gripper for joint in arm.gripper.joints}
    assert set(amigo.limits) == used
    assert amigo.limits["spindle_joint"].speed == 0.07


@pytest.mark.parametrize("name", ["amigo@hydro.owl", "amigo@re_stack.owl.in"])
def test_real_self_models_of_amigo_are_matched_to_the_bundled_one(corpus: Path, name: str) -> None:
    robot = bind_robot(corpus / "robots" / name)
    assert_is_amigo(robot)
    codes = [d.code for d in robot.diagnostics]
    assert "B003" in codes, "links that were found by name or by their joint are noted"
    assert codes.count("B007") == 1, "what is not in the URDF is listed once"


def test_the_real_urdf_of_amigo_can_be_given(corpus: Path) -> None:
    robot = bind_robot(corpus / "robots" / "amigo@hydro.owl", corpus / "robots" / "amigo@hydro.urdf")
    assert_is_amigo(robot)
    assert robot.camera
    assert robot.camera.link == "openni_rgb_optical_frame", "what is said about the bundled one holds for it"
    assert set(robot.postures) >= {"carrying", "handover"}
    assert {"B007"}.isdisjoint(d.code for d in robot.diagnostics), "all 225 names are in the URDF"


@pytest.mark.parametrize("name", ["PR2@hydro.owl", "pioneer@hydro.owl", "baxter@hydro.owl"])
def test_another_robot_needs_its_urdf(corpus: Path, name: str) -> None:
    if name.startswith("PR2") and HAS_PR2:
        pytest.skip("the extra pr2 is installed, which has its URDF")
    with refusal("B008", naming="urdf=FILE"):
        bind_robot(corpus / "robots" / name)


def test_a_robot_whose_package_is_not_installed_is_reported_as_not_compared(
    corpus: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def absent(name: str, file: str) -> Path:
        raise NotInstalled(f"the package {name} is not installed")

    monkeypatch.setattr("executive.robots.robot_file.packaged", absent)
    with pytest.raises(BadInput) as caught:
        bind_robot(corpus / "robots" / "PR2@hydro.owl")
    (found,) = caught.value.diagnostics
    assert found.code == "B008"
    assert "(amigo)" in found.message
    assert found.help is not None
    assert "pr2 was not compared (pip install 'example-robot-data>=4.1')" in found.help


def test_a_pr2_has_two_arms_on_a_torso(corpus: Path) -> None:
    robot = bind_robot(corpus / "robots" / "PR2@hydro.owl", corpus / "robots" / "pr2@hydro.urdf")
    assert robot.torso == "torso_lift_joint"
    assert [(arm.tip, len(arm.joints)) for arm in robot.arms] == [
        ("l_gripper_tool_frame", 7),
        ("r_gripper_tool_frame", 7),
    ]
    assert robot.neck == ("head_pan_joint", "head_tilt_joint")
    left = robot.arm("left").gripper
    assert left
    assert left.opened["l_gripper_l_finger_joint"] > left.closed["l_gripper_l_finger_joint"]
    assert "B010" in [d.code for d in robot.diagnostics]


def test_a_urdf_of_another_robot_is_refused(corpus: Path) -> None:
    with refusal("B012"):
        bind_robot(corpus / "robots" / "pioneer@hydro.owl", corpus / "robots" / "pr2@hydro.urdf")


def test_an_unknown_robot_is_refused_with_the_names_of_the_bundled_ones() -> None:
    with refusal("B008", naming="amigo"):
        bind_robot("amigoo")


@pytest.mark.parametrize("opened", [True, False], ids=["hands opened", "hands closed"])
@pytest.mark.parametrize("posture", ["reset", "carrying", "prepare_grasp", "handover", "parking"])
def test_amigo_does_not_touch_itself_in_its_postures(
    amigo: Robot, world: PlanningWorld, posture: str, opened: bool
) -> None:
    joints = dict(amigo.postures[posture])
    for arm in amigo.arms:
        if arm.gripper:
            joints |= arm.gripper.opened if opened else arm.gripper.closed
    assert world.contacts(Configuration((0.0, 0.0, 0.0), joints)) == ()


@pytest.mark.parametrize("side", ["left", "right"])
def test_amigo_carries_a_bottle_upright_and_close(amigo: Robot, world: PlanningWorld, side: str) -> None:
    arm = amigo.arm(side)
    assert arm.gripper
    posture = {**amigo.postures["carrying"], **arm.gripper.opened}
    world.set_configuration(Configuration((0.0, 0.0, 0.0), posture))
    tip = world.link_pose(arm.tip)
    assert abs(tip.matrix()[:3, :3] @ arm.approach)[2] < 0.02, "the hand is level"
    assert abs(tip.matrix()[:3, :3] @ arm.closing)[2] < 0.02, "a bottle between the fingers stays upright"
    assert np.hypot(*tip.position[:2]) < 0.45
    world.set_pose("bottle", Pose(tip.position))
    world.attach(arm.hand_link, "bottle")
    assert world.contacts() == ()
    world.release("bottle")
    world.set_pose("bottle", Pose((3.0, 3.0, 0.1)))


def test_the_open_hand_is_as_wide_as_it_claims(amigo: Robot) -> None:
    for arm in amigo.arms:
        assert arm.gripper
        opening = 0.0
        for joint, link in zip(arm.gripper.joints, arm.gripper.finger_links, strict=True):
            chain = Chain.from_urdf(amigo.urdf, arm.hand_link, link)
            finger = chain.fk(np.array([[arm.gripper.opened[joint]]]))[0]
            middle = finger @ np.array([0.0, 0.0, -0.065, 1.0])
            opening += abs(middle[1]) - 0.009
        assert opening > arm.gripper.max_opening


def test_devices_are_matched_by_identity_else_by_side(amigo: Robot) -> None:
    right, left = amigo.arm("right"), amigo.arm("left")
    assert right.gripper
    assert amigo.arms_of(None) == (right, left)
    assert amigo.arms_of(Device("HolderGripper", right.gripper.iri)) == (right,)
    assert amigo.arms_of(Device("HolderGripper", "http://example.org/recipe.owl#robotLeftGripper")) == (left,)
    assert amigo.arms_of(Device("HolderGripper", "http://example.org/recipe.owl#gripper")) == (right, left)
    assert amigo.arms_of(Device("LeftArm", "http://example.org/recipe.owl#device")) == (left,)
    assert amigo.arms_of(left.hand) == (left,)
    assert amigo.arms_of(Device("Arm", "http://example.org/recipe.owl#leftArm")) == (left,)


@pytest.mark.pr2
def test_hands_are_distinct_even_if_no_self_model_names_them() -> None:
    pr2 = bind_robot("pr2")
    assert [pr2.arms_of(arm.hand) for arm in pr2.arms] == [(arm,) for arm in pr2.arms]


def test_gripper_designators_match_only_arms_with_a_gripper(amigo: Robot) -> None:
    one_handed = replace(amigo, arms=(replace(amigo.arm("right"), gripper=None), amigo.arm("left")))
    assert [arm.name for arm in one_handed.arms_of(Device("HolderGripper"))] == ["left"]
    assert [arm.name for arm in one_handed.arms_of(Device("ArmComponent"))] == ["right", "left"]


def without_fingers(text: str) -> str:
    """Amigo's self-model without grippers and fingers."""
    frames = text.split("\n\n")
    kept = [f for f in frames if not ("_gripper\n" in f.split("Types")[0] or "finger" in f.split("Types")[0])]
    return "\n\n".join(
        "\n".join(line for line in frame.splitlines() if "finger" not in line and "Grip" not in line) for frame in kept
    )


@pytest.fixture
def handless(amigo: Robot, tmp_path: Path) -> Robot:
    """Amigo, bound to a self-model without grippers."""
    path = tmp_path / "handless.omn"
    path.write_text(without_fingers(amigo.urdf.with_suffix(".omn").read_text()))
    return bind_robot(path)


def test_a_self_model_without_fingers_binds_without_gripper(handless: Robot) -> None:
    assert [arm.gripper for arm in handless.arms] == [None, None]
    assert [len(arm.joints) for arm in handless.arms] == [7, 7]


def test_a_robot_drives_if_its_self_model_claims_so_and_no_wheel_is_in_its_urdf(handless: Robot) -> None:
    assert not handless.base.fixed


def test_a_robot_can_be_described_by_a_toml_file_alone(tmp_path: Path, amigo: Robot) -> None:
    text = amigo.urdf.with_suffix(".toml").read_text()
    path = tmp_path / "mine.toml"
    path.write_text(text.replace('self_model = "amigo.omn"\n', "").replace('"amigo"', '"mine"'))
    (tmp_path / "amigo.urdf").write_text(amigo.urdf.read_text())
    robot = bind_robot(path)
    assert_is_amigo(robot)
    assert robot.name == "mine"
    assert robot.iri is None
    assert any(iri.endswith("#GraspingCapability") for iri in robot.claims)


@pytest.mark.parametrize(
    ("wrong", "right", "named", "code"),
    [
        ("radius = -1", "radius = 0.333", "base.radius", "B001"),
        ("radius = true", "radius = 0.333", "base.radius", "B001"),
        ("radius = nan", "radius = 0.333", "base.radius", "B001"),
        ('side = "top"', 'side = "left"', "arms.left.side", "B001"),
        ("closing = [1, 1, 0]", "closing = [0, 1, 0]", "closing", "B001"),
        ('tip = "nowhere"', 'tip = "grippoint_left"', "'nowhere'", "B011"),
        ("far = 0.1", "far = 4.0", "camera.far", "B001"),
        ('neck = "neck_pan_joint"', 'neck = ["neck_pan_joint", "neck_tilt_joint"]', "camera.neck", "B001"),
        ("[joints.no_joint]", "[joints.spindle_joint]", "no_joint", "B011"),
        ('urdf = "gone.urdf"', 'urdf = "amigo.urdf"', "gone.urdf", "B001"),
        ("[base", "[base]", "TOML", "B001"),
    ],
)
def test_errors_in_a_robot_file_are_reported(
    tmp_path: Path, amigo: Robot, wrong: str, right: str, named: str, code: str
) -> None:
    (tmp_path / "amigo.urdf").write_text(amigo.urdf.read_text())
    text = amigo.urdf.with_suffix(".toml").read_text().replace('self_model = "amigo.omn"\n', "")
    assert right in text
    path = tmp_path / "mine.toml"
    path.write_text(text.replace(right, wrong))
    with refusal(code, naming=named) as problem:
        bind_robot(path)
    assert all(d.span and d.span.file == str(path) for d in problem.value.diagnostics)


def test_a_single_arm_without_torso_neck_and_camera_binds(tmp_path: Path) -> None:
    source = Path(pybullet_data.getDataPath()) / "franka_panda"
    shutil.copytree(source, tmp_path / "panda")
    path = tmp_path / "panda" / "robot.toml"
    path.write_text(BASE.replace("robot.urdf", "panda.urdf") + PANDA_ARM)
    robot = bind_robot(path)
    assert (robot.torso, robot.neck, robot.camera, robot.base_link) == (None, (), None, "panda_link0")
    assert [arm.joints for arm in robot.arms] == [tuple(f"panda_joint{k}" for k in range(1, 8))]
    assert robot.arms[0].base_link == "panda_link0"
    world = PlanningWorld(Scene(()), robot.body())
    fingers = set(robot.body().hands["panda_hand"])
    assert not any({contact.part, contact.body} == fingers for contact in world.contacts()), "fingers may touch"
    world.close()


@pytest.fixture(params=["panda", "pr2"])
def robot(request: pytest.FixtureRequest) -> Robot:
    """A bundled robot; skips where its package is not installed."""
    if request.param == "pr2":
        try:
            distribution("example-robot-data")
        except PackageNotFoundError:
            pytest.skip("needs the extra pr2")
    return bind_robot(request.param)


def test_the_carrying_posture_is_free_of_contacts_with_all_meshes(robot: Robot) -> None:
    assert "B013" not in [diagnostic.code for diagnostic in robot.diagnostics], "no mesh is absent"
    assert set(robot.postures["carrying"]) == {j for a in robot.arms for j in a.joints} | {robot.torso} - {None}
    world = PlanningWorld(Scene(()), robot.body())
    assert world.contacts() == ()
    lower, _ = world.robot.boxes()
    assert lower[:, 2].min() == pytest.approx(0.0, abs=0.06), "it stands on the floor"
    for arm in robot.arms:
        tip = world.link_pose(arm.tip).matrix()[:3, :3]
        assert abs((tip @ np.array(arm.approach))[2]) < 0.02, "its hands are level"
    world.close()


def test_its_urdf_can_be_loaded_by_anybody(robot: Robot) -> None:
    client = pybullet.connect(pybullet.DIRECT)
    try:
        assert pybullet.loadURDF(str(robot.urdf), useFixedBase=True, physicsClientId=client) >= 0
    finally:
        pybullet.disconnect(client)


def test_every_arm_has_seven_joints_of_its_own(robot: Robot) -> None:
    for arm in robot.arms:
        assert len(arm.joints) == 7
        assert arm.gripper
        assert Chain.from_urdf(robot.urdf, robot.base_link, arm.tip).dof == 7 + (robot.torso is not None)


ARM_URDF = '<robot name="arm"><link name="root"/><joint name="j" type="fixed"><parent link="root"/><child link="a"/></joint><link name="a"/></robot>'  # noqa: E501


@pytest.mark.parametrize(("size", "shape"), [((0.4, 0.5, 0.6), "box"), ((0.4, 0.6), "cylinder")])
def test_a_base_of_a_primitive_shape_is_put_under_the_root(
    size: tuple[float, ...], shape: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    (tmp_path / "arm.urdf").write_text(ARM_URDF)
    made = mounted(tmp_path / "arm.urdf", Mount(size, (0.1, 0.0, 0.6)))
    assert made != tmp_path / "arm.urdf"
    assert f"<{shape}" in made.read_text()
    assert mounted(tmp_path / "arm.urdf", Mount(size, (0.1, 0.0, 0.6))) == made
    assert mounted(tmp_path / "arm.urdf", Mount(size, (0.2, 0.0, 0.6))) != made


def test_a_base_is_no_narrower_than_what_its_arm_is_mounted_on(tmp_path: Path) -> None:
    (tmp_path / "arm.urdf").write_text(ARM_URDF)
    (tmp_path / "robot.toml").write_text(BASE.replace("robot.urdf", "arm.urdf") + "[mount]\nsize = [0.6, 0.8, 0.5]\n")
    assert bind_robot(tmp_path / "robot.toml").base.radius == pytest.approx(0.5)


def test_a_package_is_found_by_the_name_of_its_import_too() -> None:
    with pytest.raises(PackageNotFoundError):
        distribution("PIL")
    assert packaged("PIL", "PIL/Image.py") == packaged("pillow", "PIL/Image.py")


@pytest.mark.parametrize(
    ("lines", "named", "code"),
    [
        ('urdf = { package = "pybullet", file = "no_such.urdf" }', "no_such.urdf", "B014"),
        ('urdf = { package = "../../etc", file = "passwd" }', "../../etc", "B014"),
        ('urdf = { package = "pybullet" }', "urdf.file", "B001"),
        ('urdf = { package = "pybullet", file = "panda.urdf", folder = "x" }', "urdf.folder", "B001"),
        ('urdf = "arm.urdf"\n[mount]\nsize = [0.5]', "mount.size", "B001"),
        ('urdf = "arm.urdf"\n[mount]\nsize = [0.5, -1.0]', "mount.size", "B001"),
        ('urdf = "arm.urdf"\n[mount]\nsize = [0.5, 0.5]\nat = "top"', "mount.at", "B001"),
    ],
)
def test_errors_in_the_source_of_a_urdf_are_reported(lines: str, named: str, code: str, tmp_path: Path) -> None:
    (tmp_path / "arm.urdf").write_text(ARM_URDF)
    base = "[base]\nradius = 0.3\nspeed = 1\nacceleration = 1\nturn_speed = 1\nturn_acceleration = 1\njerk = 5\n"
    (tmp_path / "robot.toml").write_text(f'name = "mine"\n{lines}\n{base}')
    with refusal(code, naming=named):
        bind_robot(tmp_path / "robot.toml")


@pytest.mark.parametrize(
    ("stated", "unused"),
    [
        ('[arms.third]\ntip = "base_link"', "arms.third is not used: the self-model has no arm that ends there"),
        (
            "[joints.rotor]\nspeed = 1\nacceleration = 1\njerk = 1",
            "joints.rotor is not used: no arm, gripper, torso or neck",
        ),
        ("", None),
    ],
)
def test_each_part_of_a_robot_file_is_used_or_named(stated: str, unused: str | None, tmp_path: Path) -> None:
    folder = files.bundled("ontologies") / "robots"
    rotor = (
        '<link name="rotor_link"/><joint name="rotor" type="continuous"><parent link="base_link"/>'
        '<child link="rotor_link"/><axis xyz="0 0 1"/></joint></robot>'
    )
    (tmp_path / "amigo.urdf").write_text((folder / "amigo.urdf").read_text().replace("</robot>", rotor))
    shutil.copy(folder / "amigo.omn", tmp_path)
    (tmp_path / "amigo.toml").write_text(f"{(folder / 'amigo.toml').read_text()}\n{stated}\n")
    found = [one for one in bind_robot(tmp_path / "amigo.toml").diagnostics if one.code == "B011"]
    assert [one.message.startswith(unused or "") for one in found] == ([] if unused is None else [True])


def test_an_arm_is_meant_by_its_own_name_whatever_its_side(amigo: Robot) -> None:
    stacked = replace(amigo, arms=tuple(replace(amigo.arm(side), name=name) for side, name in ARM_NAMES.items()))
    for called in ("lower", "lowerArm", "lower_arm"):
        named = stacked.arms_of(Device("Arm", f"http://example.org/recipe.owl#{called}"))
        assert [arm.name for arm in named] == ["lower"]


ARM_NAMES = {"right": "upper", "left": "lower"}
