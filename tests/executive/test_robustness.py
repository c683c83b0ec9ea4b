"""Files, streams and signals of users that the command survives: nothing is lost, nothing hangs, no traceback."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
from pathlib import Path
from threading import Timer
from typing import Any

import pytest
from click.testing import CliRunner

from executive.cli.app import app
from planlang.files import Bundled, bundled
from tests.support.cli_runs import invoke

CHECKOUT = Path(__file__).resolve().parents[2]
ROOM = Bundled.ENVIRONMENT.find("hospital_room")


def planlang(arguments: str, folder: Path, *, first: Path | None = None) -> subprocess.CompletedProcess[str]:
    """Run the command by a shell in a folder; Python looks for packages in ``first`` before it looks for ours."""
    path = os.pathsep.join(map(str, (first, CHECKOUT) if first else (CHECKOUT,)))
    command = f"exec {sys.executable} -m planlang_command {arguments}"
    environment = {**os.environ, "PYTHONPATH": path}
    return subprocess.run(
        command, shell=True, cwd=folder, env=environment, capture_output=True, text=True, timeout=120, check=False
    )


# Files that are written


@pytest.mark.parametrize(
    "command",
    [
        "run serve_a_drink --environment {file} --trace {file} --force",
        "run serve_a_drink --robot {file} --picture {file} --force",
        "locate bed --robot amigo --environment {file} --explain {file} --force",
        "robot inspect {file} --picture {file} --force",
        "convert {file} --to turtle -o {file} --force",
        "compile {file} --graph {file} --force",
    ],
)
def test_an_input_is_never_replaced_not_even_by_force(command: str, tmp_path: Path) -> None:
    file = tmp_path / "map.png"
    file.write_bytes(ROOM.read_bytes())
    result = invoke(*command.format(file=file).split())
    assert result.exit_code == 2
    assert "would overwrite" in result.stderr, result.stderr
    assert file.read_bytes() == ROOM.read_bytes()


@pytest.mark.parametrize(
    ("command", "name"),
    [
        ("compile serve_a_drink -o", "a.py"),
        ("compile serve_a_drink --graph", "a.svg"),
        ("convert serve_a_drink --to turtle -o", "a.ttl"),
        ("run serve_a_drink --trace", "a.jsonl"),
        ("robot inspect amigo --picture", "a.png"),
        ("run serve_a_drink --video", "a.webp"),
    ],
)
def test_a_file_that_planlang_did_not_write_is_overwritten_only_by_force(
    command: str, name: str, tmp_path: Path
) -> None:
    path = tmp_path / name
    path.write_text("what a person wrote\n")
    result = invoke(*command.split(), path)
    assert (result.exit_code, "error C005" in result.stderr) == (2, True), result.stderr
    assert path.read_text() == "what a person wrote\n"
    if not command.startswith("r"):
        assert invoke(*command.split(), path, "--force").exit_code == 0
        assert "what a person wrote" not in path.read_text()


@pytest.mark.parametrize("suffix", [".svg", ".dot", ".mmd"])
def test_a_graph_carries_a_mark_and_is_replaced(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"graph{suffix}"
    for _ in range(2):
        assert invoke("compile", "serve_a_drink", "--graph", path).exit_code == 0
    assert "written by planlang" in path.read_text()


# Files that are no files


@pytest.mark.parametrize(
    "command", ["replay {}", "run --resume {}", "run {}", "check {}", "run serve_a_drink --robot {}"]
)
def test_a_pipe_without_a_writer_is_not_waited_for(command: str, tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    late = Timer(30.0, os.open, (tmp_path / "pipe", os.O_RDWR))  # what waits after all ends without an answer
    late.start()
    result = invoke(*command.format(tmp_path / "pipe").split())
    late.cancel()
    assert (result.exit_code, "error C001" in result.stderr) == (2, True), result.stderr


@pytest.mark.parametrize(
    "command", ["run serve_a_drink --trace {}", "check serve_a_drink --ontologies {}", "replay {}"]
)
def test_a_link_to_itself_is_bad_input(command: str, tmp_path: Path) -> None:
    (tmp_path / "loop").symlink_to("loop")
    result = invoke(*command.format(tmp_path / "loop").split())
    assert (result.exit_code, "error C00" in result.stderr) == (2, True), result.stderr


def test_a_robot_file_without_end_is_read_as_far_as_its_bound(tmp_path: Path) -> None:
    path = tmp_path / "robot.toml"
    path.write_text('name = "large"\n')
    os.truncate(path, 200_000_000)  # sparse
    result = invoke("robot", "inspect", path)
    assert (result.exit_code, "error B001 the file is larger than 16 MB" in result.stderr) == (2, True), result.stderr


@pytest.mark.long
def test_the_end_of_a_full_disk_is_told_and_devices_are_not_read(tmp_path: Path) -> None:
    told = planlang("compile serve_a_drink > /dev/full", tmp_path)
    assert (told.returncode, "stdout cannot be written: No space left" in told.stderr) == (2, True), told.stderr
    assert "Traceback" not in told.stderr
    full = planlang("compile serve_a_drink -o /dev/full", tmp_path)
    assert (full.returncode, "error C004" in full.stderr) == (2, True), full.stderr


def test_closed_streams_are_dev_null(tmp_path: Path) -> None:
    assert planlang("compile serve_a_drink -o plan.py <&- >&- 2>&-", tmp_path).returncode == 0
    assert (tmp_path / "plan.py").read_text().startswith('"""')


