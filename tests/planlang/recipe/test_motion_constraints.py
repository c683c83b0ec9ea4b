"""Constraints of motions reach the plan whole: kind, features, limits, weight, speed and frame."""

import re
from pathlib import Path

import pytest
import rdflib

from planlang import Feature, MotionConstraint
from planlang.compiler import compile_recipe
from planlang.designators import a_device, an_object
from planlang.diagnostics import BadInput
from planlang.motion_constraints import ConstraintKind, Speed
from planlang.ontology import load
from planlang.recipe import Actions, read_recipe
from planlang.recipe.model import Constraint
from planlang.testing import Script, compiled, run_plan

RECIPE = """\
Prefix: : <http://example.org/wipe.owl#>
Prefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>
Prefix: mc: <http://knowrob.org/kb/motion-constraints.owl#>
Prefix: srdl2-comp: <http://knowrob.org/kb/srdl2-comp.owl#>
Prefix: xsd: <http://www.w3.org/2001/XMLSchema#>

Ontology: <http://example.org/wipe.owl>
    Import: <http://knowrob.org/kb/motion-constraints.owl>

Class: Wiping
    SubClassOf: knowrob:PurposefulAction, knowrob:subAction some Press

Class: Careful
    SubClassOf: knowrob:ITaSCMotion, knowrob:constrainedBy some Upright

Class: Press
    SubClassOf: Careful,
        knowrob:deviceUsed some SpongeInLeftHand,
        knowrob:objectActedOn some knowrob:Table-PieceOfFurniture,
        knowrob:constrainedBy some FrontAboveTable_near,
        knowrob:constrainedBy value Centred

Class: SpongeInLeftHand
    EquivalentTo: knowrob:Sponge and (srdl2-comp:predecessorInKinematicChain some knowrob:LeftArm)

Class: knowrob:Sponge
    SubClassOf: knowrob:HumanScaleObject

Class: Upright
    SubClassOf: mc:PerpendicularityConstraint,
        mc:toolFeature some knowrob:ObjectMainAxis, mc:worldFeature some knowrob:SupportingPlane,
        mc:constrLowerLimit value "0.95"^^xsd:double, mc:refFeature value "/map"

Class: FrontAboveTable
    SubClassOf: mc:HeightConstraint,
        mc:toolFeature some (knowrob:FrontSide and (inverse knowrob:properPhysicalParts some (
            knowrob:Blade and (knowrob:physicalPartOf some knowrob:Sponge)))),
        mc:worldFeature some knowrob:SupportingPlane,
        mc:constrLowerLimit value "0.5"^^xsd:double, mc:constrUpperLimit value "0.6"^^xsd:double

Class: FrontAboveTable_near
    SubClassOf: FrontAboveTable, mc:SlowMotionConstraint,
        mc:constrLowerLimit value "0.0"^^xsd:double, mc:constrUpperLimit value "0.01"^^xsd:double,
        mc:constrWeight value "0.0"^^xsd:double

Class: Centred
    SubClassOf: mc:DistanceConstraint, mc:toolFeature some knowrob:Sponge,
        mc:worldFeature some knowrob:Table-PieceOfFurniture,
        mc:constrUpperLimit value 0.1
"""


@pytest.fixture
def recipe(tmp_path: Path) -> Path:
    path = tmp_path / "wipe.omn"
    path.write_text(RECIPE, encoding="utf-8")
    return path


def asked(recipe: Path, step: str) -> dict[str, MotionConstraint]:
    """Return the constraints, by name, with which the compiled plan has a step performed."""
    found: list[MotionConstraint] = []
    script = Script().performs("ITaSCMotion")
    script.on(step, does=lambda belief, action: found.extend(action.get("constrained_by")))
    assert run_plan(compiled(recipe), script=script).failure is None
    return {str(one.name): one for one in found}


SPONGE, TABLE, LEFT = an_object("Sponge"), an_object("Table-PieceOfFurniture"), a_device("LeftArm")


def test_own_and_inherited_constraints_reach_the_process_module(recipe: Path) -> None:
    assert asked(recipe, "Press").keys() == {"Upright", "FrontAboveTable", "Centred"}


