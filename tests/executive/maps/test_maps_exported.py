"""Real, bundled and generated maps describe the same world after export to Manchester syntax."""

from pathlib import Path

import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from executive.maps import read_map, scene_of
from planlang.diagnostics import BadInput, Severity
from planlang.files import bundled
from planlang.measures import EXTENTS
from planlang.ontology import load
from planlang.ontology.convert import Target, convert
from sim import Body, Scene
from tests.support.examples import examples, some

CORPUS = Path(__file__).parents[4] / "shared" / "corpus"
REAL = tuple(
    sorted(f"{folder}/{path.name}" for folder in ("environments", "objects") for path in CORPUS.glob(f"{folder}/*"))
)
CENTIMETRES = ('"35"^^unit:Centimeter', '"1.5"^^unit:Foot')
HEADER = """
Prefix: : <http://example.org/map.owl#>
Prefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>
Prefix: unit: <http://qudt.org/vocab/unit#>
Ontology: <http://example.org/map.owl>
"""
BUNDLED = tuple(sorted(path.name for path in (bundled("ontologies") / "environments").glob("*.omn")))


def world(path: Path) -> Scene | list[str]:
    """The world of a map, with imports from the corpus; the codes of its errors if it is invalid."""
    try:
        return scene_of(read_map(load(path, folders=[CORPUS / "ontologies"]), ignore_unread=True))
    except BadInput as problem:
        return sorted(one.code for one in problem.diagnostics if one.severity is Severity.ERROR)


def properties(body: Body) -> tuple[object, ...]:
    """Properties of a body other than its pose."""
    return (body.name, body.size, body.shape, body.iri, body.type, body.movable, body.wall, body.soft, body.centre)


def check_same(before: Scene, after: Scene) -> None:
    """Assert that bodies, joints and controls are the same, in any order."""
    assert sorted(map(properties, before.bodies), key=str) == sorted(map(properties, after.bodies), key=str)
    again = {body.name: body for body in after.bodies}
    for body in before.bodies:
        assert body.pose == again[body.name].pose, body.name
        assert body.handles == again[body.name].handles
    assert sorted(before.joints, key=str) == sorted(after.joints, key=str)
    assert sorted(before.controls, key=str) == sorted(after.controls, key=str)
    assert (before.bounds, before.rules) == (after.bounds, after.rules)


def check_export(path: Path, folder: Path, target: Target = Target.MANCHESTER) -> None:
    """Assert that a map describes the same world after export."""
    converted = convert(path, target)
    exported = folder / "exported.omn"
    exported.write_text(converted.text, encoding="utf-8")
    before, after = world(path), world(exported)
    if isinstance(before, Scene) and isinstance(after, Scene):
        check_same(before, after)
    else:
        assert before == after
        assert "M009" in before, "only a map without any pose is no world"


@pytest.mark.parametrize("name", some(REAL or ["none"], 6))
def test_a_real_map_or_model_is_the_same_world_when_exported(corpus: Path, name: str, tmp_path: Path) -> None:
    check_export(corpus / name, tmp_path)


@pytest.mark.parametrize("name", some(BUNDLED, 6))
def test_a_bundled_map_is_the_same_world_when_exported(name: str, tmp_path: Path) -> None:
    check_export(bundled("ontologies") / "environments" / name, tmp_path)


# Generated

COORDINATE = st.integers(-400, 400).map(lambda number: number / 100)
LENGTH = st.one_of(st.integers(1, 300).map(lambda number: f"{number / 100}"), st.sampled_from(CENTIMETRES))
CLASSES = ("Cup", "Cabinet-PieceOfFurniture", "Table-PieceOfFurniture", "Door", "Drawer", "Handle", "Person", "Nothing")
QUATERNIONS = ("0 0 0 1", "0 0 1 0", "0.5 0.5 0.5 0.5", "0 0 0.6 0.8", "1 0 0 0.1", "0 0 0 0")


@st.composite
def maps(draw: st.DrawFn) -> str:
    """A map of a few objects: sizes with and without units, perceptions, relative poses, parts, joints, bad numbers."""
    names = draw(st.lists(st.sampled_from(["one", "two", "three-3", "four_4", "five.5"]), min_size=1, unique=True))
    frames, free = [HEADER], dict.fromkeys(names)  # an object is a part of at most one other
    for number, name in enumerate(names):
        facts = [f"knowrob:{extent} {draw(LENGTH)}" for extent in EXTENTS if draw(st.integers(0, 9))]
        left = [one for one in names[number + 1 :] if one in free]
        parts = draw(st.lists(st.sampled_from(left), unique=True)) if left else []
        free = {one: None for one in free if one not in parts}
        facts += [f"knowrob:properPhysicalParts :{part}" for part in parts]
        if draw(st.integers(0, 5)) == 0:
            facts.append(f"knowrob:jointPosition {draw(st.sampled_from(['0.1', '-3', '99']))}")
        frames.append(individual(f":{name}", draw(st.sampled_from(CLASSES)), ["knowrob:describedInMap :map1", *facts]))
        for count in range(draw(st.integers(0, 2))):
            pose, (x, y, z) = f"pose_{number}_{count}", draw(st.tuples(*3 * [COORDINATE]))
            stated = [
                f'knowrob:translation "{x} {y} {z}"',
                f'knowrob:quaternion "{draw(st.sampled_from(QUATERNIONS))}"',
            ]
            if number and draw(st.booleans()):
                stated.append(f"knowrob:relativeTo :{draw(st.sampled_from(names[:number]))}")
            frames.append(individual(f":{pose}", "RotationMatrix3D", stated))
            seen = [f"knowrob:objectActedOn :{name}", f"knowrob:eventOccursAt :{pose}"]
            if draw(st.booleans()):
                seen.append(f"knowrob:startTime :timepoint_{draw(st.integers(0, 9))}")
            frames.append(individual(f":seen_{number}_{count}", "SemanticMapPerception", seen))
    return "\n".join(frames)


def individual(name: str, cls: str, facts: list[str]) -> str:
    return f"Individual: {name}\n    Types: knowrob:{cls}\n    Facts: {', '.join(facts)}\n"


@pytest.mark.long
@settings(max_examples=examples(60), deadline=None, phases=[Phase.explicit, Phase.reuse, Phase.generate])
@given(text=maps(), target=st.sampled_from([*Target]))
def test_a_generated_map_is_the_same_world_when_exported(
    text: str, target: Target, tmp_path_factory: pytest.TempPathFactory
) -> None:
    folder = tmp_path_factory.mktemp("generated")
    (folder / "map.omn").write_text(text, encoding="utf-8")
    check_export(folder / "map.omn", folder, target)
