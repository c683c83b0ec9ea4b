"""Facts about reachability maps, on a short arm upon a lift: what a row says is so, and inverting it finds the base."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from executive.locations import reachability_maps
from executive.locations.inverse_maps import InverseMap
from executive.locations.reachability import CELL, GraspClass, ReachabilityMap, is_bound, sampled
from executive.locations.reachability_maps import build_map, bundled_file, map_key, packed, reachability_map, unpacked
from executive.motion import Chain
from executive.robots import Arm, Gripper
from executive.robots.arms import ArmModel, HandFrame, lift_of
from planlang.geometry import Array

JOINTS = [
    ("lift", "prismatic", "0 0 1", "0.1 0 0.5", "0.1", "0.4"),
    ("turn", "revolute", "0 0 1", "0 0 0", "-2", "2"),
    ("lower", "revolute", "0 1 0", "0 0 0", "-1.8", "1.8"),
    ("roll", "revolute", "1 0 0", "0.14 0 0", "-2", "2"),
    ("elbow", "revolute", "0 1 0", "0 0 0", "-2", "2"),
    ("twist", "revolute", "1 0 0", "0.12 0 0", "-2", "2"),
    ("bend", "revolute", "0 1 0", "0 0 0", "-1.6", "1.6"),
    ("swing", "revolute", "0 0 1", "0 0 0", "-1.6", "1.6"),
]
SCARA = [
    ("post", "prismatic", "0 0 1", "0 0 0.3", "0", "0.5"),
    ("turn", "revolute", "0 0 1", "0.1 0 0", "-2", "2"),
    ("elbow", "revolute", "0 0 1", "0.2 0 0", "-2", "2"),
    ("wrist", "revolute", "0 0 1", "0.2 0 0", "-2", "2"),
]
STAGES = [(f"stage_{k}", "prismatic", "0 -1 0", "0 0 0", "0", "0.13") for k in range(4)]
TELESCOPE = [("mast", "prismatic", "0 0 1", "0 0.1 0.2", "0", "1"), *STAGES]
WRIST = [
    ("yaw", "revolute", "0 0 1", "0.08 0 0.02", "-1.7", "3"),
    ("pitch", "revolute", "0 1 0", "0 0 0", "-0.6", "1.57"),
    ("roll", "revolute", "1 0 0", "0.05 0 0", "-3", "3"),
]
GANTRY = [
    ("ahead", "prismatic", "1 0 0", "0.2 0 0.3", "0", "0.1"),
    ("aside", "prismatic", "0 1 0", "0 0 0", "-0.05", "0.05"),
    ("up", "prismatic", "0 0 1", "0 0 0", "0", "0.1"),
    ("turn", "revolute", "0 0 1", "0 0 0", "-1.5", "1.5"),
    ("bend", "revolute", "0 1 0", "0 0 0", "-1", "1"),
    ("twist", "revolute", "1 0 0", "0 0 0", "-1", "1"),
]


GRIPPER = Gripper("gripper", None, (), {}, {}, (), max_opening=0.1)


def arm_of(folder: Path, joints: Sequence[tuple[str, ...]] = JOINTS, torso: str | None = None) -> ArmModel:
    """By default seven joints on a lift, 0.32 m from shoulder to tip; ``torso`` is the joint that lifts them."""
    links = "".join(
        f'<joint name="{name}" type="{kind}"><parent link="l{i}"/><child link="l{i + 1}"/><origin xyz="{origin}"/>'
        f'<axis xyz="{axis}"/><limit lower="{low}" upper="{high}" velocity="1"/></joint>'
        for i, (name, kind, axis, origin, low, high) in enumerate(joints)
    )
    tip = f'<joint name="tool" type="fixed"><parent link="l{len(joints)}"/><child link="tip"/>'
    tip += '<origin xyz="0.06 0 0"/></joint>'
    named = "".join(f'<link name="{name}"/>' for name in (*(f"l{i}" for i in range(len(joints) + 1)), "tip"))
    (folder / "arm.urdf").write_text(f'<robot name="arm">{named}{links}{tip}</robot>')
    chain = Chain.from_urdf(folder / "arm.urdf", "l0", "tip")
    middle = (chain.lower + chain.upper) / 2
    return ArmModel(
        part=Arm("arm", None, None, chain.names, "l0", "tip", "tip", (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), GRIPPER),
        chain=chain,
        resolution=np.full(len(joints), 0.05),
        frame=HandFrame((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
        hand_links=frozenset({"tip"}),
        hand_radius=0.03,
        shoulder_low=np.array([0.1, 0.0, 0.6]),
        shoulder_high=np.array([0.1, 0.0, 0.9]),
        reach=0.33,
        seeds=middle[None],
        lift=lift_of(chain, torso),
    )


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> ArmModel:
    """The short arm."""
    return arm_of(tmp_path_factory.mktemp("arm"), torso="lift")


Maps = dict[GraspClass, ReachabilityMap]


@pytest.fixture(scope="module")
def maps(arm: ArmModel) -> Maps:
    """Its maps."""
    return {grasp: reachability_map(arm, grasp) for grasp in GraspClass}


def some(found: ReachabilityMap, count: int = 200) -> Array:
    """Evenly drawn rows of a map."""
    return np.unique(np.linspace(0, len(found) - 1, count).astype(np.intp))


@pytest.mark.parametrize("grasp", GraspClass)
@pytest.mark.parametrize("torso", [0.1, 0.27])
def test_the_joints_of_a_row_take_the_tip_to_its_pose_within_limits(
    arm: ArmModel, maps: Maps, grasp: GraspClass, torso: float
) -> None:
    found = maps[grasp]
    assert len(found) > 1000
    rows = some(found)
    q = found.seeds(rows, torso)
    np.testing.assert_allclose(arm.chain.fk(q), found.poses(rows, torso), atol=1.5e-3)
    assert arm.chain.within(q, 1e-6).all()
    assert (q[:, 0] == torso).all()
    score = found.rows["score"]
    assert 0 < score.min() < 0.1 < 0.9 < score.max() <= 1


@given(
    grasp=st.sampled_from(list(GraspClass)),
    x=st.floats(-5, 5),
    y=st.floats(-5, 5),
    z=st.floats(0.5, 1.1),
    heading=st.floats(-math.pi, math.pi),
    roll=st.sampled_from([1, -1]),
)
def test_from_every_base_that_is_found_the_tip_is_at_the_target(
    arm: ArmModel, maps: Maps, grasp: GraspClass, x: float, y: float, z: float, heading: float, roll: int
) -> None:
    found = maps[grasp]
    inverse = InverseMap(found).rows(z, roll, 0.0, 1_000_000)
    assert set(inverse.torsos) <= set(found.heights(z))
    c, s = math.cos(heading), math.sin(heading)
    chosen = slice(None, None, max(1, len(inverse.row) // 20))
    poses = arm.chain.fk(found.seeds(inverse.row[chosen], inverse.torso[chosen]))
    for pose, v, yaw in zip(poses, inverse.v[chosen], inverse.yaw[chosen], strict=True):
        base = x - (c * v[0] - s * v[1]), y - (s * v[0] + c * v[1]), heading - yaw
        turn = np.eye(3)
        turn[:2, :2] = [[math.cos(base[2]), -math.sin(base[2])], [math.sin(base[2]), math.cos(base[2])]]
        np.testing.assert_allclose(turn @ pose[:3, 3] + [base[0], base[1], 0.0], (x, y, z), atol=5e-4)
        np.testing.assert_allclose(turn @ pose[:3, :3], grasp.rotations(heading, roll, arm.frame), atol=3e-3)


def test_a_height_that_no_torso_position_reaches_has_none(maps: Maps) -> None:
    found = maps[GraspClass.SIDE]
    assert found.heights(0.05) == ()
    assert found.heights(2.0) == ()
    heights = found.heights(0.83)
    assert len(heights) >= 5
    assert all(0.1 <= torso <= 0.4 for torso in heights)
    np.testing.assert_allclose(np.diff(heights), CELL)


def test_poses_of_rows_are_found_again_and_others_are_not(maps: Maps) -> None:
    for grasp, found in maps.items():
        rows = some(found)
        poses = found.poses(rows, 0.2)
        headings, rolls = found.rows["yaw"][rows] * (2 * np.pi / 24), found.rows["roll"][rows]
        assert (found.find(poses[:, :3, 3] + 0.02, headings + 0.1, rolls, 0.2) == rows).all()
        assert (found.find(poses[:, :3, 3] + [9.0, 0.0, 0.0], headings, rolls, 0.2) == -1).all()
        if grasp is GraspClass.TOP:
            assert (found.find(poses[:, :3, 3], headings + np.pi, -rolls, 0.2) == rows).all()


def test_what_random_postures_reach_is_in_the_map(arm: ArmModel, maps: Maps) -> None:
    chain, found = arm.chain.locked({"lift": 0.1}), maps[GraspClass.SIDE]
    rng = np.random.default_rng(3)
    poses = found.poses(rng.integers(0, len(found), 300), 0.1)
    poses[:, 0, 3] += CELL * rng.integers(-2, 3, 300)
    poses[:, 1, 3] += CELL * rng.integers(-2, 3, 300)
    seeds = chain.sample(rng, (300, 30))
    _, reachable = chain.solve(poses, seeds)
    headings = np.arctan2(poses[:, 1, 0], poses[:, 0, 0])
    rolls = np.where(poses[:, 2, 2] > 0, 1, -1)
    known = found.find(poses[:, :3, 3], headings, rolls, 0.1) >= 0
    assert 50 < reachable.sum() < 300
    assert known[reachable].mean() >= 0.97
    assert (known & ~reachable).mean() <= 0.03


def test_a_hand_that_cannot_be_turned_upside_down_has_no_rows_with_the_other_roll(tmp_path: Path) -> None:
    arm = arm_of(tmp_path, GANTRY)
    found = reachability_map(arm, GraspClass.SIDE)
    assert len(found) > 0
    assert (found.rows["roll"] == 1).all()
    assert (arm.chain.fk(found.seeds(np.arange(len(found))))[:, 2, 2] > 0).all(), "the hand's z axis points up"


def test_neither_has_one_of_few_joints(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("executive.locations.reachability.POSTURES", 1000)
    monkeypatch.setattr("executive.locations.reachability.SAMPLED_AT_ONCE", 1000)
    arm = arm_of(tmp_path, SCARA)
    kinds = [(grasp, roll) for grasp in GraspClass for roll in grasp.rolls]
    found = [len(sampled(arm.chain, grasp, arm.frame, roll, 0.0, np.random.default_rng(0))[0]) for grasp, roll in kinds]
    assert [kind for kind, number in zip(kinds, found, strict=True) if number] == [(GraspClass.SIDE, 1)]


def at_height(height: float, lift: float = 0.5) -> list[tuple[str, ...]]:
    """The SCARA with its post mounted at a height [m], and another travel of the lift [m]."""
    return [("post", "prismatic", "0 0 1", f"0 0 {height}", "0", f"{lift}"), *SCARA[1:]]


@pytest.fixture
def few_postures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Sample a twentieth of the postures."""
    for name in ("POSTURES", "SAMPLED_AT_ONCE"):
        monkeypatch.setattr(f"executive.locations.reachability.{name}", 3000)


