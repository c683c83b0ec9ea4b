"""Every diagnostic code about files has a small file that provokes it and says at which line it is reported."""

import json
import os
import re
from pathlib import Path

import pytest
from click.testing import CliRunner

from executive.cli.app import app
from executive.maps import read_map, scene_of
from executive.robots import bind_robot
from planlang import files
from planlang.compiler import compile_recipe
from planlang.diagnostics import BadInput, Diagnostic, has_errors
from planlang.ontology import documents, load
from planlang.ontology.convert import Target, convert
from tests.support.codes import CODES

HERE = Path(__file__).parent
URDF = HERE / "robot.urdf"
ABOUT_OPTIONS = {"C001", "C004", "C005", "C006", "C008", "C010", "C012", "C013", "C014", "C015", "C016", "C017", "C018",
                 "P008", "P009", "P010", "P011", "P012", "X003", "X004", "X005", "X006", "X007", "X009", "X010", "X012",
                 "C020", "C021", "C030", "C031", "C032", "C033", "C034", "C035", "C036", "C037", "C038", "C039",
                 "X013", "X014", "X023", "X024", "X025", "X026", "X027", "X028", "X029", "X030", "X031", "X032", "X033",
                 "X034", "X035", "X040", "X041", "X042", "X043", "C019", "C022", "C023", "C024", "C025", "C040", "C041",
                 "M040", "M022", "M023", "M027", "M028", "M032", "O060", "O061", "O062", "O063", "O064"}  # fmt: skip
"""Codes about what was asked for, or about thousands of points; tests/executive triggers them."""
WITHOUT_URDF = ("B001", "B008", "B011", "B014")
WITHOUT_POSITION = ("B010",)
LIMITS = {"O003": (files, "LARGEST_ONTOLOGY", 100), "O033": (documents, "MOST_DOCUMENTS", 1)}
"""What is made small so that a small file exceeds it."""
ANNOUNCED = re.compile(r"# ([A-Z]\d+) (error|warning|note) at line (\d+): ")


def files(letters: str) -> list[Path]:
    return sorted(HERE.glob(f"[{letters}][0-9][0-9][0-9]_*"))


def of_map(path: Path) -> list[Diagnostic]:
    ontology = load(path.with_suffix(".urdf") if path.suffix == ".toml" else path)  # labels of a world
    semantic_map = read_map(ontology)
    found = [*ontology.diagnostics, *semantic_map.diagnostics]
    scene_of(semantic_map, found)
    return found


def of_robot(path: Path) -> tuple[Diagnostic, ...]:
    if path.suffix == ".urdf":
        return bind_robot(HERE / "B010_assumed_numbers.omn", path).diagnostics
    return bind_robot(path, None if path.name[:4] in WITHOUT_URDF else URDF).diagnostics


def of_ontology(path: Path) -> tuple[Diagnostic, ...]:
    if not path.name.startswith("O05"):
        return load(path).diagnostics
    # each file has comments, which say what is expected
    found = convert(path, Target.MANCHESTER).diagnostics
    return tuple(one for one in found if one.code != "O053" or path.name.startswith("O053"))


def of_recipe(path: Path) -> tuple[Diagnostic, ...]:
    text = path.read_text(encoding="utf-8")
    task = re.search(r"^# task: (\S+)", text, re.MULTILINE)
    return compile_recipe(path, task=task[1] if task else None).diagnostics


READERS = {"M": of_map, "B": of_robot, "O": of_ontology, "R": of_recipe}


def diagnostics_of(path: Path) -> list[Diagnostic]:
    try:
        return list(READERS[path.name[0]](path))
    except BadInput as problem:
        return list(problem.diagnostics)