# Signals


def test_ctrl_c_while_modules_are_imported_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "click.py").write_text("import time\nprint('importing', flush=True)\ntime.sleep(60)\n")
    environment = {**os.environ, "PYTHONPATH": f"{tmp_path}{os.pathsep}{CHECKOUT}"}
    command = [sys.executable, "-m", "planlang_command", "--version"]
    with subprocess.Popen(
        command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "importing\n"
        process.send_signal(signal.SIGINT)
        _, rest = process.communicate()
    assert (process.returncode, rest) == (130, "interrupted\n")


# Other packages of our names


@pytest.mark.parametrize("name", ["sim", "executive", "planlang"])
def test_another_package_of_one_of_our_names_is_named(name: str, tmp_path: Path) -> None:
    (tmp_path / name).mkdir()
    (tmp_path / name / "__init__.py").touch()
    result = planlang("--version", tmp_path, first=tmp_path)
    assert (result.returncode, str(tmp_path / name / "__init__.py") in result.stderr) == (2, True), result.stderr
    assert "Traceback" not in result.stderr


# What is printed


def test_a_usage_error_is_a_json_object_too(tmp_path: Path) -> None:
    result = planlang("run serve_a_drink --seed x --json", tmp_path)
    found = json.loads(result.stdout)
    assert (result.returncode, found["command"], found["exit_code"]) == (2, "run", 2)
    assert "--seed" in found["error"]
    assert result.stderr == ""


def test_summaries_of_commands_are_whole_sentences() -> None:
    lines = " ".join(invoke("--help").stdout.split())
    assert "Find poses that match a phrase, for the robot's base or for a thing." in lines
    assert "..." not in lines.replace("[ARGS]...", "")


def test_a_misspelt_parameter_is_told_before_the_robot_is_bound(monkeypatch: pytest.MonkeyPatch) -> None:
    def bound(*arguments: object, **options: object) -> None:
        raise AssertionError("the robot is bound")

    monkeypatch.setattr("executive.runs.plan_run.bind_robot", bound)
    result = invoke("run", "serve_a_drink", "--set", "botle=bottle1")
    assert (result.exit_code, "did you mean --set bottle=bottle1?" in result.stderr) == (2, True), result.stderr


RECIPE = (bundled("recipes") / "serve_a_drink.omn").read_text(encoding="utf-8")
MAP = (bundled("ontologies") / "environments" / "hospital_room.omn").read_text(encoding="utf-8")
ROBOT = (bundled("ontologies") / "robots" / "amigo.omn").read_text(encoding="utf-8")
URDF = (bundled("ontologies") / "robots" / "amigo.urdf").read_text(encoding="utf-8")

RDF = 'xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#" xmlns:rdfs="http://www.w3.org/2000/01/rdf-schema#"'


def owl(declarations: str, text: str) -> str:
    """An RDF/XML file with a document type and one label."""
    label = f'<rdf:Description rdf:about="http://example.org/#a"><rdfs:label>{text}</rdfs:label></rdf:Description>'
    return f'<?xml version="1.0"?>\n<!DOCTYPE rdf:RDF [{declarations}]>\n<rdf:RDF {RDF}>{label}</rdf:RDF>'


BOMB = '<!ENTITY a0 "lol">' + "".join(f'<!ENTITY a{k} "{f"&a{k - 1};" * 10}">' for k in range(1, 12))

RECIPES = {
    "empty file": ("", "O002"),
    "truncated XML": (f'<?xml version="1.0"?>\n<rdf:RDF {RDF}>\n  <rdf:Description', "O005"),
    "entity bomb": (owl(BOMB, "&a11;"), "O008"),
    "external entity": (owl('<!ENTITY s SYSTEM "file:///etc/hostname">', "&s;"), "O009"),
    "truncated Manchester": (RECIPE[: RECIPE.index("Class: ServeADrink") + 60], "O020"),
    "no sub-actions": (re.sub(r".*subAction.*\n", "", RECIPE), "R001"),
    "cyclic": (
        RECIPE.replace(
            "occursBeforeInOrdering ReachToHandoverPose, knowrob:occursAfterInOrdering HandOverBottle",
            "occursBeforeInOrdering ReachToHandoverPose, knowrob:occursAfterInOrdering MoveBaseToGraspPose",
        ),
        "R012",
    ),
}


def answer(*arguments: str | Path) -> dict[str, Any]:
    """The command's answer as JSON, with its exit code checked to be the process's."""
    result = CliRunner().invoke(app, [*map(str, arguments), "--json"], prog_name="planlang")
    found: dict[str, Any] = json.loads(result.stdout)
    assert found["exit_code"] == result.exit_code
    assert "Traceback" not in result.stdout + result.stderr
    return found


def errors(found: dict[str, Any]) -> list[str]:
    """Codes of the errors in an answer."""
    return [d["code"] for d in found["diagnostics"] if d["severity"] == "error"]


def without(text: str, name: str) -> str:
    """A map without a thing, its pose and its perception."""
    frames = text.split("\n\n")
    return "\n\n".join(f for f in frames if not re.match(rf"Individual: (perception_|pose_)?{name}\b", f))


@pytest.mark.parametrize("kind", RECIPES)
def test_a_bad_recipe_is_refused_with_a_diagnostic_at_its_place(kind: str, tmp_path: Path) -> None:
    text, code = RECIPES[kind]
    path = tmp_path / "recipe.owl"
    path.write_text(text, encoding="utf-8")
    for command in ("check", "compile"):
        found = answer(command, path)
        assert (found["exit_code"], errors(found)[0]) == (2, code)
        span = found["diagnostics"][-1]["span"]
        assert span["file"] == str(path)


def test_an_import_from_the_network_is_left_out_with_a_warning(tmp_path: Path) -> None:
    path = tmp_path / "recipe.omn"
    path.write_text(RECIPE.replace("    Import: ", "    Import: <http://example.org/x.owl>\n    Import: ", 1))
    found = answer("check", path)
    assert found["exit_code"] == 0
    warned = [d for d in found["diagnostics"] if d["code"] == "O031"]
    assert len(warned) == 1
    assert "http://example.org/x.owl" in warned[0]["message"]


def test_a_robot_without_a_gripper_lacks_a_capability(tmp_path: Path) -> None:
    urdf, robot = tmp_path / "handless.urdf", tmp_path / "handless.omn"
    urdf.write_text(re.sub(r'(<joint name="finger[^"]*" type=")revolute"', r'\1fixed"', URDF))
    robot.write_text(without(without(ROBOT, "right_gripper"), "left_gripper"))
    found = answer("run", "serve_a_drink", "--robot", robot, "--urdf", urdf)
    assert (found["exit_code"], found["failure"]["class"]) == (3, "MissingCapability")
    assert "MissingCapability: capability GripperMotionCapability: " in found["message"]
    (able,) = (one for one in found["diagnostics"] if one["code"] == "X032")
    assert able["help"].startswith("planlang run serve_a_drink --robot amigo --environment hospital_room")


@pytest.mark.parametrize(
    ("text", "failure"),
    [
        (MAP.replace("knowrob:m03 -2.72", "knowrob:m03 -12.72"), "ObjectUnreachable"),
        (re.sub(r"(depth|width)OfObject 0\.065", r"\1OfObject 0.365", MAP), "ObjectUnreachable"),
    ],
    ids=["bottle outside the room", "bottle wider than the hand"],
)
def test_a_map_that_does_not_fit_the_recipe_ends_in_a_typed_failure(text: str, failure: str, tmp_path: Path) -> None:
    path = tmp_path / "map.omn"
    path.write_text(text, encoding="utf-8")
    found = answer("run", "serve_a_drink", "--environment", path)
    assert (found["exit_code"], found["failure"]["class"]) == (1, failure)
    assert "serve_a_drink" in found["failure"]["where"], "the failure says where in the plan it arose"


@pytest.mark.parametrize("thing", ["bottle1", "patient1"])
def test_a_map_without_a_thing_of_the_plan_is_refused_with_what_to_add(thing: str, tmp_path: Path) -> None:
    path = tmp_path / "map.omn"
    path.write_text(without(MAP, thing), encoding="utf-8")
    found = answer("run", "serve_a_drink", "--environment", path)
    assert (found["exit_code"], errors(found)) == (2, ["X031"])
    assert found["diagnostics"][-1]["message"].startswith(f"{thing} (")
    assert re.fullmatch(r"add a \w+ with its pose to map.omn, or name a thing .*", found["diagnostics"][-1]["help"])


def test_a_thing_that_the_map_lacks_is_reported_before_what_the_robot_lacks(tmp_path: Path) -> None:
    path = tmp_path / "map.omn"
    path.write_text(without(MAP, "bottle1"), encoding="utf-8")
    found = answer("run", "serve_a_drink", "--robot", "panda", "--environment", path)
    assert (found["exit_code"], errors(found)) == (2, ["X031"])


@pytest.mark.long
def test_a_bottle_of_size_0_has_the_default_size_of_its_class(tmp_path: Path) -> None:
    path = tmp_path / "map.omn"
    start = MAP.index("Individual: bottle1")
    path.write_text(MAP[:start] + re.sub(r"OfObject [\d.]+", "OfObject 0.0", MAP[start:], count=3))
    found = answer("run", "serve_a_drink", "--environment", path)
    assert found["exit_code"] == 0
    assert found["final_state"] == ["bottle1: held by patient1"]
    assert [d["code"] for d in found["diagnostics"]] == ["M005"]


@pytest.mark.parametrize(
    ("option", "code"),
    [("glass=bottle1", "X004"), ("bottle=bottle7", "X005"), ("bottle=bed1", "X006")],
)
def test_a_parameter_is_set_only_to_a_fitting_thing_of_the_map(option: str, code: str) -> None:
    found = answer("run", "serve_a_drink", "--set", option)
    assert (found["exit_code"], errors(found)) == (2, [code])


def test_a_plan_that_cannot_be_imported_is_bad_input_at_its_line(tmp_path: Path) -> None:
    path = tmp_path / "plan.py"
    path.write_text("import planlang\n\nplanlang.no_such_thing\n")
    found = answer("run", path, "--robot", "amigo", "--environment", "hospital_room")
    assert (found["exit_code"], errors(found)) == (2, ["X001"])
    assert found["diagnostics"][0]["span"]["line"] == 3


def test_a_plan_file_without_a_plan_is_bad_input(tmp_path: Path) -> None:
    path = tmp_path / "plan.py"
    path.write_text("import planlang\n")
    found = answer("run", path, "--robot", "amigo", "--environment", "hospital_room")
    assert (found["exit_code"], errors(found)) == (2, ["X002"])


def test_a_start_in_a_wall_ends_in_a_typed_failure_or_a_diagnostic() -> None:
    found = answer("run", "serve_a_drink", "--start", "40,0,0")
    assert found["exit_code"] in (1, 2)
    assert found["failure"] if found["exit_code"] == 1 else errors(found)