@settings(max_examples=12)
@given(height=st.floats(0.1, 0.9), share=st.floats(0.0, 1.0))
@example(height=0.4998, share=0.0)
@example(height=0.4998, share=1.0)
def test_a_lift_takes_an_arm_that_cannot_rise_itself_to_every_height_from_any_mount(
    tmp_path_factory: pytest.TempPathFactory, height: float, share: float
) -> None:
    with pytest.MonkeyPatch.context() as patch:
        for name in ("POSTURES", "SAMPLED_AT_ONCE"):
            patch.setattr(f"executive.locations.reachability.{name}", 3000)
        arm = arm_of(tmp_path_factory.mktemp("scara"), at_height(height), torso="post")
        found = build_map(arm, GraspClass.SIDE)
    usual = 1640
    assert abs(len(found) - usual) < 0.02 * usual, "the height of the mount does not matter"
    z = height + 0.5 * share
    rows = InverseMap(found).rows(z, 1, 0.0, 1_000_000)
    assert len(rows.row) == len(found)
    tips = arm.chain.fk(found.seeds(rows.row[:50], rows.torso[:50]))
    np.testing.assert_allclose(tips[:, 2, 3], z, atol=1.1e-3)


def test_heights_out_of_the_lift_s_range_have_no_rows(tmp_path: Path, few_postures: None) -> None:
    found = build_map(arm_of(tmp_path, at_height(0.43), torso="post"), GraspClass.SIDE)
    assert [bool(found.heights(z)) for z in (0.42, 0.43, 0.441, 0.93, 0.94)] == [False, True, True, True, False]