def test_a_subclass_replaces_the_limits_of_its_parent_and_keeps_its_features(recipe: Path) -> None:
    near = asked(recipe, "Press")["FrontAboveTable"]
    assert (near.kind, near.lower, near.upper) == (ConstraintKind.HEIGHT, 0.0, 0.01)
    assert (near.weight, near.speed) == (0.0, Speed.SLOW)
    assert near.tool == Feature(None, SPONGE, path=("Blade", "FrontSide"))


def test_features_without_a_whole_belong_to_what_the_motion_uses_and_acts_on(recipe: Path) -> None:
    found = asked(recipe, "Press")
    assert found["Upright"].tool == Feature(None, SPONGE, path=("ObjectMainAxis",), held_by=LEFT)
    assert found["Upright"].world == Feature(None, TABLE, path=("SupportingPlane",))
    assert (found["Upright"].lower, found["Upright"].upper, found["Upright"].frame) == (0.95, None, "/map")


def test_a_feature_that_several_constraints_name_is_described_once(recipe: Path) -> None:
    source = compile_recipe(recipe).source
    assert 'supporting_plane = a_feature(of=table_piece_of_furniture, path=("SupportingPlane",))' in source
    assert source.count('"SupportingPlane"') == 1


BOTH_FRONTS = """
Class: Careful
    SubClassOf: knowrob:constrainedBy some Parallel, knowrob:constrainedBy some Near

Class: Parallel
    SubClassOf: mc:PerpendicularityConstraint, mc:constrLowerLimit value 0.95,
        mc:toolFeature some (knowrob:FrontSide and (inverse knowrob:properPhysicalParts some knowrob:Sponge)),
        mc:worldFeature some (knowrob:FrontSide and
            (inverse knowrob:properPhysicalParts some knowrob:Table-PieceOfFurniture))

Class: Near
    SubClassOf: mc:DistanceConstraint, mc:constrUpperLimit value 0.1,
        mc:toolFeature some (knowrob:FrontSide and (inverse knowrob:properPhysicalParts some knowrob:Sponge)),
        mc:worldFeature some (knowrob:FrontSide and
            (inverse knowrob:properPhysicalParts some knowrob:Table-PieceOfFurniture))
"""


def test_features_of_one_name_are_called_after_their_things_too(recipe: Path) -> None:
    recipe.write_text(RECIPE + BOTH_FRONTS, encoding="utf-8")
    source = compile_recipe(recipe).source
    tool, world = re.findall(r"^    (front_side_\w+) = a_feature\(", source, flags=re.M)
    assert (tool, world) == ("front_side_of_sponge", "front_side_of_table_piece_of_furniture")
    found = asked(recipe, "Press")
    assert found["Near"].world == found["Parallel"].world == Feature(None, TABLE, path=("FrontSide",))


def test_a_feature_of_the_class_of_the_tool_is_the_tool_itself(recipe: Path) -> None:
    centred = asked(recipe, "Press")["Centred"]
    assert centred.tool == Feature(None, SPONGE, held_by=LEFT)
    assert centred.world == Feature(None, TABLE)


@pytest.mark.parametrize(
    ("stated", "instead", "message"),
    [
        (
            "mc:constrUpperLimit value 0.1",
            'mc:constrUpperLimit value "wide"',
            "constrUpperLimit of the constraint `Centred` is 'wide'",
        ),
        (
            "mc:DistanceConstraint, mc:toolFeature",
            "mc:MotionConstraint, mc:toolFeature",
            "`Centred` is not a constraint of a known kind",
        ),
        (
            "mc:constrUpperLimit value 0.1",
            'mc:constrUpperLimit value "1"^^<http://qudt.org/vocab/unit#DegreeAngle>',
            "constrUpperLimit of the constraint `Centred` is '1 DegreeAngle'",
        ),
        ("mc:toolFeature some knowrob:Sponge,\n", "\n", "the constraint `Centred` has no toolFeature"),
        ('value "0.01"^^', 'value "-0.01"^^', "has the lower limit 0 above its upper limit -0.01"),
        ('mc:constrWeight value "0.0"', 'mc:constrWeight value "-1.0"', "has the weight -1"),
    ],
)
def test_a_constraint_that_bounds_nothing_is_an_error_where_it_stands(
    recipe: Path, stated: str, instead: str, message: str
) -> None:
    assert RECIPE.count(stated) == 1
    recipe.write_text(RECIPE.replace(stated, instead), encoding="utf-8")
    with pytest.raises(BadInput) as caught:
        compiled(recipe)
    (found,) = [one for one in caught.value.diagnostics if one.code == "R065"]
    assert message in found.message
    assert found.span is not None
    name = re.search("`(.*?)`", found.message)
    assert name is not None
    assert recipe.read_text(encoding="utf-8").splitlines()[found.span.line - 1].startswith(f"Class: {name[1]}")


