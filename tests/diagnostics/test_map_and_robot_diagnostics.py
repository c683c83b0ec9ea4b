"""Every code about maps and robots has a small file that provokes it, with the line where it is reported."""

import re
from pathlib import Path

import pytest

from executive.belief import read_map, scene_of
from executive.robots import bind_robot
from planlang.diagnostics import CODES, BadInput, Diagnostic
from planlang.ontology import load

HERE = Path(__file__).parent
URDF = HERE / "robot.urdf"
EXPECTED = re.compile(r"expect ([MB]\d{3}) at line (\d+)")
WITHOUT_URDF = ("B001", "B008", "B011", "B014")
WITHOUT_POSITION = ("B010",)


def files(letter: str) -> list[Path]:
    return sorted(path for path in HERE.glob(f"{letter}[0-9][0-9][0-9]_*"))


def of_map(path: Path) -> list[Diagnostic]:
    try:
        semantic_map = read_map(load(path))
    except BadInput as problem:
        return list(problem.diagnostics)
    found = list(semantic_map.diagnostics)
    scene_of(semantic_map, found)
    return found


def of_robot(path: Path) -> list[Diagnostic]:
    code = path.name[:4]
    if path.suffix == ".urdf":
        source, urdf = HERE / "B010_assumed_numbers.omn", path
    else:
        source, urdf = path, None if code in WITHOUT_URDF else URDF
    try:
        return list(bind_robot(source, urdf).diagnostics)
    except BadInput as problem:
        return list(problem.diagnostics)


@pytest.mark.parametrize("path", [*files("M"), *files("B")], ids=lambda path: path.name)
def test_the_file_is_reported_with_its_code_at_its_line(path: Path) -> None:
    match = EXPECTED.search(path.read_text(encoding="utf-8"))
    assert match, f"{path.name} does not say what is expected"
    code, line = match[1], int(match[2])
    found = of_map(path) if code.startswith("M") else of_robot(path)
    report = "\n".join(map(str, found)) or "nothing"
    if code in WITHOUT_POSITION:
        assert any(d.code == code for d in found), report
    else:
        assert any(d.code == code and d.span and d.span.line == line for d in found), report


def test_every_code_about_maps_and_robots_has_a_file() -> None:
    names = {path.name[:4] for path in (*files("M"), *files("B"))}
    assert {code for code in CODES if code[0] in "MB"} - names == set()