def test_a_lift_shorter_than_a_cell_reaches_all_heights_between(tmp_path: Path) -> None:
    lifted = [("lift", "prismatic", "0 0 1", "0.1 0 0.5", "0", "0.02"), *JOINTS[1:]]
    found = build_map(arm_of(tmp_path, lifted, torso="lift"), GraspClass.TOP)
    lowest, highest = CELL * found.lowest_level, CELL * int(found.rows["z"][-1])
    assert highest - lowest > 0.2
    assert all(found.heights(z) for z in np.arange(lowest, highest + 0.02, 0.005).tolist())


def test_the_stages_of_a_telescope_are_one_freedom(tmp_path: Path, few_postures: None) -> None:
    arm = arm_of(tmp_path, [*TELESCOPE, WRIST[0]], torso="mast")
    assert arm.chain.mobility() == 3
    assert is_bound(arm)
    found = build_map(arm, GraspClass.SIDE)
    assert len(found) > 200
    tips = found.arm.chain.fk(found.seeds(np.arange(len(found)), 0.3))
    wrist = tips[:, 1, 3] - 0.06 * tips[:, 1, 0] + 0.52 - 0.1
    assert wrist.min() < 0.02, "all out"
    assert wrist.max() > 0.5, "all in"
    assert found.rows["score"].min() < 0.2 < 0.9 < found.rows["score"].max(), "postures differ in worth"