@pytest.mark.parametrize("path", files("MBO"), ids=lambda path: path.name)
def test_a_file_gives_its_diagnostic_at_the_line_it_says(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    expected = re.search(rb"expect ([MBO]\d{3}) at line (\d+)", path.read_bytes())
    assert expected, f"{path.name} does not say what is expected"
    code, line = expected[1].decode(), int(expected[2])
    if code in LIMITS:
        monkeypatch.setattr(*LIMITS[code])
    found = diagnostics_of(path)
    report = "\n".join(map(str, found)) or "nothing"
    assert (code, line) in [
        (d.code, line if code in WITHOUT_POSITION else d.span.line if d.span else None) for d in found
    ], report
    if path.name.startswith("O"):
        assert {d.code for d in found} == {code}, report


@pytest.mark.parametrize("path", files("R"), ids=lambda path: path.stem)
def test_a_recipe_gets_exactly_the_diagnostics_that_it_announces_and_they_say_what_to_do(path: Path) -> None:
    announced = ANNOUNCED.findall(path.read_text(encoding="utf-8"))
    found = diagnostics_of(path)
    told = sorted((d.code, d.severity.value, d.span.line if d.span else 0) for d in found)
    expected = sorted((code, severity, int(line)) for code, severity, line in announced)
    assert told == expected, "\n".join(map(str, found))
    assert all(d.help or d.severity.value == "note" for d in found)


def test_every_code_about_a_file_has_a_file_that_provokes_it() -> None:
    shown = {path.name.split("_")[0] for path in HERE.iterdir()}
    of_files = {code for code in CODES if not code.startswith("K")}  # those are about stores and servers
    assert sorted(of_files - shown - ABOUT_OPTIONS) == []
    assert {path.name[:4] for path in HERE.glob("R*")} <= set(CODES)


def test_a_misspelt_section_is_answered_with_the_right_one() -> None:
    (found,) = diagnostics_of(HERE / "O020_misspelt_section.omn")
    assert found.span is not None
    assert found.span.column == 5
    assert found.help is not None
    assert found.help.startswith("did you mean SubClassOf:?")


def test_an_undefined_entity_is_named_with_its_column() -> None:
    (found,) = diagnostics_of(HERE / "O005_undefined_entity.owl")
    assert found.message.endswith("undefined entity &kitchen;")
    assert found.span is not None
    assert found.span.column == 36


def test_all_syntax_errors_of_a_file_are_reported_in_one_run(tmp_path: Path) -> None:
    path = tmp_path / "O_wrong.omn"
    path.write_text(
        "Prefix: : <http://example.org/t.owl#>\n"
        "Class: A SubclassOf: B\n"
        "Class: B\n"
        "    SubClassOf: p some\n"
        "Individual: c Facts: p q r\n"
        "Class: nowhere:D\n"
    )
    found = [(d.code, d.span.line) for d in diagnostics_of(path) if d.span]
    assert found == [("O020", 2), ("O020", 5), ("O020", 5), ("O021", 6)]


def test_rdf_about_and_rdf_resource_may_be_exchanged() -> None:
    thing = load(HERE / "O010_resource_of_a_thing.owl")
    assert thing.is_class("http://example.org/t.owl#A")
    ontology = load(HERE / "O010_about_of_a_property.owl")
    assert ontology.is_a("http://example.org/t.owl#A", "Door")


def test_warnings_do_not_stop_a_file() -> None:
    assert not has_errors(diagnostics_of(HERE / "O012_wrong_namespace.owl"))


@pytest.mark.parametrize(
    ("command", "name", "severity", "line"),
    [
        ("check", "C002_syntax_error.plan", "error", 6),
        ("check", "C003_no_plan.plan", "error", 1),
        ("compile", "C007_plan.plan", "error", 1),
        ("check", "C009_changed_recipe.plan", "error", 1),
        ("check", "C011_recipe_gone.plan", "warning", 1),
        ("run", "X001_cannot_be_imported.plan", "error", 6),
        ("run", "X002_defines_no_plan.plan", "error", 1),
    ],
)
def test_a_plan_file_has_its_diagnostic_at_its_line(command: str, name: str, severity: str, line: int) -> None:
    options = ["--robot", "amigo", "--environment", "hospital_room"] if command == "run" else []
    result = CliRunner().invoke(app, [command, str(HERE / name), *options, "--json"])
    (found,) = json.loads(result.stdout)["diagnostics"]
    assert (found["severity"], found["code"]) == (severity, name.split("_")[0])
    assert (found["span"]["file"], found["span"]["line"]) == (str(HERE / name), line)
    assert result.exit_code == (2 if severity == "error" else 0)


@pytest.mark.parametrize(
    ("name", "line"),
    [
        ("X020_no_json.jsonl", 3),
        ("X020_backwards.jsonl", 4),
        ("X020_no_trace.jsonl", 1),
        ("X021_ended.jsonl", 1),
        ("X022_other_plan.jsonl", 1),
    ],
)
def test_a_trace_that_cannot_be_resumed_has_its_diagnostic_at_its_line(name: str, line: int) -> None:
    result = CliRunner().invoke(app, ["run", "--resume", str(HERE / name), "--trace", os.devnull, "--json"])
    found = json.loads(result.stdout)["diagnostics"]
    assert {(one["severity"], one["code"]) for one in found} == {("error", name.split("_")[0])}
    assert (found[0]["span"]["file"], found[0]["span"]["line"]) == (str(HERE / name), line)
    assert result.exit_code == 2


def test_a_file_of_process_modules_has_its_diagnostic_at_its_line() -> None:
    name = str(HERE / "X011_cannot_be_imported.module")
    result = CliRunner().invoke(app, ["run", "serve_a_drink", "--modules", name, "--json"])
    (found,) = json.loads(result.stdout)["diagnostics"]
    assert (found["code"], found["span"]["file"], found["span"]["line"]) == ("X011", name, 4)
