"""Drafts of robot files from URDFs: real arms and robots, SRDFs, and hostile files."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pybullet_data
import pytest
from cli_runs import invoke
from click.testing import CliRunner
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from executive.cli.app import app
from executive.robots import bind_draft, bind_robot
from executive.robots.draft import draft_of, toml, toml_key
from planlang.diagnostics import BadInput, has_errors
from planlang.files import bundled
from planlang.geometry.urdf import joints_between, read_urdf
from tests.support.examples import examples
from tests.support.refusals import refusal

ARMS = Path(pybullet_data.getDataPath())
AMIGO = bundled("ontologies") / "robots" / "amigo.urdf"
BOX = '<collision><origin xyz="0 0 {z}"/><geometry><box size="0.06 0.06 0.1"/></geometry></collision>'
FINGER = '<collision><origin xyz="0 0 0.03"/><geometry><box size="0.02 0.01 0.06"/></geometry></collision>'


def joint(name: str, parent: str, child: str, xyz: str, axis: str, limits: str = "-2 2", kind: str = "revolute") -> str:
    """A joint as URDF."""
    lower, upper = limits.split()
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/><origin xyz="{xyz}"/>'
        f'<axis xyz="{axis}"/><limit lower="{lower}" upper="{upper}" effort="1" velocity="1"/></joint>'
    )


def arm(links: int = 6, *, limits: str = "-2 2", fingers: bool = True, more: str = "") -> str:
    """A serial arm as URDF, with two fingers that slide along y at its end."""
    parts = [f'<link name="l{k}">{BOX.format(z=0.05)}</link>' for k in range(links + 1)]
    parts += [
        joint(f"j{k}", f"l{k}", f"l{k + 1}", "0 0 0.12", ("0 0 1", "0 1 0")[k % 2], limits) for k in range(links - 1)
    ]
    parts.append(joint(f"j{links - 1}", f"l{links - 1}", f"l{links}", "0 0 0.12", "0 0 1", limits))
    for name, y in (("left", 1), ("right", -1)) if fingers else ():
        parts.append(f'<link name="{name}">{FINGER}</link>')
        travel = ("0 0.04", "-0.04 0")[y < 0]
        parts.append(joint(name, f"l{links}", name, f"0 {y * 0.005} 0.1", "0 1 0", travel, "prismatic"))
    return f'<robot name="arm">{"".join(parts)}{more}</robot>'


def made(path: Path, srdf: Path | None = None) -> dict[str, Any]:
    """The draft of a URDF's robot file as data, after binding it once."""
    draft = draft_of(path, srdf)
    assert not has_errors(bind_draft(draft, path).diagnostics)
    return tomllib.loads(draft.text())


@pytest.fixture
def urdf(tmp_path: Path) -> Path:
    """A fixed arm with a parallel gripper."""
    (tmp_path / "arm.urdf").write_text(arm())
    return tmp_path / "arm.urdf"


# Real robots


def test_the_draft_of_amigo_agrees_with_its_robot_file() -> None:
    found, stated = made(AMIGO), tomllib.loads(AMIGO.with_suffix(".toml").read_text())
    for side in ("left", "right"):
        one, other = found["arms"][side], stated["arms"][side]
        for key in ("side", "tip", "hand", "approach", "closing"):
            assert one[key] == other[key], key
        assert set(one["gripper"]["fingers"]) == set(other["gripper"]["fingers"])
        assert one["gripper"]["max_opening"] == pytest.approx(other["gripper"]["max_opening"], abs=0.02)
    for key in ("link", "neck", "forward", "up"):
        assert found["camera"][key] == stated["camera"][key], key
    assert found["base"]["radius"] == pytest.approx(stated["base"]["radius"], abs=0.05)


