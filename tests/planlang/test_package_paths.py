"""Names of meshes in URDFs: the files that they mean."""

from __future__ import annotations

from pathlib import Path

import pytest

from planlang.package_paths import file_places
from sim.description import read_description

STL = "solid s\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendfacet\nendloop\nendsolid s"
SHAPE = '<collision><geometry><mesh filename="{}"/></geometry></collision>'
URDF = f'<robot name="r">\n<link name="base">\n{SHAPE}</link></robot>'


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """Return the folder of a package ``own_robot`` with meshes."""
    folder = tmp_path / "own_robot"
    for name in ("fore.STL", "предплечье.stl", "Fore Arm/Link (1).stl", "50%25.stl"):
        (folder / "meshes" / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / "meshes" / name).write_text(STL, encoding="utf-8")
    (folder / "urdf").mkdir()
    return folder


def robot(folder: Path, name: str) -> Path:
    """Write a robot whose only mesh has this name; return its path."""
    path = folder / "robot.urdf"
    path.write_text(URDF.format(name), encoding="utf-8")
    return path


NAMES = (
    r"..\meshes\fore.STL",
    r"package://own_robot\meshes\fore.STL",
    "$(find own_robot)/meshes/fore.STL",
    "file://$(find own_robot)/meshes/fore.STL",
    "$(find-pkg-share own_robot)/meshes/fore.STL",
    "own_robot/meshes/fore.STL",
    "package:///own_robot/meshes/fore.STL",
    "package:/own_robot/meshes/fore.STL",
    "Package://own_robot/meshes/fore.STL",
    "package://own_robot/meshes/Fore%20Arm/Link%20(1).stl",
    "../meshes/%D0%BF%D1%80%D0%B5%D0%B4%D0%BF%D0%BB%D0%B5%D1%87%D1%8C%D0%B5.stl",
    "package://own_robot/meshes/Fore Arm/Link (1).stl",
    "package://own_robot/meshes/50%25.stl",
    "model://own_robot/meshes/fore.STL",
    "file:../meshes/fore.STL",
    "file://../meshes/fore.STL",
    " ../meshes/fore.STL ",
)


@pytest.mark.parametrize("name", NAMES)
def test_a_mesh_is_found_by_every_name_that_tools_write(package: Path, name: str) -> None:
    description = read_description(robot(package / "urdf", name))
    assert description.meshes
    assert description.diagnostics == ()


@pytest.mark.parametrize("scheme", ["file://", "file://localhost", "file:", ""])
def test_a_mesh_is_found_by_its_absolute_path(package: Path, tmp_path: Path, scheme: str) -> None:
    path = robot(tmp_path, f"{scheme}{(package / 'meshes' / 'fore.STL').as_posix()}")
    assert read_description(path).meshes


@pytest.mark.parametrize("name", ["package://own_robot/meshes/fore.stl", "package://Own_Robot/Meshes/Fore.STL"])
def test_a_name_of_another_case_is_read_and_the_note_says_so(package: Path, name: str) -> None:
    path = robot(package / "urdf", name)
    description = read_description(path)
    assert description.meshes
    (found,) = description.diagnostics
    assert (found.severity.value, found.code) == ("note", "B010")
    assert f"mesh {name} is read from fore.STL, whose name has another case" in found.message
    assert found.span is not None
    assert (found.span.file, found.span.line) == (str(path), 3)


def test_of_two_files_that_differ_in_case_neither_is_guessed(package: Path) -> None:
    (package / "meshes" / "Fore.stl").write_text(STL, encoding="utf-8")
    if len(list((package / "meshes").glob("[fF]ore.*"))) < 2:
        pytest.skip("this file system does not distinguish cases")
    (found,) = read_description(robot(package / "urdf", "../meshes/FORE.STL")).diagnostics
    assert found.code == "B013"
    assert "ROS_PACKAGE_PATH" in (found.help or "")


@pytest.mark.parametrize(
    ("variable", "places", "name"),
    [
        ("ROS_PACKAGE_PATH", "src", "package://own_robot/meshes/fore.STL"),
        ("ROS_PACKAGE_PATH", "src/repository/own_robot", "package://own_robot/meshes/fore.STL"),
        ("ROS_PACKAGE_PATH", "nowhere:src/repository", "$(find own_robot)/meshes/fore.STL"),
        ("AMENT_PREFIX_PATH", "install", "package://own_robot/meshes/fore.STL"),
        ("GAZEBO_MODEL_PATH", "src/repository", "model://own_robot/meshes/fore.STL"),
    ],
)
def test_packages_are_found_where_ros_and_gazebo_look_for_them(
    package: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, variable: str, places: str, name: str
) -> None:
    there = tmp_path / ("install/share" if variable.startswith("AMENT") else "src/repository") / "own_robot"
    there.parent.mkdir(parents=True)
    package.rename(there)
    (tmp_path / "far" / "away").mkdir(parents=True)
    path = robot(tmp_path / "far" / "away", name)
    assert not read_description(path).meshes
    monkeypatch.setenv(variable, ":".join(str(tmp_path / one) for one in places.split(":")))
    assert read_description(path).meshes


def test_what_lies_beside_the_urdf_comes_before_what_the_environment_knows(
    package: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    other = tmp_path / "src" / "own_robot" / "meshes"
    other.mkdir(parents=True)
    (other / "fore.STL").write_text(STL.replace("vertex 1", "vertex 2"), encoding="utf-8")
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(tmp_path / "src"))
    places = file_places(package / "urdf" / "robot.urdf", "package://own_robot/meshes/fore.STL")
    assert next(place for place in places if place.is_file()) == package / "meshes" / "fore.STL"


def test_a_colour_that_is_none_is_left_out_and_the_robot_is_read(tmp_path: Path) -> None:
    path = tmp_path / "robot.urdf"
    colour = '<material name="m"><color rgba="0.15 0.15 0.15 0 1"/></material>'
    visual = f'<visual><geometry><box size="1 1 1"/></geometry>\n{colour}</visual>'
    path.write_text(f'<robot name="r"><link name="base">{visual}</link></robot>', encoding="utf-8")
    description = read_description(path)
    assert "rgba" not in description.text
    (found,) = [one for one in description.diagnostics if "rgba" in one.message]
    assert (found.code, found.severity.value) == ("B010", "note")
