"""``planlang check`` of a map names the things that no hand takes for their width, and no furniture."""

from __future__ import annotations

from pathlib import Path

from cli_runs import invoke

MAP = """
Prefix: : <http://example.org/study.owl#>
Prefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>
Ontology: <http://example.org/study.owl>
    Import: <http://knowrob.org/kb/knowrob.owl>
Individual: study
    Types: knowrob:SemanticEnvironmentMap
"""
THINGS = {
    "desk1": ("Desk-PieceOfFurniture", "2 0 0.37", "0.6 1.2 0.74"),
    "book1": ("BookCopy", "2 0 0.755", "0.13 0.19 0.03"),
    "book2": ("BookCopy", "2 0.3 0.755", "0.13 0.19 0.03"),
    "parcel1": ("CardboardBox", "2 -0.3 0.78", "0.16 0.25 0.08"),
    "cup1": ("Cup", "1.8 0.3 0.79", "0.08 0.08 0.1"),
    "stool1": ("Stool", "-1 0 0.2", "0.4 0.4 0.4"),
}


def test_things_too_wide_for_any_hand_are_named_in_one_note(tmp_path: Path) -> None:
    path = tmp_path / "study.omn"
    stated = (
        f'Individual: {name}\n    Types: knowrob:{cls}\n    Facts: knowrob:translation "{at}", '
        f'knowrob:heading 0, knowrob:boundingBoxSize "{size}"\n'
        for name, (cls, at, size) in THINGS.items()
    )
    path.write_text(MAP + "".join(stated), encoding="utf-8")
    result = invoke("check", path)
    (note,) = (line for line in result.stderr.splitlines() if "M040" in line)
    told = "book1, book2 are 0.13 m wide, parcel1 is 0.16 m wide: no hand takes more than 0.12 m"
    assert note.endswith(f"note M040 {told}")
