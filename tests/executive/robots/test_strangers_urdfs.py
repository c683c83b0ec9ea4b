"""URDFs of strangers: what the format requires is reported with its line, what it leaves optional is read."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from copy import deepcopy
from pathlib import Path
from xml.etree import ElementTree

import pytest
from click.testing import CliRunner
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from executive.cli.app import app
from executive.processes.workers import Ending, Limits, Reply, Worker
from executive.robots import bind_draft, bind_robot, vetting
from executive.robots.draft import draft_of
from planlang.diagnostics import BadInput
from planlang.geometry.urdf import read_urdf
from planlang.protocols import Configuration
from sim import CameraModel, PlanningWorld, RobotBody, Scene
from sim.description import read_description
from tests.support.refusals import refusal

INERTIAL = (
    '<inertial><origin xyz="0 0 0.1"/><mass value="5"/>'
    '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>'
)
LIMIT = '<limit lower="-1" upper="1" effort="10" velocity="1"/>'
CART = f"""<robot name="cart">
<link name="base">
{INERTIAL}
<visual><origin xyz="0 0 0.1"/><geometry><box size="0.4 0.3 0.2"/></geometry><material name="red"/></visual>
<collision><origin xyz="0 0 0.1" rpy="0 0 0"/><geometry><cylinder radius="0.2" length="0.2"/></geometry></collision>
</link>
<link name="mast"><collision><geometry><sphere radius="0.1"/></geometry></collision></link>
<link name="left"/>
<link name="right"/>
<joint name="lift" type="prismatic"><parent link="base"/><child link="mast"/><origin xyz="0 0 0.2"/><axis xyz="0 0 1"/>
<limit lower="0" upper="0.4" effort="10" velocity="0.1"/></joint>
<joint name="turn" type="revolute"><parent link="mast"/><child link="left"/>
<limit lower="-1" upper="1" effort="10" velocity="1"/></joint>
<joint name="follow" type="revolute"><parent link="mast"/><child link="right"/>
<limit lower="-1" upper="1" effort="10" velocity="1"/><mimic joint="turn" multiplier="-2" offset="0.5"/></joint>
<material name="red"><color rgba="1 0 0 1"/></material>
</robot>
"""
REQUIRED = {
    "the name of the robot": (' name="cart"', "", 1, "<robot> has no name"),
    "the name of a link": (' name="mast"', "", 7, "<link> has no name"),
    "the name of a joint": (' name="lift"', "", 10, "<joint> has no name"),
    "the type of a joint": (' type="revolute"', "", 12, "<joint> 'turn' has no type"),
    "a type of joints": ('"revolute"', '"Revolute"', 12, "joint 'turn' has the unknown type 'Revolute'"),
    "a parent": ('<parent link="base"/>', "", 10, "<joint> 'lift' has no <parent>"),
    "the link of a parent": ('<parent link="base"/>', "<parent/>", 10, "<parent> of joint 'lift' has no link"),
    "a child": ('<child link="left"/>', "", 12, "<joint> 'turn' has no <child>"),
    "a described child": ('<child link="left"/>', '<child link="lft"/>', 12, "'lft' that is not described"),
    "limits": (
        '<limit lower="0" upper="0.4" effort="10" velocity="0.1"/>',
        "",
        10,
        "'lift' is prismatic and has no",
    ),
    "limits in metres": ('upper="0.4"', 'upper="1e9"', 11, "at most 10000 m"),
    "limits in order": ('upper="0.4"', 'upper="-0.4"', 11, "the wrong way round"),
    "finite limits": ('upper="0.4"', 'upper="inf"', 11, "1 finite number"),
    "a speed": ('velocity="0.1"', 'velocity="1e-9"', 11, "a velocity of 1e-09; plausible are"),
    "a positive speed": ('velocity="0.1"', 'velocity="-1"', 11, "nonnegative velocity"),
    "a decimal point": ('upper="0.4"', 'upper="0,4"', 11, "1 finite number"),
    "an axis": ('<axis xyz="0 0 1"/>', '<axis xyz="0 0 0"/>', 10, "axis of length zero"),
    "the length of a cylinder": (' length="0.2"', "", 5, "<cylinder> of link 'base' has no length"),
    "the radius of a cylinder": ('radius="0.2" ', "", 5, "<cylinder> of link 'base' has no radius"),
    "the radius of a sphere": (' radius="0.1"', "", 7, "<sphere> of link 'mast' has no radius"),
    "the size of a box": (' size="0.4 0.3 0.2"', "", 4, "<box> of link 'base' has no size"),
    "three lengths of a box": ("0.4 0.3 0.2", "0.4 0.3", 4, "3 finite number"),
    "a box of this world": ("0.4 0.3 0.2", "0.4 0.3 1e9", 4, "at most 10000"),
    "an origin of this world": ("0 0 0.1", "0 0 1e300", 3, "at most 10000"),
    "a file of a mesh": ('<box size="0.4 0.3 0.2"/>', "<mesh/>", 4, "<mesh> of link 'base' has no filename"),
    "a geometry": (
        '<geometry><box size="0.4 0.3 0.2"/></geometry>',
        "",
        4,
        "<visual> of link 'base' has no <geom",
    ),
    "a shape": ('<box size="0.4 0.3 0.2"/>', "", 4, "<geometry> of link 'base' has no shape"),
    "the name of a material": ('<material name="red"/>', "<material/>", 4, "<material> of link 'base' has no name"),
    "a mass": ('<mass value="5"/>', "", 3, "<inertial> of link 'base' has no <mass>"),
    "the value of a mass": ('<mass value="5"/>', "<mass/>", 3, "<mass> of link 'base' has no value"),
    "a mass of at least 0": ('<mass value="5"/>', '<mass value="-5"/>', 3, "nonnegative value"),
    "a moment of inertia": (' ixx="1"', "", 3, "<inertia> of link 'base' has no ixx"),
    "a short name": ('"mast"', '"' + 300 * "m" + '"', 7, "a name of more than 255 bytes"),
    "a joint to mimic": (
        '<mimic joint="turn"',
        '<mimic joint="trun"',
        15,
        "mimics a joint 'trun' that is not",
    ),
    "another joint to mimic": ('<mimic joint="turn"', '<mimic joint="follow"', 15, "'follow' mimics itself"),
    "an end of mimicking": (
        '<limit lower="-1" upper="1" effort="10" velocity="1"/></joint>\n<joint name="follow"',
        '<limit lower="-1" upper="1"/><mimic joint="follow"/></joint>\n<joint name="follow"',
        13,
        "'turn' mimics follow and so itself",
    ),
    "an expanded name": ('link name="left"', 'link name="${side}_arm"', 8, "is not expanded"),
    "expanded macros": ('<link name="left"/>', '<xacro:wheel side="left"/>', 8, "<xacro:wheel> is not expanded"),
}
OPTIONAL = {
    "inertial": (INERTIAL, ""),
    "products of inertia": (' ixy="0" ixz="0"', ""),
    "material": ('<material name="red"/>', ""),
    "description of a material": ('<material name="red"><color rgba="1 0 0 1"/></material>', ""),
    "colour": (' rgba="1 0 0 1"', ""),
    "text of a material's name": ('<material name="red"/>', '<material name=""><color rgba="1 0 0 1"/></material>'),
    "origin": ('<origin xyz="0 0 0.2"/>', ""),
    "position": (' xyz="0 0 0.1" rpy="0 0 0"', ""),
    "axis": ('<axis xyz="0 0 1"/>', ""),
    "direction": (' xyz="0 0 1"', ""),
    "effort and velocity": (' effort="10" velocity="0.1"', ""),
    "infinite effort": ('effort="10"', 'effort="inf"'),
    "lower limit": ('lower="0" ', ""),
    "multiplier and offset": (' multiplier="-2" offset="0.5"', ""),
    "limits of a continuous joint": (
        f'type="revolute"><parent link="mast"/><child link="left"/>\n{LIMIT}',
        'type="continuous"><parent link="mast"/><child link="left"/>',
    ),
    "extensions": ('<link name="left"/>', '<link name="left"><contact><friction value="x"/></contact></link><gazebo/>'),
    "a second origin": ('<origin xyz="0 0 0.2"/>', '<origin xyz="0 0 0.2"/><origin xyz="x"/>'),
}  # fmt: skip


@pytest.fixture
def cart(tmp_path: Path) -> Callable[[str, str], Path]:
    """Write the cart with one part replaced."""

    def written(before: str, after: str) -> Path:
        assert before in CART
        path = tmp_path / "cart.urdf"
        path.write_text(CART.replace(before, after, 1))
        return path

    return written


@pytest.mark.parametrize("what", REQUIRED)
def test_what_the_format_requires_is_reported_with_its_line(cart: Callable[[str, str], Path], what: str) -> None:
    before, after, line, message = REQUIRED[what]
    with pytest.raises(BadInput) as caught:
        read_description(cart(before, after))
    (found,) = [one for one in caught.value.diagnostics if message in one.message]
    assert (found.code, found.span and found.span.line) == ("B009", line)


@pytest.mark.parametrize("what", OPTIONAL)
def test_what_the_format_leaves_optional_is_read_and_loaded(cart: Callable[[str, str], Path], what: str) -> None:
    path = cart(*OPTIONAL[what])
    world = PlanningWorld(Scene(()), RobotBody(path, CameraModel("base")))
    assert set(world.robot.joints) == {"lift", "turn"}
    world.close()


@pytest.mark.parametrize(
    ("before", "after", "advice"),
    [
        ('<link name="left"/>', '<link name="left"/><link name="world"/>', "nothing hangs from world: remove it"),
        ('<joint name="turn"', '<joint name="floor" type="fixed"><parent link="map"/><child link="base"/></joint>'
         '<joint name="turn"', 'add <link name="map"/>'),
        ('velocity="0.1"', 'velocity="-1.0"', "0 stands for unknown"),
    ],
)  # fmt: skip
def test_what_is_missing_for_one_tree_is_said(
    cart: Callable[[str, str], Path], before: str, after: str, advice: str
) -> None:
    with refusal("B009") as caught:
        read_urdf(cart(before, after))
    assert advice in str(caught.value.diagnostics[0])


def test_an_axis_without_direction_is_that_of_a_joint_without_axis(cart: Callable[[str, str], Path]) -> None:
    places = []
    for axis in ("", "<axis/>"):
        world = PlanningWorld(Scene(()), RobotBody(cart('<axis xyz="0 0 1"/>', axis), CameraModel("base")))
        places.append(world.link_pose("mast", Configuration((0.0, 0.0, 0.0), {"lift": 0.3, "turn": 0.0})).position)
        world.close()
    assert places[0] == places[1] == pytest.approx((0.3, 0.0, 0.2))


def test_a_joint_that_mimics_another_has_its_limits(cart: Callable[[str, str], Path]) -> None:
    path = cart('<limit lower="-1" upper="1" effort="10" velocity="1"/><mimic', "<mimic")
    assert [(one.lower, one.upper) for one in read_urdf(path).joints if one.name == "follow"] == [(-1.5, 2.5)]
    PlanningWorld(Scene(()), RobotBody(path, CameraModel("base"))).close()


@pytest.mark.parametrize(
    "words",
    [
        ("robot", "inspect", "{}"),
        ("robot", "make", "{}"),
        ("show", "{}"),
        ("match", "serve_a_drink", "--robot", "{}"),
        ("check", "{}"),
        ("run", "serve_a_drink", "--robot", "{}"),
        ("sweep", "serve_a_drink", "--worlds", "1", "--robot", "{}"),
        ("locate", "near the bottle", "--robot", "{}", "--environment", "hospital_room"),
    ],
    ids=lambda words: " ".join(words[:2]),
)
def test_a_joint_without_type_ends_no_command_by_a_signal(
    cart: Callable[[str, str], Path], words: tuple[str, ...], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    path = cart(' type="revolute"', "")
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(app, [word.format(path) for word in words])
    assert "cart.urdf:12:1: error B009 <joint> 'turn' has no type" in done.output


# What no schema excludes


@pytest.fixture
def other_cache(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Nothing was loaded before."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))


@pytest.mark.usefixtures("other_cache")
def test_a_urdf_that_crashes_the_simulator_is_refused(
    cart: Callable[[str, str], Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    def dies(worker: Worker, function: Callable[..., object], *arguments: object) -> Reply:
        return Reply(Ending.LOST if function is vetting.load else Ending.DONE)

    monkeypatch.setattr(Worker, "call", dies)
    path = cart("", "")
    for reads in (bind_robot, draft_of):
        with refusal("B009"):
            reads(path)
    monkeypatch.setattr(Worker, "call", lambda *_: Reply(Ending.LOST))
    assert bind_robot(path).name == "cart", "where no process can be started, nothing is refused"


@pytest.mark.usefixtures("other_cache")
def test_a_urdf_that_takes_too_long_to_load_is_refused(
    cart: Callable[[str, str], Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(vetting, "_LIMITS", Limits(wall=1e-6))
    with refusal("B009", naming="120 s"):
        vetting.vet(cart("", ""))


@pytest.mark.usefixtures("other_cache")
def test_a_urdf_is_found_from_the_folder_that_the_process_is_in_now(
    cart: Callable[[str, str], Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = cart("", "")
    vetting.vet(path)  # starts the other process in this folder
    monkeypatch.chdir(path.parent)
    vetting.vet(cart("0.4 0.3 0.2", "0.5 0.3 0.2").relative_to(path.parent))


@pytest.mark.usefixtures("other_cache")
def test_a_urdf_is_tried_once_and_bundled_ones_never(
    cart: Callable[[str, str], Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = cart("", "")
    vetting.vet(path)
    monkeypatch.setattr(Worker, "call", lambda *_: pytest.fail("loaded again"))
    vetting.vet(path)
    for name in ("amigo", "panda"):
        bind_robot(name)


# Anything

NUMBERS = ("0", "-1", "1e-300", "1e300", "9999", "nan", "inf", "", "x", "0 0 0", "10000", "0,5", "٣")


@st.composite
def mutations(draw: st.DrawFn) -> str:
    """The cart, changed in up to three places."""
    robot = ElementTree.fromstring(CART)
    for _ in range(draw(st.integers(1, 3))):
        every = list(robot.iter())
        element = every[draw(st.integers(0, len(every) - 1))]
        others = [None, *element]
        other = others[draw(st.integers(0, len(others) - 1))]
        attribute = draw(st.sampled_from(sorted(element.attrib) or ["name"]))
        match draw(st.integers(0, 4)):
            case 0 if other is not None:
                element.remove(other)
            case 1:
                element.attrib.pop(attribute, None)
            case 2:
                element.set(attribute, draw(st.sampled_from(NUMBERS)))
            case 3 if other is not None:
                element.append(deepcopy(other))
            case 4:
                element.tag = every[draw(st.integers(0, len(every) - 1))].tag
    return ElementTree.tostring(robot, "unicode")


@given(mutations())
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_any_change_of_a_urdf_gives_a_robot_or_diagnostics(text: str) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "any.urdf"
        path.write_text(text)
        try:
            draft = draft_of(path)  # loads it in another process first
            bind_draft(draft, path)
        except BadInput as problem:
            found = problem.diagnostics
        else:
            found = ()
    assert all(one.span is not None and one.span.file == str(path) for one in found)