def test_a_telescope_with_a_wrist_of_three_reaches_from_the_side_above_and_between(
    tmp_path: Path, few_postures: None
) -> None:
    arm = arm_of(tmp_path, [*TELESCOPE, *WRIST], torso="mast")
    assert (arm.chain.dof, arm.chain.mobility()) == (8, 5)
    for grasp in GraspClass:
        found = build_map(arm, grasp)
        assert len(found) > 100, "also from above, where the pitch of 1.57 is all but a right angle"
        rows = some(found, 20)
        poses = found.arm.chain.fk(found.seeds(rows, 0.5))
        np.testing.assert_allclose(poses[:, 2, 0], -math.sin(grasp.pitch), atol=1e-3)


def test_of_the_poses_around_a_large_arm_fewer_are_mapped_and_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rail = [("rail", "prismatic", "1 0 0", "0 0 0.5", "-20", "20"), *JOINTS[1:]]
    monkeypatch.setattr(reachability_maps, "MOST_POSES", 30_000)
    found = build_map(arm_of(tmp_path, rail), GraspClass.TILTED)
    assert 1000 < len(found) < 60_000
    assert found.spacing[0] > 5 * CELL > found.spacing[1], "thinner along the rail"
    assert np.abs(found.rows["x"]).max() <= 500
    rows = some(found)
    poses, headings = found.poses(rows), found.rows["yaw"][rows] * (2 * np.pi / 24)
    aside = poses[:, :3, 3] + [0.3 * found.spacing[0], -0.3 * found.spacing[1], 0.0]
    assert (found.find(aside, headings, found.rows["roll"][rows]) == rows).all()


def refused(what: str, share: float) -> None:
    pytest.fail(what)


