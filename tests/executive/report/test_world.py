"""The world in a page: poses as they were, places with their reasons, and runs that are repeated to see them."""

from __future__ import annotations

import base64
import json
import re
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from executive.report import watching
from executive.runs.options import Outcome
from planlang.geometry import Pose
from tests.executive.conftest import Served
from tests.executive.report.conftest import WATCHED, Reported


def read(page: Path) -> tuple[dict[str, Any], bytes]:
    """Return the model of a page, and its poses."""
    text = page.read_text(encoding="utf-8")
    model = re.search(r'id="model">(.*?)</script>', text)
    poses = re.search(r'id="blob-poses">(.*?)</script>', text)
    assert model is not None
    return json.loads(model[1]), b"" if poses is None else zlib.decompress(base64.b64decode(poses[1]))


def test_every_pose_is_within_a_millimetre_of_where_it_was(reported: Reported) -> None:
    model, data, real_poses = *read(reported.page), dict(reported.poses)
    entities, scale = model["scene"]["entities"], model["scene"]["scale"]
    total = sum(one["keys"] for one in entities)
    steps = np.frombuffer(data, "<i4", total)
    columns = np.frombuffer(data, "<i2", total * 7, offset=4 * total).reshape(7, total).T
    found: list[Pose] = []
    first = 0
    for one in entities:
        own = slice(first, first + one["keys"])
        first += one["keys"]
        times, keys = steps[own].cumsum(), columns[own].cumsum(axis=0, dtype="<i2")
        key = keys[max(0, int(np.searchsorted(times, WATCHED, side="right")) - 1)]
        turn = key[3:] / np.linalg.norm(key[3:].astype(float))
        pose = Pose(tuple((key[:3] * scale).tolist()), tuple(turn.tolist()))
        found.append(found[one["frame"]] @ pose if one["frame"] >= 0 and one["kind"] == "link" else pose)
        if one["kind"] in ("link", "body"):
            real = real_poses.pop((one["kind"], one["name"]))
            assert np.linalg.norm(np.subtract(found[-1].position, real.position)) < 1.5e-3, one["name"]
            assert np.abs(found[-1].matrix() - real.matrix())[:3, :3].max() < 1e-3, one["name"]
    assert not real_poses


def test_places_have_the_reasons_for_which_they_were_rejected(reported: Reported) -> None:
    model, _ = read(reported.page)
    first, second, third = model["questions"]
    assert first["location"] == second["location"] != third["location"]
    assert second["time"] == pytest.approx(6.8)
    assert second["chosen"] == pytest.approx([-1.9663, -0.5622, -1.3343], abs=1e-3)
    reasons = {one["text"]: one["count"] for one in second["bases"]["reasons"]}
    assert {"no room for the base", "in collision", "out of reach", ""} <= set(reasons)
    drawn = {second["bases"]["reasons"][number]["text"] for number, _, _ in second["bases"]["points"]}
    assert drawn == set(reasons), "each reason is on the map"
    colours = {(one["text"], one["colour"]) for q in model["questions"] for one in q["bases"]["reasons"]}
    assert len(colours) == len({text for text, _ in colours}), "one colour for a reason"
    assert len(second["bases"]["points"]) <= 200 * len(reasons)
    nodes = {node["id"]: node for node in model["nodes"]}
    assert {nodes[one["node"]]["kind"] for one in model["questions"]} == {"at_location"}


@pytest.mark.long
def test_a_page_changes_nothing_in_the_run(reported: Reported, served: Served) -> None:
    assert served.trace.read_bytes() == reported.trace.read_bytes()
    assert served.result.final_state == reported.result.final_state


def test_what_is_believed_beside_the_truth_is_in_the_page(reported: Reported) -> None:
    model, _ = read(reported.page)
    believed = {one["name"]: one for one in model["scene"]["entities"] if one["kind"] == watching.BELIEVED}
    assert model["scene"]["entities"][believed["chair1"]["of"]]["name"] == "chair1"
    assert believed["bottle1"]["gone"], "what a hand holds is where the hand is"


def test_a_page_has_no_folder_of_this_machine_and_is_small(reported: Reported) -> None:
    text = reported.page.read_text(encoding="utf-8")
    assert str(Path.home()) not in text
    assert str(reported.folder) not in text
    assert len(text) < 1_500_000
    assert reported.result.outcome is Outcome.DONE