@pytest.mark.parametrize(
    ("file", "joints", "tip", "offset", "opening"),
    [
        ("franka_panda/panda.urdf", 7, "panda_grasptarget", None, 0.08),
        ("xarm/xarm6_with_gripper.urdf", 6, "xarm_gripper_base_link", (0.0, 0.0, 0.155), 0.085),
        ("xarm/xarm6_robot.urdf", 6, "link6", None, None),
        ("kuka_iiwa/model.urdf", 7, "lbr_iiwa_link_7", None, None),
    ],
)
def test_published_arms_end_in_their_hands(
    file: str, joints: int, tip: str, offset: tuple[float, ...] | None, opening: float | None
) -> None:
    path = ARMS / file
    draft = draft_of(path)
    robot = bind_draft(draft, path)
    (one,) = robot.arms
    assert len(one.joints) == joints
    assert np.allclose(one.approach, (0, 0, 1))
    assert (one.gripper.max_opening if one.gripper else None) == (opening and pytest.approx(opening, abs=0.01))
    described = tomllib.loads(draft.text())["arms"]["arm"]
    assert described["tip"] == tip
    assert described.get("tool_offset") == (None if offset is None else pytest.approx(offset, abs=0.01))
    missing = " ".join(d.message for d in draft.diagnostics() if d.code == "B016")
    assert ("gripper" in missing) == (opening is None)
    assert "camera" in missing
    assert robot.base.fixed


def test_a_real_pr2_has_two_arms_a_camera_on_a_neck_and_a_mobile_base(corpus: Path) -> None:
    path = corpus / "robots" / "pr2@hydro.urdf"
    robot = bind_robot(path)
    assert [(one.side, one.tip, len(one.joints)) for one in robot.arms] == [
        ("right", "r_gripper_tool_frame", 7),
        ("left", "l_gripper_tool_frame", 7),
    ]
    assert robot.torso == "torso_lift_joint"
    assert robot.camera is not None
    assert (robot.camera.link, robot.neck) == ("wide_stereo_optical_frame", ("head_pan_joint", "head_tilt_joint"))
    assert not robot.base.fixed
    assert robot.base.radius == pytest.approx(0.45, abs=0.05)
    assumed = [one.message for one in robot.diagnostics if "max_opening" in one.message]
    assert len(assumed) == 2, "the meshes of the fingers are not there: their gap is a guess"


# Contents


def test_approach_closing_direction_and_grip_point_are_measured_on_the_fingers(urdf: Path) -> None:
    found = made(urdf)["arms"]["arm"]
    assert found["approach"] == [0, 0, 1]
    assert np.abs(found["closing"]).tolist() == [0, 1, 0]
    assert found["tool_offset"] == pytest.approx([0, 0, 0.14], abs=0.005)
    assert found["gripper"]["opened"] == {"left": 0.04, "right": -0.04}
    assert found["gripper"]["closed"] == {"left": 0.0, "right": 0.0}
    assert found["gripper"]["max_opening"] == pytest.approx(0.95 * 0.08, abs=0.002)


def test_a_robot_that_reaches_below_the_floor_is_reported_until_it_has_a_mount(tmp_path: Path) -> None:
    pedestal = '<collision><origin xyz="0 0 -0.45"/><geometry><box size="0.2 0.2 0.9"/></geometry></collision>'
    (tmp_path / "arm.urdf").write_text(f'<robot name="arm"><link name="l0">{pedestal}</link></robot>')
    draft = draft_of(tmp_path / "arm.urdf")
    missing = " ".join(one.message for one in draft.diagnostics() if one.code == "B016")
    assert "stands 0.90 m in the floor: [mount] size" in missing
    text = draft.text()
    assert "# size = [0.4, 0.4, 0.9]" in text
    files = {"sunk.toml": text, "mounted.toml": text.replace("# [mount]", "[mount]").replace("# size", "size")}
    for name, content in files.items():
        (tmp_path / name).write_text(content)
        shown = CliRunner().invoke(app, ["robot", "inspect", str(tmp_path / name)]).stdout
        assert ("stands 0.90 m in the floor" in shown) == (name == "sunk.toml")


