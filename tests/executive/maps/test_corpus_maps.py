"""Maps and object models of the corpus: poses and sizes against the truth files, and the effect of bad numbers."""

import json
import re
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from executive.maps import SemanticMap, read_map, scene_of
from executive.maps.measures import stated_size
from executive.maps.semantic_map import PosesOfThings
from planlang.diagnostics import Diagnostic, Severity
from planlang.files import bundled
from planlang.knowledge.places import holders, levels_of, places
from planlang.measures import EXTENTS, read_transform
from planlang.ontology import Ontology, load
from tests.support.examples import examples

CORPUS = Path(__file__).parents[4] / "shared" / "corpus"
TRUTHS = (
    "environments/ias_hospital_room@re_stack.owl.in",
    "environments/ias_hospital_room_2D_occupancy_map@re_stack.owl.in",
    "environments/ias_hospital_room_octomap@re_stack.owl.in",
    "environments/ias_hospital_room_with_objects@re_stack.owl.in",
    "environments/ias_semantic_map@hydro.owl",
    "environments/map_hospital_room@re_stack.owl.in",
    "objects/cabinet_model@re_stack.owl.in",
    "objects/knowrob_rel_coord_test@hydro.owl",
    "objects/mondamin-pancake-mix@hydro.owl",
    "objects/object_model@re_stack.owl.in",
    "objects/pancake-maker@hydro.owl",
    "objects/spatula-features@hydro.owl",
)
ENVIRONMENTS = tuple(name for name in TRUTHS if name.startswith("environments/"))


def renamed(iri: str) -> str:
    """The IRI as it is read: the vocabulary's old namespace is mapped to the new one."""
    return iri.replace("http://ias.cs.tum.edu/kb/knowrob.owl", "http://knowrob.org/kb/knowrob.owl")


@pytest.mark.parametrize("name", TRUTHS)
def test_every_true_pose_and_size_is_read_or_its_repair_noted(corpus: Path, name: str) -> None:
    truth = json.loads((corpus / "truth" / f"map_{Path(name).name}.json").read_text())
    ontology, found = load(corpus / name), list[Diagnostic]()
    poses, compared = PosesOfThings(ontology, found), 0
    for iri, expected in truth["objects"].items():
        size = dict(zip(EXTENTS, stated_size(ontology, renamed(iri), []), strict=True))
        assert all(size[extent] == expected["dimensions"].get(extent, size[extent]) for extent in EXTENTS), iri
        if "translation" in expected:
            compared += 1
            check_pose(ontology, poses.place_of(renamed(iri)), expected)
    assert compared == truth["n_posed"]


def check_pose(ontology: Ontology, place: str | None, expected: dict[str, Any]) -> None:
    """Compare a pose with its file; relative ones in the frame of their parent."""
    assert place is not None
    told: list[Diagnostic] = []
    matrix = read_transform(ontology, place, told)
    assert matrix is not None
    assert np.allclose(matrix[:3, 3], expected["translation"], atol=1e-6), place
    assert bool(expected["pose_anomalies"]) == any(one.code in ("M001", "M004") for one in told), place


@pytest.mark.parametrize("name", ENVIRONMENTS)
def test_every_map_is_read_and_placed_in_room_3001_of_karlstrasse_45(corpus: Path, name: str) -> None:
    ontology = load(corpus / name)
    scene_of(read_map(ontology))
    if name != "environments/ias_semantic_map@hydro.owl":  # which states no hierarchy of places
        asked = {("room", "3001"), ("floor", "3"), ("building", "45"), ("street", "Karlstrasse 45"), ("city", "Munich")}
        assert asked <= set(places(ontology))


def test_a_place_that_is_stated_as_a_part_of_a_smaller_one_is_reversed_with_a_note(corpus: Path) -> None:
    semantic_map = read_map(load(corpus / "environments" / "map_hospital_room@re_stack.owl.in"))
    assert [one.code for one in semantic_map.diagnostics].count("M021") == 4
    room = next(thing for thing in semantic_map.objects if thing.name == "Room7635")
    held_by = []
    while (holder := semantic_map.holder(room)) is not None:
        held_by.append(holder.name)
        room = holder
    assert held_by[:3] == ["Level4269", "Building4268", "Street4502"]


def test_the_hierarchy_of_places_is_the_same_whichever_way_round_it_is_stated(corpus: Path) -> None:
    files = ("map_hospital_room@re_stack.owl.in", "ias_hospital_room_octomap@re_stack.owl.in")
    chains = []
    for file in files:
        ontology = load(corpus / "environments" / file)
        held = holders(ontology, levels_of(ontology))
        chains.append({one.rsplit("#")[-1]: other.rsplit("#")[-1] for one, other in held.items()})
    assert chains[0] == chains[1]
    assert chains[0]["Room7635"] == "Level4269"
    assert chains[0]["Street4502"] == "Munich"


# Bad numbers

_NUMBER = re.compile(r'(?<=[>"\s])-?\d+(?:\.\d+)?(?=<|,|\s|")')
"""A number that stands alone in RDF/XML or Manchester syntax."""
BAD = ("-1", "nan", "1e30", "abc", "", "0", "-0.0", "1e-30", "1 2 3")
SMALL = (*ENVIRONMENTS[:4], ENVIRONMENTS[5])


@cache
def texts() -> dict[str, str]:
    """Maps by name: real ones, and a bundled one."""
    here = {name: (CORPUS / name).read_text(encoding="utf-8") for name in SMALL if (CORPUS / name).is_file()}
    room = bundled("ontologies") / "environments" / "hospital_room.omn"
    return here | {room.name: room.read_text(encoding="utf-8")}


@cache
def placed(name: str, text: str) -> tuple[SemanticMap, set[str], list[Diagnostic]]:
    """The map of a text, its objects with a pose, and the diagnostics."""
    semantic_map = read_map(load(Path(name), content=text.encode()), ignore_unread=True)
    found = [*semantic_map.diagnostics]
    scene_of(semantic_map, found)
    return semantic_map, {thing.iri for thing in semantic_map.objects if thing.pose}, found


@pytest.mark.long
@settings(max_examples=examples(40), deadline=None)
@given(data=st.data(), bad=st.sampled_from(BAD))
def test_a_bad_number_costs_one_thing_and_a_warning_never_the_map(data: st.DataObject, bad: str) -> None:
    every = texts()
    name = data.draw(st.sampled_from(sorted(every)))
    text = every[name]
    where = data.draw(st.sampled_from([m.span() for m in _NUMBER.finditer(text) if text[: m.start()].count("#") > 3]))
    is_quoted = name.endswith(".omn") and text[where[0] - 1] != '"'
    assume("<?xml" not in text[max(0, where[0] - 30) : where[0]])
    written = f'"{bad}"' if is_quoted else bad
    _, before, _ = placed(name, text)
    semantic_map, after, found = placed(name, text[: where[0]] + written + text[where[1] :])
    assert len(before - after) <= 1
    assert len(after - before) <= 0
    assert all(one.severity is not Severity.ERROR for one in found)
    if before != after:
        assert {"M002", "M003"} & {one.code for one in found}, semantic_map.iri