def test_the_progress_of_a_map_that_is_built_grows_from_nothing_to_the_whole(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    shares: list[float] = []
    reachability_map(arm_of(tmp_path, GANTRY), GraspClass.SIDE, report=lambda what, share: shares.append(share))
    assert (shares[0], shares[-1]) == (0.0, 1.0)
    assert shares == sorted(shares)
    assert len(set(shares)) > 20


def test_maps_are_kept_and_those_of_another_arm_are_not_taken_for_them(
    arm: ArmModel, maps: Maps, tmp_path: Path
) -> None:
    again = {grasp: reachability_map(arm, grasp, report=refused) for grasp in GraspClass}
    assert all(np.array_equal(again[grasp].rows, maps[grasp].rows) for grasp in GraspClass)
    assert not again[GraspClass.SIDE].rows.flags.writeable
    other = arm_of(tmp_path, torso="lift")
    assert map_key(other, GraspClass.TOP) == map_key(arm, GraspClass.TOP)
    assert map_key(replace(other, seeds=other.seeds + 0.1), GraspClass.TOP) == map_key(arm, GraspClass.TOP)
    assert other.lift
    higher = replace(other, lift=replace(other.lift, highest=other.lift.highest + 0.1))
    assert map_key(higher, GraspClass.TOP) != map_key(arm, GraspClass.TOP), "rows begin at the floor"
    turned = replace(other, frame=HandFrame((0.0, 1.0, 0.0), (1.0, 0.0, 0.0)))
    assert map_key(turned, GraspClass.TOP) != map_key(arm, GraspClass.TOP)
    text = (tmp_path / "arm.urdf").read_text().replace("0.12 0 0", "0.13 0 0")
    (tmp_path / "arm.urdf").write_text(text)
    longer = Chain.from_urdf(tmp_path / "arm.urdf", "l0", "tip")
    assert longer.digest != other.chain.digest == arm.chain.digest


def test_only_a_joint_that_slides_straight_up_is_a_lift(arm: ArmModel) -> None:
    chain = arm.chain
    lift = lift_of(chain, "lift")
    assert lift is not None
    assert (lift.column, lift.lowest, lift.highest, lift.per_unit) == (0, 0.1, 0.4, pytest.approx(1.0))
    assert lift_of(chain, "turn") is None
    assert lift_of(chain, None) is None


@pytest.mark.long
@pytest.mark.parametrize(("joints", "shared"), [(JOINTS, True), (SCARA, False)])
def test_the_files_of_maps_hold_their_rows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, joints: Sequence[tuple[str, ...]], shared: bool
) -> None:
    monkeypatch.setattr("executive.locations.reachability.POSTURES", 10_000)
    arm = arm_of(tmp_path, joints, torso=joints[0][0])
    built = build_map(arm, GraspClass.SIDE)
    read = unpacked(packed(built), arm, GraspClass.SIDE)
    for name in ("z", "roll", "yaw", "x", "y"):
        np.testing.assert_array_equal(read.rows[name], built.rows[name])
    np.testing.assert_allclose(read.rows["score"], built.rows["score"], atol=1 / 255)
    of_rows = [found.postures[found.rows["posture"]] for found in (read, built)]
    np.testing.assert_allclose(*of_rows, atol=1e-12)
    assert (len(read.postures) < len(read) / 3) is shared
    assert packed(read) == packed(built)
    nothing = ReachabilityMap(arm, GraspClass.SIDE, built.rows[:0], built.postures[:0])
    assert len(unpacked(packed(nothing), arm, GraspClass.SIDE)) == 0


def test_a_map_that_came_along_is_taken_and_one_that_did_not_is_built_with_the_reason(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    arm, said = arm_of(tmp_path, GANTRY), list[str]()

    def hear(what: str, share: float) -> None:
        assert 0.0 <= share <= 1.0
        if what not in said[-1:]:
            said.append(what)

    monkeypatch.setattr(reachability_maps, "MAPS", tmp_path)
    name, content = bundled_file(arm, GraspClass.SIDE, "gantry")
    (tmp_path / name).write_bytes(content)

    def rows_of_a_new_home(home: str, robot: str = "gantry") -> list[tuple[float, ...]]:
        monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / home))
        own = arm if robot == "gantry" else replace(arm, seeds=arm.seeds[:1])
        return list(reachability_map(own, GraspClass.SIDE, robot, hear).rows.tolist())

    rows = rows_of_a_new_home("first")
    assert rows_of_a_new_home("zeroth", "another") == rows
    assert not said
    (tmp_path / name).write_bytes(content[:-1] + b"?")
    assert rows_of_a_new_home("second") == rows
    assert said[-1].endswith(f"side grasps, once for this robot: {tmp_path / name} is damaged")
    (tmp_path / name).rename(tmp_path / name.replace(map_key(arm, GraspClass.SIDE)[:16], "0" * 16))
    assert rows_of_a_new_home("third") == rows
    assert said[-1].endswith("once for this robot: the URDF differs from that of the bundled maps")
    assert rows_of_a_new_home("fourth", "another") == rows
    assert said[-1] == "building the reachability map of arm arm, side grasps, once for this robot"
    assert rows_of_a_new_home("fourth", "another") == rows
    assert len(said) == 3, "it is in the cache"