def test_a_jaw_that_closes_on_a_fixed_one_is_opened_as_far_as_both_are_in_front(tmp_path: Path) -> None:
    fixed = '<collision><origin xyz="0 -0.01 0.06"/><geometry><box size="0.02 0.01 0.14"/></geometry></collision>'
    jaw = f'<link name="jaw">{FINGER}</link>' + joint("jaw", "l6", "jaw", "0 0.0 0.07", "-1 0 0", "0 1.5")
    text = arm(fingers=False, more=jaw).replace('<link name="l6">', f'<link name="l6">{fixed}')
    (tmp_path / "jaw.urdf").write_text(text)
    found = made(tmp_path / "jaw.urdf")["arms"]["arm"]
    assert found["approach"] == [0, 0, 1]
    assert np.abs(found["closing"]).tolist() == [0, 1, 0]
    assert found["gripper"]["closed"] == {"jaw": 0.0}
    assert 0.3 < found["gripper"]["opened"]["jaw"] < 1.2
    assert 0.01 < found["gripper"]["max_opening"] < 0.06


def test_an_opening_that_cannot_be_measured_is_missing_and_the_robot_has_no_gripper(tmp_path: Path) -> None:
    jaw = '<link name="jaw"/>' + joint("jaw", "l6", "jaw", "0 0.0 0.07", "-1 0 0", "0 1.5")
    (tmp_path / "jaw.urdf").write_text(arm(fingers=False, more=jaw))
    draft = draft_of(tmp_path / "jaw.urdf")
    (found,) = (one.message for one in draft.diagnostics() if "max_opening" in one.message)
    assert "no gap between two fingers" in found
    assert "# opened = { jaw = " in draft.text()
    assert bind_draft(draft, tmp_path / "jaw.urdf").arms[0].gripper is None


def test_every_value_of_a_robot_file_has_its_reason_and_what_is_missing_is_a_comment(urdf: Path) -> None:
    lines = draft_of(urdf).text().splitlines()
    assert any(line.startswith("# link =") for line in lines), "no camera"
    assert any(line.startswith("tip = ") and "6 joints" in line for line in lines)
    assert all(len(line) <= 120 for line in lines if line.startswith("#"))


def test_a_tool_offset_moves_the_grip_point_in_the_frame_of_the_tip(urdf: Path) -> None:
    lines = ['name = "arm"', 'urdf = "arm.urdf"', "[base]", "radius = 0.2", "fixed = true", "[arms.arm]", 'tip = "l6"']
    (urdf.parent / "arm.toml").write_text("\n".join([*lines, "tool_offset = [0.01, -0.02, 0.3]"]))
    robot = bind_robot(urdf.parent / "arm.toml")
    (one,) = robot.arms
    (last,) = joints_between(read_urdf(robot.urdf).joints, "l6", one.tip)
    assert last.origin[:3, 3].tolist() == [0.01, -0.02, 0.3]
    assert len(one.joints) == 6


def test_an_invalid_tool_offset_is_reported_with_its_line(urdf: Path) -> None:
    lines = ['name = "arm"', 'urdf = "arm.urdf"', "[base]", "radius = 0.2", "fixed = 1", "[arms.arm]", 'tip = "l6"']
    (urdf.parent / "arm.toml").write_text("\n".join([*lines, "tool_offset = [0.1, nan, 0]"]))
    with pytest.raises(BadInput) as caught:
        bind_robot(urdf.parent / "arm.toml")
    assert [(d.code, d.span and d.span.line) for d in caught.value.diagnostics] == [("B001", 8), ("B001", 5)]


def test_a_missing_mesh_is_reported_where_the_urdf_names_it_though_a_copy_is_loaded(urdf: Path) -> None:
    mesh = '<link name="cover"><visual><geometry>\n<mesh filename="cover.glb"/></geometry></visual></link>'
    fixed = '<joint name="c" type="fixed"><parent link="l6"/><child link="cover"/></joint>'
    urdf.write_text(arm(more=f"{mesh}{fixed}"))
    (urdf.parent / "arm.toml").write_text(draft_of(urdf).text())
    robot = bind_robot(urdf.parent / "arm.toml")
    assert robot.urdf != urdf
    (found,) = [one for one in robot.diagnostics if one.code == "B013"]
    assert found.span is not None
    assert (Path(found.span.file).name, found.span.line) == ("arm.urdf", 2)


# SRDF


