"""Videos of runs: the steps of the plan, the camera, and the file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from executive.pictures import video
from executive.pictures.rendering import View
from executive.pictures.steps import DONE, FAILED, RUNNING, column, steps_in
from executive.pictures.video import Video
from planlang.files import bundled
from planlang.geometry import Pose
from planlang.outputs import is_replaceable
from planlang.protocols import Configuration
from planlang.report.wording import Wording
from planlang.runs.run_tree import RunTree
from sim import Body, CameraModel, PyBulletWorld, RobotBody, Scene

AMIGO = RobotBody(bundled("ontologies") / "robots" / "amigo.urdf", CameraModel("base_link"))


@pytest.fixture
def tree() -> RunTree:
    """A grasp that fails inside of a fetch that succeeds at the second try."""
    heard = RunTree()
    for node, parent, kind, name, begin, end, status in (
        (1, None, "plan", "fetch", 0, 50, "succeeded"),
        (2, 1, "perform", "FetchTheBottle", 0, 50, "succeeded"),
        (3, 2, "branch", "arm", 10, 20, "failed"),
        (4, 3, "perform", "GraspIt", 10, 20, "failed"),
        (5, 2, "perform", "GraspIt", 30, 40, "succeeded"),
    ):
        heard.add({"event": "started", "node": node, "parent": parent, "kind": kind, "name": name, "step": begin})
        why = {"failure": {"type": "GraspMissed", "message": "too far"}} if status == "failed" else {}
        heard.add({"event": "ended", "node": node, "name": name, "status": status, "step": end, **why})
    heard.add({"event": "belief", "change": "grasped", "name": "bottle1", "step": 40})
    return heard


def test_steps_are_coming_then_running_then_as_they_ended(tree: RunTree) -> None:
    assert [(one.node.name, one.depth, one.node.reason) for one in steps_in(tree, Wording())] == [
        ("FetchTheBottle", 0, ""),
        ("GraspIt", 1, "GraspMissed: too far"),
        ("GraspIt", 1, ""),
    ]
    assert [one.state(5) for one in steps_in(tree, Wording())] == ["running", "coming", "coming"]
    assert [one.state(20) for one in steps_in(tree, Wording())] == ["running", "failed", "coming"]
    assert [one.state(50) for one in steps_in(tree, Wording())] == ["succeeded", "failed", "succeeded"]


def test_the_column_marks_what_runs_what_is_done_and_what_failed(tree: RunTree) -> None:
    def has(now: int, colour: tuple[int, int, int]) -> bool:
        pixels = np.asarray(column(steps_in(tree, Wording()), now, (260, 200), "fetch", "1.0 s").image)
        return bool((pixels == colour).all(axis=2).any())

    assert [has(5, RUNNING), has(5, DONE), has(5, FAILED)] == [True, False, False]
    assert [has(25, RUNNING), has(25, DONE), has(25, FAILED)] == [True, False, True]
    assert [has(50, RUNNING), has(50, DONE), has(50, FAILED)] == [False, True, True]


def test_a_long_plan_scrolls_to_what_runs() -> None:
    heard = RunTree()
    for node in range(60):
        heard.add({"event": "started", "node": node, "parent": None, "kind": "perform", "name": "Go", "step": node})
    assert (np.asarray(column(steps_in(heard, Wording()), 50, (260, 200), "x", "").image) == RUNNING).all(axis=2).any()


def test_the_ending_stands_below_the_steps(tree: RunTree) -> None:
    def red(ending: tuple[str, ...]) -> int:
        pixels = np.asarray(column(steps_in(tree, Wording()), 50, (260, 200), "fetch", "1.0 s", ending).image)[280:]
        return int((pixels == FAILED).all(axis=2).sum())

    shorter, longer = red(("failed after 1.00 s", "too high")), red(("failed after 1.00 s", "too high " * 12))
    assert red(()) == 0 < shorter < longer, "it is wrapped, not cut"


@pytest.mark.long
def test_a_video_has_frames_of_the_run_and_is_the_same_each_time(
    tree: RunTree, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(video, "MOST", 3)
    bottle = Body("bottle", Pose((0.8, 0.0, 0.5)), (0.08, 0.08, 0.2), "cylinder", kinds=("Bottle",))
    contents = []
    for name in ("one.webp", "two.webp"):
        world = PyBulletWorld(Scene((bottle,)), AMIGO)
        made = Video(world, 30, "fetch", tree, wording=Wording())
        for step in range(0, 51):
            world.set_configuration(Configuration((min(0.02 * step, 0.5), 0.0, 0.0), {}))
            made.frame(step)
        made.save(tmp_path / name, ["bottle"])
        world.close()
        contents.append((tmp_path / name).read_bytes())
    with Image.open(tmp_path / "one.webp") as shown:
        assert (shown.n_frames, shown.size) == (3, (video.SIZE[0] + video.COLUMN, video.SIZE[1]))
    assert contents[0] == contents[1]
    assert is_replaceable(tmp_path / "one.webp"), "it has a mark"
    (tmp_path / "one.webp").write_bytes(contents[0].replace(b"written by planlang", b"taken by a person  "))
    assert not is_replaceable(tmp_path / "one.webp")


def test_the_camera_stands_where_the_base_does_and_moves_gently_between() -> None:
    bases = np.array([*[[0.0, 0.0]] * 4, [0.5, 0.0], [1.0, 0.0], *[[1.5, 0.0]] * 4])
    assert video._stops(bases) == [(0, 3), (6, 9)]
    assert video._stops(np.array([[0.0, 0.0], [1.0, 0.0]])) == [(0, 1)], "it never stands"
    views = [View((0.0, 0.0, 1.0), (0.0, 1.0, 0.0))] * 20 + [View((4.0, 0.0, 1.0), (4.0, 1.0, 0.0))] * 20
    smooth = np.array([view.eye[0] for view in video._smooth(views)])
    assert (smooth[0], smooth[-1]) == (0.0, 4.0)
    assert 0 < np.diff(smooth).max() < 1.0
    assert np.diff(smooth).min() >= 0
