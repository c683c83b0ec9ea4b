"""Terms whose IRIs are numbers or random letters are called by their labels."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from planlang.designators import label_iris, local_name, local_part
from planlang.ontology import load_apart
from planlang.ontology.naming import is_opaque
from tests.support.cli_runs import invoke

TIDY = Path(__file__).parents[2] / "strangers" / "webprotege" / "tidy.owl"
W = "http://webprotege.stanford.edu/"


@pytest.mark.parametrize(
    "name",
    [
        *("RBqW5eHn7rTz0cXlMaD3jVs", "R8yKdJ4fZ1sGxN6oBvE2uIt", "RCkz9VbT2hQmL0aXw3Pq7Yd", "OBI_0000070", "GO:0008150"),
        *("BFO_0000001", "Q937", "P31", "71388002", "9f1c2b3a-7d83-4b59-8c11-0a1b2c3d4e5f", "genid17"),
        *("OWLClass_00000000000000000071", "OWLNamedIndividual_9d3a9f1e_7d83", "Class_12"),
    ],
)
def test_numbers_and_random_letters_are_opaque(name: str) -> None:
    assert is_opaque(name)


@pytest.mark.parametrize(
    "name",
    [
        *("Cup", "bottle1", "room3001", "RefrigeratorDoorHandle", "PickingUpAnObject", "RotationMatrix3D", "DUL"),
        *("Table-PieceOfFurniture", "timepoint_1316432987", "put_the_cup_on_the_table", "ISO8601DateOfBirth", "Class"),
        *("RedCupOnTheBigBoxInARoom", "pose_milk1", "SemanticEnvironmentMapPerception", "m00", "Schüssel", ""),
    ],
)
def test_names_that_people_gave_are_not(name: str) -> None:
    assert not is_opaque(name)


def written(folder: Path, *labels: str, name: str = "RBqW5eHn7rTz0cXlMaD3jVq", more: str = "") -> dict[str, str]:
    """What a process of its own calls the terms of a file with these labels."""
    path = folder / "words.ttl"
    path.write_text(
        "@prefix w: <http://webprotege.stanford.edu/> . @prefix rdfs: <http://www.w3.org/2000/01/rdf-schema#> .\n"
        "@prefix skos: <http://www.w3.org/2004/02/skos/core#> . @prefix owl: <http://www.w3.org/2002/07/owl#> .\n"
        f"w:{name} a owl:Class" + "".join(f" ; {label}" for label in labels) + f" .\n{more}",
        encoding="utf-8",
    )
    code = (
        "import sys; from pathlib import Path; from planlang.ontology import load\n"
        "from planlang.designators import local_name, local_part\n"
        "names = load(Path(sys.argv[1]), builtin=False).class_names()\n"
        "sys.stdout.buffer.write('\\n'.join(f'{local_part(n)} {local_name(n)}' for n in names).encode())"
    )
    said = subprocess.run([sys.executable, "-c", code, str(path)], capture_output=True, check=True).stdout.decode()
    return dict(line.split(" ", 1) for line in said.splitlines())


@pytest.mark.parametrize(
    ("labels", "expected"),
    [
        (['rdfs:label "take the cup"'], "take_the_cup"),
        (['rdfs:label "Tasse nehmen"@de', 'rdfs:label "take the cup"@en-gb'], "take_the_cup"),
        (['rdfs:label "Tasse nehmen"@de', 'rdfs:label "prendre"@fr'], "Tasse_nehmen"),
        (['skos:prefLabel "cup"@en'], "cup"),
        (['skos:prefLabel "mug"', 'rdfs:label "cup"'], "cup"),
        (['rdfs:label "3 cups (blue)"'], "3_cups_blue"),
        (['rdfs:label "\u202ecup\\u001b[31m"'], "cup_31m"),
        (['rdfs:label "\u30b3\u30c3\u30d7"@ja'], "\u30b3\u30c3\u30d7"),
        (['rdfs:label "  "', 'rdfs:label "???"'], "RBqW5eHn7rTz0cXlMaD3jVq"),
        ([], "RBqW5eHn7rTz0cXlMaD3jVq"),
    ],
)
def test_the_name_is_the_best_label_in_words(tmp_path: Path, labels: list[str], expected: str) -> None:
    assert written(tmp_path, *labels) == {"RBqW5eHn7rTz0cXlMaD3jVq": expected}


def test_terms_with_one_label_are_told_apart_by_the_end_of_their_iris(tmp_path: Path) -> None:
    more = (
        'w:OBI_0000071 a owl:Class ; rdfs:label "cup" . w:Mug a owl:Class ; rdfs:label "drinking mug" .\n'
        'w:OBI_0000072 a owl:Class ; rdfs:label "Mug" .\n'
    )
    assert written(tmp_path, 'rdfs:label "cup"', more=more) == {
        "RBqW5eHn7rTz0cXlMaD3jVq": "cup_3jVq",
        "OBI_0000071": "cup_0071",
        "Mug": "Mug",
        "OBI_0000072": "Mug_0072",
    }


def test_an_iri_keeps_its_first_name_and_no_two_share_one() -> None:
    label_iris({"http://example.org/x#Q900001": "rare cup of a test"})
    label_iris({"http://example.org/x#Q900001": "other", "http://example.org/x#Q900002": "rare cup of a test"})
    assert local_name("http://example.org/x#Q900001") == "rare cup of a test"
    assert local_name("http://example.org/x#Q900002") == "rare cup of a test_0002"
    assert local_part("http://example.org/x#Q900002") == "Q900002"


def test_an_upload_names_nothing_in_the_process_that_reads_it(tmp_path: Path) -> None:
    content = b'<http://example.org/x#Q910001> <http://www.w3.org/2000/01/rdf-schema#label> "cup of an upload" .'
    load_apart(tmp_path / "upload.ttl", content=content, builtin=False)
    assert local_name("http://example.org/x#Q910001") == "Q910001"


def test_a_plan_of_webprotege_is_called_by_its_labels_and_keeps_its_iris(tmp_path: Path) -> None:
    plan = tmp_path / "tidy.py"
    result = invoke("compile", TIDY, "-o", plan)
    assert result.exit_code == 0, result.output
    text = plan.read_text()
    assert "async def tidy(*, cup: Object = CUP, table: Object = TABLE) -> None:" in text
    assert 'CUP = an_object("Cup", RECIPE + "R9tHbC5vXq2nZr0kJfM8yLa")' in text
    assert 'RECIPE + "RCkz9VbT2hQmL0aXw3Pq7Yd": "take_the_cup",' in text
    shown = invoke("show", plan).output
    assert "take_the_cup" in shown
    assert "RCkz" not in shown


@pytest.mark.parametrize("task", ["tidy", "RBqW5eHn7rTz0cXlMaD3jVs", f"{W}RBqW5eHn7rTz0cXlMaD3jVs"])
def test_a_task_is_found_by_its_label_its_name_and_its_iri(task: str) -> None:
    result = invoke("show", TIDY, "--task", task)
    assert result.exit_code == 0, result.output
    assert "put_the_cup_on_the_table" in result.output
    assert "R8yK" not in result.output
