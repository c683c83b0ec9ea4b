"""``planlang show``: every kind of file as text, and as a picture or a page where it can be one."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from cli_runs import invoke
from PIL import Image

from planlang.compiler import compile_recipe
from planlang.files import Bundled

RECIPE = Bundled.RECIPE.find("serve_a_drink")

TIDY = """from functools import partial

from planlang import par, perform, plan
from planlang.designators import action


@plan
async def wipe(what):
    async def one():
        wiping = action("WipingSomething", object_acted_on=what)
        await perform(wiping, name="Wipe")
        await perform(action("Waiting"), name="Wait")


@plan
async def tidy():
    await par(left=partial(wipe, "left"), right=lambda: wipe("right"))
"""
REACH = """from planlang import perform, plan
from planlang.designators import a_location, action, an_object


@plan
async def reach():
    await perform(action("Reaching", to_location=a_location(in_front_of=an_object("Bed-PieceOfFurniture"))))
"""


@pytest.fixture(scope="module")
def trace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("runs") / "run.jsonl"
    assert invoke("run", "push_the_cup", "--trace", path, "--quiet").exit_code == 0
    return path


def lines(*arguments: str | Path) -> list[str]:
    result = invoke("show", *arguments)
    assert result.exit_code == 0, result.stderr
    return result.stdout.splitlines()


def test_a_recipe_is_shown_as_the_tree_of_its_steps_in_their_order() -> None:
    first, *steps = lines("serve_a_drink")
    assert first.endswith("the recipe ServeADrink")
    names = [step.split()[0] for step in steps]
    assert names[:3] == ["MoveBaseToGraspPose", "GraspBottle", "ApproachBottle"]
    assert names[-1] == "HandOverBottle"
    assert steps[2].startswith("    "), "it is a step of GraspBottle"


@pytest.mark.parametrize(("suffix", "begins"), [(".svg", b"<?xml"), (".png", b"\x89PNG"), (".mmd", b""), (".dot", b"")])
def test_a_recipe_is_drawn_in_the_format_of_the_file(suffix: str, begins: bytes, tmp_path: Path) -> None:
    file = tmp_path / f"graph{suffix}"
    assert lines("serve_a_drink", "-o", file)[-1] == str(file)
    assert file.read_bytes().startswith(begins)


def test_a_plan_is_shown_by_its_functions_and_what_they_perform(tmp_path: Path) -> None:
    plan = tmp_path / "drink.py"
    plan.write_text(compile_recipe(RECIPE).source)
    shown = lines(plan)
    assert "grasp_bottle(bottle)  Grasp a bottle." in shown
    assert any(line.startswith("  HandOverBottle  line ") for line in shown), "named by a constant"


def test_branches_and_names_of_steps_are_shown_wherever_a_plan_passes_them(tmp_path: Path) -> None:
    plan = tmp_path / "tidy.py"
    plan.write_text(TIDY)
    assert [line.strip() for line in lines(plan)[1:]] == [
        "wipe(what)",
        "Wipe: WipingSomething  line 10",
        "Wait: Waiting  line 12",
        "tidy()",
        "wipe()  line 17",
        "wipe()  line 17",
    ]


def test_a_failed_run_is_shown_with_the_sentences_that_it_ended_with(tmp_path: Path) -> None:
    plan, trace = tmp_path / "reach.py", tmp_path / "reach.jsonl"
    plan.write_text(REACH)
    ran = invoke("run", plan, "--robot", "amigo", "--environment", "hospital_room", "--trace", trace)
    ended = ran.stdout.splitlines()
    assert (ran.exit_code, "because of" in ran.stdout) == (1, True)
    assert lines(trace)[-len(ended) :] == ended


def test_a_map_says_what_it_holds_and_is_seen_from_where_one_likes(tmp_path: Path) -> None:
    for view in ("overview", "top"):
        file = tmp_path / f"{view}.png"
        assert "a map of 7 objects (1 graspable)" in lines("hospital_room", "-o", file, "--view", view)[0]
        assert len(set(Image.open(file).convert("L").tobytes())) > 20, "something is in the picture"
    assert (tmp_path / "top.png").read_bytes() != (tmp_path / "overview.png").read_bytes()


def test_a_robot_says_what_it_has_and_stands_in_its_picture(tmp_path: Path) -> None:
    file = tmp_path / "panda.png"
    shown = lines("panda", "-o", file)
    assert shown[0].startswith("panda (")
    assert any(line.startswith("  arm: 7 joints from ") for line in shown)
    assert len(set(Image.open(file).convert("L").tobytes())) > 20


def test_a_trace_is_shown_as_a_tree_with_its_end_and_as_a_page(trace: Path, tmp_path: Path) -> None:
    shown = lines(trace)
    assert shown[0].startswith(f"{trace}: a run of make_room with amigo")
    assert shown[1].startswith("  ✓ make_room  ")
    assert any(line.startswith("succeeded after ") for line in shown)
    page = tmp_path / "run.html"
    assert lines(trace, "-o", page)[-1] == str(page)
    assert page.read_text().startswith("<!")


def test_json_says_which_kind_of_file_it_is(trace: Path) -> None:
    kinds = {
        name: json.loads(invoke("show", name, "--json").stdout)["kind"] for name in ("amigo", "tea_room", str(trace))
    }
    assert list(kinds.values()) == ["robot", "map", "trace"]


def test_what_a_file_cannot_be_shown_as_is_refused_with_what_it_can(trace: Path, tmp_path: Path) -> None:
    result = invoke("show", trace, "-o", tmp_path / "run.png")
    assert (result.exit_code, ".html" in result.stderr) == (2, True)
    assert invoke("show", "hospital_room", "--view", "top").exit_code == 2
    wrong = invoke("show", "hospital_room", "--view", "left", "-o", tmp_path / "room.png")
    assert (wrong.exit_code, "--view left: write X,Y,Z or X,Y,Z:X,Y,Z" in wrong.stderr) == (2, True)
    assert not (tmp_path / "run.png").exists()


def test_a_misspelt_name_of_any_bundled_file_is_corrected() -> None:
    for written, meant in (("hospital_rom", "hospital_room"), ("amgo", "amigo"), ("serve_a_drnk", "serve_a_drink")):
        assert f"did you mean {meant}?" in invoke("show", written).stderr