@pytest.mark.parametrize(("limit", "metres"), [('"4"^^<http://qudt.org/vocab/unit#Inch>', 0.1016), ("1", 1.0)])
def test_a_limit_may_be_in_any_unit_of_length_and_a_whole_number(recipe: Path, limit: str, metres: float) -> None:
    text = RECIPE.replace("mc:constrUpperLimit value 0.1", f"mc:constrUpperLimit value {limit}")
    recipe.write_text(text, encoding="utf-8")
    assert asked(recipe, "Press")["Centred"].upper == metres


CONSTR = "http://knowrob.org/kb/motion-constraints.owl#"


def stated_by_rdflib(graph: rdflib.Graph, cls: rdflib.term.Node, prop: str) -> list[rdflib.term.Node]:
    """Return what a class or the nearest class above it states for a property."""
    for above in graph.transitive_objects(cls, rdflib.RDFS.subClassOf):
        found = [
            filler
            for node in graph.objects(above, rdflib.RDFS.subClassOf)
            if graph.value(node, rdflib.OWL.onProperty) == rdflib.URIRef(prop)
            for filler in (graph.value(node, rdflib.OWL.hasValue), graph.value(node, rdflib.OWL.someValuesFrom))
            if filler is not None
        ]
        if found:
            return found
    return []


def test_flipping_a_pancake_has_the_limits_and_weights_that_an_rdf_library_reads(corpus: Path) -> None:
    file = corpus / "recipes" / "pancake-making-constr@hydro.owl"
    recipes = read_recipe(Actions(load(file))).recipes
    assert recipes is not None
    graph = rdflib.Graph().parse(file, format="xml")
    found = [
        one.filler
        for step in recipes.main.steps
        for one in step.parameters
        if one.property == "constrainedBy" and isinstance(one.filler, Constraint)
    ]
    assert (len(found), sum(one.weight > 0 for one in found)) == (77, 50)
    for one in found:
        numbers = [
            float(str(stated_by_rdflib(graph, rdflib.URIRef(one.iri), CONSTR + word)[0]))
            for word in ("constrLowerLimit", "constrUpperLimit", "constrWeight")
        ]
        assert numbers == [one.lower, one.upper, one.weight]
        assert one.tool.held_by is not None
        assert one.tool.held_by.type == ("LeftArm" if "Left" in one.name else "RightArm")
        assert (one.tool.of.type, one.world.of.type) == ("Spatula", "Pancake")


def test_motions_of_pouring_have_their_own_and_the_templates_constraints(corpus: Path, tmp_path: Path) -> None:
    for name in ("hold-at-angle", "hold-upright", "keep-above", "point-at"):
        text = (corpus / "ontologies" / f"{name}@hydro.owl").read_text(encoding="utf-8")
        (tmp_path / f"{name}.owl").write_text(text, encoding="utf-8")
    ontology = load(corpus / "recipes" / "pouring@hydro.owl", folders=[tmp_path])
    recipes = read_recipe(Actions(ontology)).recipes
    assert recipes is not None
    for step in recipes.main.steps:
        found = [one.filler for one in step.parameters if isinstance(one.filler, Constraint)]
        kinds = sorted(one.kind.name for one in found)
        assert kinds == ["HEIGHT", "IN_FRONT_OF", "PERPENDICULARITY", "RIGHT_OF"]
        upright = next(one for one in found if one.kind is ConstraintKind.PERPENDICULARITY)
        assert upright.tool.path == ("BottleCap", "ObjectMainAxis")
        assert (upright.lower, upright.upper) == ((-0.6, -0.5) if step.name == "TiltBottle" else (0.95, 1.2))