SRDF = """<robot name="arm">
<group name="manipulator"><chain base_link="l0" tip_link="l6"/></group>
<end_effector name="hand" parent_link="l6" group="hand" parent_group="manipulator"/>
<virtual_joint name="world" type="planar" parent_frame="odom" child_link="l0"/>
<group_state name="tucked" group="manipulator"><joint name="j1" value="1.5"/><joint name="nobody" value="1"/>
<joint name="j2" value="99"/></group_state>
<disable_collisions link1="l1" link2="l3" reason="User"/>
<disable_collisions link1="l0" link2="l3" reason="Never"/>
<disable_collisions link1="l0" link2="elsewhere" reason="User"/>
</robot>"""


def test_an_srdf_beside_the_urdf_states_base_arms_postures_and_allowed_contacts(urdf: Path) -> None:
    urdf.with_suffix(".srdf").write_text(SRDF)
    found = made(urdf)
    assert found["base"]["fixed"] is False
    assert found["base"]["speed"] > 0
    assert list(found["arms"]) == ["manipulator"]
    assert found["allowed_contacts"] == [["l1", "l3"]]
    assert found["postures"] == {"carrying": {"j1": 1.5}, "tucked": {"j1": 1.5}}, "the others cannot be taken"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"nobody"', '"j3"', "joint 'j2' is at 99, outside its limits [-2, 2]"),
        ('value="99"', 'value="nan"', "joint 'j2' needs a single number, not 'nan'"),
        ('value="99"', 'value="0"', "the URDF has no joint 'nobody'"),
        ('parent_link="l6"', 'parent_link="l60"', "the URDF has no link 'l60'"),
    ],
)
def test_what_an_srdf_states_and_the_urdf_lacks_is_reported_with_its_line(
    urdf: Path, old: str, new: str, message: str
) -> None:
    urdf.with_suffix(".srdf").write_text(SRDF.replace(old, new))
    found = [one for one in draft_of(urdf).diagnostics() if one.code == "B011" and message in one.message]
    assert [(one.severity.value, one.span and Path(one.span.file).name) for one in found] == [("warning", "arm.srdf")]


def test_a_state_may_place_the_robot_and_fingers_that_follow(urdf: Path) -> None:
    urdf.write_text(arm().replace('upper="0.04" effort="1" velocity="1"/>', 'upper="0.04"/><mimic joint="j1"/>'))
    positions = '<joint name="world" value="0 0 0"/><joint name="left" value="0"/><joint name="j1" value="1"/>'
    srdf = re.sub(r"(?s)(<group_state[^>]*>).*?</group", rf"\1{positions}</group", SRDF)
    urdf.with_suffix(".srdf").write_text(srdf)
    assert "B011" not in [one.code for one in draft_of(urdf).diagnostics()]


@pytest.mark.parametrize("content", [arm(), '<robot name="arm"><xacro:arm prefix=""/></robot>'])
def test_a_urdf_or_xacro_in_place_of_an_srdf_is_refused(urdf: Path, content: str) -> None:
    urdf.with_suffix(".srdf").write_text(content)
    with refusal("B009"):
        draft_of(urdf)


@pytest.mark.parametrize("content", ["", "<robot", "<sdf/>", '<!DOCTYPE r [<!ENTITY a "b">]><robot name="&a;"/>'])
def test_an_invalid_srdf_is_refused_with_its_name(urdf: Path, content: str) -> None:
    urdf.with_suffix(".srdf").write_text(content)
    with refusal("B009", naming="arm.srdf") as caught:
        draft_of(urdf)
    assert [d.code for d in caught.value.diagnostics] == ["B009"]


# Strangers' files


@pytest.mark.parametrize(
    "content",
    [
        "",
        "<robot/>",
        '<robot name="r"><link name="a"/><link name="b"/>'
        + joint("j", "a", "b", "0 0 0", "0 0 1")
        + joint("k", "b", "a", "0 0 0", "0 0 1")
        + "</robot>",
        arm(limits="nan 1"),
        arm(limits="3 -3"),
        arm(130),
    ],
    ids=["empty", "no links", "a circle", "no number", "exchanged limits", "too many joints"],
)
def test_a_urdf_that_cannot_be_a_robot_is_refused(tmp_path: Path, content: str) -> None:
    (tmp_path / "robot.urdf").write_text(content)
    with pytest.raises(BadInput) as caught:
        draft_of(tmp_path / "robot.urdf")
    assert {d.code for d in caught.value.diagnostics} == {"B009"}


