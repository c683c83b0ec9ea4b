"""Log of poses: each frame has one parent, also where a map has another robot with links of the same names."""

from __future__ import annotations

from pathlib import Path

from executive.pictures.pose_track import MAP, Placed
from executive.runs.pose_log import PoseLog
from planlang.experience.poses import read_poses
from planlang.geometry import Pose

HERE = Pose((1.0, 0.0, 0.5))


def test_a_body_that_is_named_as_a_link_has_a_frame_of_its_own(tmp_path: Path) -> None:
    log = PoseLog(30, tmp_path / "poses.jsonl", {})
    log.begin()
    bodies = [Placed(("bodies", name), MAP, HERE) for name in ("hand_right", "table1", "patient1")]
    limb = Placed(("bodies", "patient1", "limb0"), ("bodies", "patient1"), HERE)
    links = [Placed(("robot", "base_link"), MAP, HERE), Placed(("robot", "hand_right"), ("robot", "base_link"), HERE)]
    log(0, [*bodies, limb, *links])
    log(3, [bodies[0], links[1]])
    log.close()
    _, found = read_poses((tmp_path / "poses.jsonl").read_text().splitlines(keepends=True))
    assert {(one.child, one.frame) for one in found} == {
        ("map/hand_right", "map"),
        ("table1", "map"),
        ("patient1", "map"),
        ("patient1/limb0", "patient1"),
        ("base_link", "map"),
        ("hand_right", "base_link"),
    }