@pytest.mark.parametrize("limits", ["0 0", "-90 90", "0 1e-12"])
def test_implausible_limits_are_reported_under_the_key_that_replaces_them(tmp_path: Path, limits: str) -> None:
    urdf, file = tmp_path / "robot.urdf", tmp_path / "robot.toml"
    urdf.write_text(arm(limits=limits))
    draft = draft_of(urdf)
    assert bind_draft(draft, urdf).arms
    assert any(d.message.startswith("[joints.j0] missing: limits: ") for d in draft.diagnostics() if d.code == "B016")
    advised = re.sub(r"(?m)^# (\[joints\.j\d\]|limits = )", r"\1", draft.text())
    file.write_text(advised)
    robot = bind_robot(file)
    assert not has_errors(robot.diagnostics)
    assert [(joint.lower, joint.upper) for joint in read_urdf(robot.urdf).joints if joint.name == "j0"] == [(-2.9, 2.9)]
    assert robot.limits["j0"] == bind_draft(draft, urdf).limits["j0"], "its speed is still that of the URDF"


@pytest.mark.parametrize("limits", ["-1e9 1e9", "-1e308 1e308", "-1e16 1e16"])
def test_a_revolute_joint_without_a_plausible_end_is_read_as_continuous(tmp_path: Path, limits: str) -> None:
    (tmp_path / "robot.urdf").write_text(arm(limits=limits))
    robot = bind_robot(tmp_path / "robot.urdf")
    assert robot.arms
    assert any("turns without end" in d.message for d in robot.diagnostics if d.code == "B010")


@pytest.mark.parametrize(
    "content", ['<robot name="r"><link name="a"/></robot>', arm(2, fingers=False), arm(3, limits="-1 1")]
)
def test_a_robot_without_arms_is_a_robot_and_the_arms_are_missing(tmp_path: Path, content: str) -> None:
    (tmp_path / "robot.urdf").write_text(content)
    robot = bind_robot(tmp_path / "robot.urdf")
    assert robot.arms == ()
    assert any("no chain" in d.message for d in robot.diagnostics if d.code == "B016")


def test_legs_and_heads_are_not_arms(tmp_path: Path) -> None:
    for word in ("leg", "Neck", "knee"):
        (tmp_path / "walker.urdf").write_text(arm(fingers=False).replace('"j2"', f'"{word}_2"'))
        assert bind_robot(tmp_path / "walker.urdf").arms == ()


@pytest.mark.long
@pytest.mark.parametrize("file", ["plane_implicit.urdf", "samurai.urdf", "laikago/laikago.urdf", "r2d2.urdf"])
def test_urdfs_that_are_hardly_robots_give_a_robot_file(file: str) -> None:
    assert made(ARMS / file)["base"]["radius"] > 0


@pytest.mark.long
@given(st.text(min_size=1, max_size=20))
def test_any_text_can_be_a_key_and_a_value_of_the_file(text: str) -> None:
    assert tomllib.loads(f"{toml_key(text)} = {toml(text)}") == {text: text}


SEPARATORS = ("Cc", "Cs", "Zs", "Zl", "Zp")
LETTERS = st.characters(codec="utf-8", exclude_categories=SEPARATORS, exclude_characters="<&\"'$")


@settings(max_examples=examples(50), suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow])
@given(st.lists(st.text(LETTERS, min_size=1, max_size=8), min_size=3, max_size=3, unique=True))
def test_names_of_any_kind_give_a_file_that_can_be_read(tmp_path: Path, names: list[str]) -> None:
    text = arm()
    for old, new in zip(("j1", "left", "l6"), names, strict=True):
        text = text.replace(f'"{old}"', f'"{new}_"')
    (tmp_path / "named.urdf").write_text(text, encoding="utf-8")
    assert made(tmp_path / "named.urdf")["arms"]


def test_each_missing_part_of_a_new_robot_file_is_printed(tmp_path: Path) -> None:
    printed = invoke("robot", "make", ARMS / "xarm" / "xarm6_with_gripper.urdf", "-o", tmp_path / "arm.toml").stderr
    assert "[mount] missing" in printed
    assert "[camera] missing" in printed
