"""Fixes of recipes are edits of their text, in both syntaxes, and change nothing else."""

from __future__ import annotations

import re
from difflib import ndiff
from pathlib import Path

import pytest

from planlang.compiler import compile_recipe
from planlang.diagnostics import BadInput
from planlang.ontology.convert import Target, convert
from planlang.ontology.documents import syntax_of
from planlang.recipe.fixes import ACCEPTABLE
from planlang.recipe.fixes.fixing import Fixed, fix_recipe
from tests.support.examples import some

MANCHESTER = """\
Prefix: : <http://planlang.org/test#>
Prefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>
Ontology: <http://planlang.org/test>

Class: Serve
    SubClassOf:
        knowrob:PurposefulAction,
{items}

{frames}
Class: Take
    SubClassOf: knowrob:GraspingSomething, knowrob:subAction some Close

Class: Close
    SubClassOf: knowrob:ClosingAGripper

Class: Give
    SubClassOf: knowrob:HandingOverAnObject, knowrob:recipient some knowrob:Person
"""

XML = """\
<?xml version="1.0"?>
<!DOCTYPE rdf:RDF [<!ENTITY knowrob "http://knowrob.org/kb/knowrob.owl#">]>
<rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#" xmlns:rdfs="http://www.w3.org/2000/01/rdf-schema#"
         xmlns:owl="http://www.w3.org/2002/07/owl#" {prefix} xml:base="http://planlang.org/test">
    <owl:Class rdf:ID="Serve">
        <rdfs:subClassOf rdf:resource="&knowrob;PurposefulAction"/>
        {items}
    </owl:Class>
    {frames}
    <owl:Class rdf:ID="Take">
        <rdfs:subClassOf rdf:resource="&knowrob;GraspingSomething"/>
        <rdfs:subClassOf><owl:Restriction><owl:onProperty rdf:resource="&knowrob;subAction"/>
            <owl:someValuesFrom rdf:resource="#Close"/></owl:Restriction></rdfs:subClassOf>
    </owl:Class>
    <owl:Class rdf:ID="Close"><rdfs:subClassOf rdf:resource="&knowrob;ClosingAGripper"/></owl:Class>
    <owl:Class rdf:ID="Give"><rdfs:subClassOf rdf:resource="&knowrob;HandingOverAnObject"/>
        <rdfs:subClassOf><owl:Restriction><owl:onProperty rdf:resource="&knowrob;recipient"/>
            <owl:someValuesFrom rdf:resource="&knowrob;Person"/></owl:Restriction></rdfs:subClassOf></owl:Class>
</rdf:RDF>
"""
KNOWROB_PREFIX = 'xmlns:knowrob="http://knowrob.org/kb/knowrob.owl#"'
FLAT = "\n        ".join(
    f'<rdfs:subClassOf><owl:Restriction>\n<owl:onProperty rdf:resource="&knowrob;subAction"/>'
    f'<owl:someValuesFrom rdf:resource="#{name}"/></owl:Restriction></rdfs:subClassOf>'
    for name in ("Give", "Take")
)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path


def fixed(folder: Path, text: str, *accepted: str, name: str = "r.owl") -> Fixed:
    path = folder / name
    path.write_bytes(text.encode())
    before = path.read_bytes()
    found = fix_recipe(path, accepted=frozenset(accepted))
    assert path.read_bytes() == before, "the original stays as it is"
    return found


def compiled(folder: Path, found: Fixed) -> tuple[str, list[str]]:
    """The plan of the fixed text, and the codes of what there still is to say."""
    path = folder / "fixed.owl"
    path.write_bytes(found.content)
    plan = compile_recipe(path)
    return plan.source, [one.code for one in plan.diagnostics]


def changed(found: Fixed) -> list[str]:
    return difference(found.before, found.after)


def difference(before: str, after: str) -> list[str]:
    return [line for line in ndiff(before.splitlines(), after.splitlines()) if line[0] in "+-"]


def codes(found: Fixed) -> list[str]:
    return [fix.code for fix in found.done]


@pytest.mark.parametrize(
    "items",
    some(
        [
            "        knowrob:subAction some Give,\n        knowrob:subAction some Take",
            "        knowrob:subAction some Give, # first, they say\n        knowrob:subAction some Take # Class: No",
            "        knowrob:subAction some Give, knowrob:subAction some Take",
            "        (knowrob:subAction some Take) and (knowrob:subAction some Give)",
            "        knowrob:subAction some Give,\n"
            "        knowrob:subAction some (Take and knowrob:deviceUsed some knowrob:HolderGripper)",
            "        <http://knowrob.org/kb/knowrob.owl#subAction> some <http://planlang.org/test#Give>,\n"
            "        <http://knowrob.org/kb/knowrob.owl#subAction> some :Take",
        ],
        every=6,
    ),
    ids=["lines", "comments", "one line", "intersection", "nested", "full names"],
)
def test_a_missing_order_is_written_in_manchester_syntax(folder: Path, items: str) -> None:
    found = fixed(folder, MANCHESTER.format(items=items, frames=""), "R042", name="r.omn")
    assert codes(found) == ["R042"]
    assert not [line for line in changed(found) if line.startswith("-") and "subAction" not in line]
    source, said = compiled(folder, found)
    assert "R042" not in said
    assert source.index("Take") < source.index("HandingOverAnObject")


@pytest.mark.parametrize("prefix", [KNOWROB_PREFIX, ""], ids=["prefix", "no prefix"])
@pytest.mark.parametrize("form", ["flat", "intersection"])
def test_a_missing_order_is_written_in_rdf_xml(folder: Path, prefix: str, form: str) -> None:
    parts = re.sub("</?rdfs:subClassOf>", "", FLAT)
    intersection = (
        f'<rdfs:subClassOf><owl:Class><owl:intersectionOf rdf:parseType="Collection">{parts}'
        "</owl:intersectionOf></owl:Class></rdfs:subClassOf>"
    )
    text = XML.format(prefix=prefix, items=FLAT if form == "flat" else intersection, frames="")
    found = fixed(folder, text, "R042")
    assert codes(found) == ["R042"]
    assert 'rdf:about="http://planlang.org/test#Serve_Take_Give"' in found.after
    assert "R042" not in compiled(folder, found)[1]


def test_an_order_that_the_file_does_not_state_is_written_only_if_that_is_accepted(folder: Path) -> None:
    found = fixed(folder, XML.format(prefix=KNOWROB_PREFIX, items=FLAT, frames=""))
    assert (found.done, [fix.code for fix in found.unaccepted], found.after) == ((), ["R042"], found.before)


OWN = "http://planlang.org/test#"
CUP = '<knowrob:Cup rdf:ID="a"/><rdf:Description rdf:ID="b"><rdf:type rdf:resource="#Cup"/></rdf:Description>'


def test_a_name_is_corrected_with_the_prefix_of_the_file_under_an_old_address_too(folder: Path) -> None:
    text = XML.format(prefix=KNOWROB_PREFIX + f' xmlns:own="{OWN}"', items=FLAT, frames=CUP.replace("knowrob:", "own:"))
    found = fixed(folder, text.replace("http://knowrob.org/", "http://ias.cs.tum.edu/"), "R042", "R058")
    assert "R058" in codes(found)
    assert '"http://ias.cs.tum.edu/kb/knowrob.owl#Cup"' in found.after
    assert not {"R042", "R058"} & {*compiled(folder, found)[1]}


def test_a_name_is_corrected_with_the_prefix_of_the_file_in_manchester_syntax(folder: Path) -> None:
    text = MANCHESTER.format(items="knowrob:subAction some Take", frames="Individual: a\n    Types: Cup\n")
    assert "    Types: knowrob:Cup\n" in fixed(folder, text, "R058", name="r.omn").after


def test_line_ends_stay_as_they_are(folder: Path) -> None:
    for name, text in [
        ("r.omn", MANCHESTER.format(items="knowrob:subAction some Give,\n   knowrob:subAction some Take", frames="")),
        ("r.owl", XML.format(prefix=KNOWROB_PREFIX, items=FLAT, frames="")),
    ]:
        found = fixed(folder, text.replace("\n", "\r\n"), "R042", name=name)
        assert codes(found) == ["R042"]
        assert found.after.count("\r\n") == found.after.count("\n")


def test_the_encoding_stays_as_it_is(folder: Path) -> None:
    text = MANCHESTER.format(items="knowrob:subAction some Give, # Köche\n   knowrob:subAction some Take", frames="")
    path = folder / "r.omn"
    path.write_bytes(text.encode("utf-16"))
    found = fix_recipe(path, accepted=frozenset({"R042"}))
    assert codes(found) == ["R042"]
    assert "# Köche" in found.content.decode("utf-16")


@pytest.mark.parametrize("encoding", ["ISO-8859-1", "UTF-16"])
def test_names_of_a_file_that_states_its_encoding_stay_as_they_are(folder: Path, encoding: str) -> None:
    given = XML.format(prefix=KNOWROB_PREFIX, items=FLAT, frames="<!-- Köche -->").replace("Give", "GibKüche")
    content = f'<?xml version="1.0" encoding="{encoding}"?>\n{given.partition("?>")[2] or given}'.encode(encoding)
    path = folder / "r.owl"
    path.write_bytes(content)
    assert fix_recipe(path, accepted=frozenset()).content == content
    found = fix_recipe(path, accepted=frozenset({"R042"}))
    assert codes(found) == ["R042"]
    assert "GibKüche" in found.content.decode("utf-8")


@pytest.mark.parametrize("syntax", [Target.RDFXML, Target.OWLXML, Target.TURTLE, Target.FUNCTIONAL])
def test_a_recipe_in_another_syntax_stays_in_it_and_what_is_lost_is_noted(folder: Path, syntax: Target) -> None:
    text = MANCHESTER.format(items="knowrob:subAction some Give, knowrob:subAction some Take", frames="")
    (folder / "given.omn").write_text(text)
    given = convert(folder / "given.omn", syntax).text
    mark = "<!-- Köche -->\n" if given.startswith("<") else "# Köche\n"
    given = given.replace("?>\n", "?>\n" + mark) if given.startswith("<") else mark + given
    found = fixed(folder, given, "R042")
    assert codes(found) == ["R042"]
    assert [one.code for one in found.notes] == ["O053"]
    assert syntax_of(found.after, "r.owl") == syntax_of(given, "r.owl")
    assert all(line.startswith("+") for line in difference(*found.changed) if "subAction" not in line)
    assert "R042" not in compiled(folder, found)[1]


def test_exchanged_fillers_are_exchanged_and_nothing_else_changes(folder: Path) -> None:
    path = Path(__file__).parents[2] / "diagnostics" / "R030_exchanged_fillers.omn"
    found = fixed(folder, path.read_text(encoding="utf-8"), name="r.omn")
    assert codes(found) == ["R030"]
    assert sorted(changed(found)) == [
        "+         knowrob:deviceUsed value gripper1,",
        "+         knowrob:objectActedOn value bottle1",
        "-         knowrob:deviceUsed value bottle1",
        "-         knowrob:objectActedOn value gripper1,",
    ]
    assert compiled(folder, found)[1] == []


MISSPELT = """
Individual: o
    Types: knowrob:PartialOrdering-Strict
    Facts: knowrob:occursBeforeInOrdering {before}, knowrob:occursAfterInOrdering Give
"""
STEPS = "knowrob:subAction some Give, knowrob:subAction some {step}, knowrob:orderingConstraints value o"


def test_a_misspelt_step_in_an_ordering_is_corrected_when_only_one_can_be_meant(folder: Path) -> None:
    text = MANCHESTER.format(items=STEPS.format(step="Take"), frames=MISSPELT.format(before="Takeee"))
    found = fixed(folder, text, name="r.omn")
    assert codes(found) == ["R010"]
    assert compiled(folder, found)[1] == []


def test_a_sub_action_is_renamed_only_when_that_is_accepted(folder: Path) -> None:
    text = MANCHESTER.format(items=STEPS.format(step="Fetch"), frames=MISSPELT.format(before="Take"))
    found = fixed(folder, text, name="r.omn")
    assert (found.done, found.after) == ((), found.before)
    assert [fix.message for fix in found.unaccepted] == ["the sub-action `Fetch` of `Serve` becomes `Take`"]
    found = fixed(folder, text, "R010", name="r.omn")
    assert codes(found) == ["R010"]
    assert compiled(folder, found)[1] == []


def test_terms_in_the_wrong_namespace_are_corrected_everywhere(folder: Path) -> None:
    text = XML.format(prefix=KNOWROB_PREFIX, items=FLAT, frames="").replace("rdfs:subClassOf", "owl:subClassOf")
    found = fixed(folder, text, "R042")
    assert "O012" in codes(found)
    assert "owl:subClassOf" not in found.after
    assert compiled(folder, found)[1] == []


def test_what_an_imported_file_states_is_not_fixed(folder: Path) -> None:
    steps = "knowrob:subAction some Give, knowrob:subAction some Take"
    base = MANCHESTER.format(items=steps, frames="").replace("test>", "base>")
    (folder / "base.omn").write_text(base, encoding="utf-8")
    text = base[: base.index("Class:")].replace("base>", "test>\n    Import: <http://planlang.org/base>")
    found = fixed(folder, text + "Class: Mine\n    SubClassOf: Serve\n", "R042", name="r.omn")
    assert found.after == found.before


def test_a_recipe_without_mistakes_and_one_that_cannot_be_read_are_left_alone(folder: Path) -> None:
    done = fixed(folder, MANCHESTER.format(items="knowrob:subAction some Take", frames=""), name="r.omn")
    assert (done.done, done.unaccepted, done.impossible, done.after) == ((), (), (), done.before)
    with pytest.raises(BadInput) as caught:
        fixed(folder, "Class: {", name="bad.omn")
    assert {one.span.file for one in caught.value.diagnostics if one.span} == {str(folder / "bad.omn")}


def test_names_that_are_hostile_do_not_get_out_of_their_place(folder: Path) -> None:
    text = XML.format(prefix=KNOWROB_PREFIX, items=FLAT, frames="")
    hostile = "T&quot;/&gt;&lt;owl:x&amp;"
    text = text.replace('"#Take"', f'"#{hostile}"').replace('rdf:ID="Take"', f'rdf:about="#{hostile}"')
    found = fixed(folder, text, "R042")
    assert "<owl:x" not in found.after
    assert found.after.count(hostile) in (2, 3)


def test_the_real_recipe_with_a_misnamed_step_compiles_when_that_is_accepted(corpus: Path, folder: Path) -> None:
    path = corpus / "recipes" / "serve_drink@re_stack.owl"
    assert [fix.code for fix in fix_recipe(path).done] == ["O012", "O042"]
    found = fix_recipe(path, accepted=frozenset({"R010"}))
    assert sorted(codes(found)) == ["O012", "O042", "R010"]
    source, _ = compiled(folder, found)
    assert "async def grasp_bottle" in source
    assert len([line for line in difference(*found.changed) if " some " not in line and " value " not in line]) < 10


def test_the_real_recipe_with_exchanged_fillers_compiles_to_the_same_plan_without_the_note(
    corpus: Path, folder: Path
) -> None:
    path = corpus / "recipes" / "serve_drink@knowrob_hydro_2014-11.owl"
    found = fix_recipe(path)
    assert sorted(codes(found)) == ["O012", "O042", "R030"]
    source, said = compiled(folder, found)
    assert not {"O012", "O042", "R030"} & set(said)
    assert functions(source) == functions(compile_recipe(path).source)


def functions(source: str) -> str:
    """A plan's source behind its header."""
    return source[source.index("@plan") :]


DIAGNOSTICS = Path(__file__).parents[2] / "diagnostics"


OTHERWISE = {"R036_hand_without_place": "R038"}
"""Files of which something else is fixed than what they are named for."""

IN_XML = ("R034_only_individual", "R039_unused", "R051_unlisted_state",
          "R013_repeated_ordering", "R024_repeated_step", "R033_undefined_filler", "R049_class_unknown",
          "R057_orders_of_states", "R058_declared_property", "R058_misspelt_names", "R058_misspelt_outcomes",
          "R058_misspelt_words", "O042_some_individual", "O043_value_class")  # fmt: skip


@pytest.mark.parametrize(
    ("name", "syntax"),
    some(
        [
            *(
                (name, Target.MANCHESTER)
                for name in (
                    *("R010_ordered_stranger", "R011_incomplete_ordering", "R014_redundant_ordering"),
                    *("R020_undefined_step", "R036_hand_without_place", "R040_unordered_base_motions", "R045_one_head"),
                    *("R046_undefined_capability", "R050_misnamed_state"),
                    *IN_XML,
                )
            ),
            *((name, Target.RDFXML) for name in IN_XML),
        ]
    ),
)
def test_what_is_fixed_is_not_said_again_and_nothing_gets_worse(folder: Path, name: str, syntax: Target) -> None:
    path = DIAGNOSTICS / f"{name}.omn"
    code = OTHERWISE.get(name, name[:4])
    text = path.read_text(encoding="utf-8")
    before = [(one[0], one[1]) for one in re.findall(r"# (?:expect )?([A-Z]\d+) ?(error|warning|note|) at line", text)]
    found = fixed(folder, text if syntax is Target.MANCHESTER else convert(path, syntax).text, *ACCEPTABLE)
    assert code in codes(found)
    after = said(folder, found.after)
    assert [one for one, _ in after].count(code) < [one for one, _ in before].count(code)
    assert {one for one in after if one[1] == "error"} <= {*before, ("R001", "error")}


def said(folder: Path, text: str) -> list[tuple[str, str]]:
    """Return what there is to say about a text: codes and severities."""
    path = folder / "said.owl"
    path.write_text(text, encoding="utf-8")
    try:
        diagnostics = compile_recipe(path).diagnostics
    except BadInput as problem:
        diagnostics = problem.diagnostics
    return [(one.code, one.severity.value) for one in diagnostics]


def test_redundant_and_repeated_orderings_change_nothing_of_the_plan(folder: Path) -> None:
    for name in ("R014_redundant_ordering", "R024_repeated_step"):
        path = DIAGNOSTICS / f"{name}.omn"
        found = fixed(folder, path.read_text(encoding="utf-8"), name=f"{name}.omn")
        assert functions(compiled(folder, found)[0]) == functions(compile_recipe(path).source)


def test_a_name_that_is_like_two_others_is_not_guessed(folder: Path) -> None:
    text = MANCHESTER.format(items=STEPS.format(step="Take"), frames=MISSPELT.format(before="Take"))
    text += "    , knowrob:objectActedOn value cup\n"
    text += "Individual: cup1 Types: knowrob:Cup\nIndividual: cup2 Types: knowrob:Cup\n"
    found = fixed(folder, text, name="r.omn")
    assert found.done == ()
    assert [fix.code for fix in found.unaccepted] == ["R033", "R039", "R039"], "and the cups are not used"


def test_a_relation_without_its_ending_is_completed_if_that_is_accepted(folder: Path) -> None:
    text = MANCHESTER.format(items=STEPS.format(step="Take"), frames=MISSPELT.format(before="Take"))
    text += "    , knowrob:objectActedOn value cup, knowrob:toLocation value there\n"
    text += (
        "Individual: cup Types: knowrob:Cup\nIndividual: there Types: knowrob:Point3D Facts: knowrob:inFrontOf cup\n"
    )
    assert [fix.message for fix in fixed(folder, text, name="r.omn").unaccepted] == [
        "`inFrontOf` becomes `inFrontOf-Generally`"
    ]
    assert "inFrontOf-Generally cup" in fixed(folder, text, "R038", name="r.omn").after


@pytest.mark.parametrize(
    "doctype", some(["<!DOCTYPE rdf:RDF [", "<!DOCTYPE rdf:RDF>", ""], every=3), ids=["entities", "bare", "none"]
)
def test_entities_that_are_known_are_written_out_and_guesses_only_if_that_is_accepted(
    folder: Path, doctype: str
) -> None:
    text = XML.format(prefix="", items=FLAT, frames=CUP.replace("<knowrob:Cup", "<owl:Thing").replace("#Cup", "&pr2;R"))
    whole = '<!DOCTYPE rdf:RDF [<!ENTITY knowrob "http://knowrob.org/kb/knowrob.owl#">]>'
    text = text.replace(whole, doctype + "]>" if "[" in doctype else doctype)
    found = fixed(folder, text)
    assert codes(found) == ["O016"]
    assert "http://knowrob.org/kb/PR2.owl#R" in found.after
    guessed = text.replace('ID="b"', 'about="&log;b"')
    found = fixed(folder, guessed)
    assert (found.done, found.after) == ((), found.before)
    assert [(fix.code, "with a guess: `&log;`" in why) for fix, why in found.impossible] == [("O016", True)]
    assert "O016" in [fix.code for fix in found.unaccepted]
    found = fixed(folder, guessed, "O016", "R042")
    assert codes(found) == ["O016", "O016", "R042"]
    assert "O016" not in compiled(folder, found)[1]


def test_of_a_constraint_without_ends_none_is_suggested_that_the_task_names_already(folder: Path) -> None:
    steps = "knowrob:subAction some Take, knowrob:subAction some Give"
    orders = ", ".join(f"knowrob:orderingConstraints value Serving{number}" for number in (15, 16))
    order = "Facts: knowrob:occursBeforeInOrdering Take, knowrob:occursAfterInOrdering Give"
    path = folder / "r.omn"
    path.write_text(MANCHESTER.format(items=f"{steps}, {orders}", frames=f"Individual: Serving15\n    {order}"))
    with pytest.raises(BadInput) as caught:
        compile_recipe(path)
    (told,) = (one for one in caught.value.diagnostics if one.code == "R011")
    assert told.help == "add occursBeforeInOrdering and occursAfterInOrdering to it"


def test_a_suggestion_is_told_to_machines(folder: Path) -> None:
    path = DIAGNOSTICS / "R058_misspelt_names.omn"
    with pytest.raises(BadInput) as caught:
        compile_recipe(path)
    (told,) = (one.as_json()["suggestion"] for one in caught.value.diagnostics if one.code == "R058")
    base = "http://planlang.org/test#"
    assert told == {"written": f"{base}botle1", "meant": f"{base}bottle1", "is_sure": True}


@pytest.mark.parametrize("syntax", [Target.MANCHESTER, Target.RDFXML])
def test_a_missing_order_of_sub_events_is_written(folder: Path, syntax: Target) -> None:
    text = MANCHESTER.format(items="        knowrob:subEvents some Give, knowrob:subEvents some Take", frames="")
    if syntax is not Target.MANCHESTER:
        (folder / "r.omn").write_text(text, encoding="utf-8")
        text = convert(folder / "r.omn", syntax).text
    found = fixed(folder, text, "R042")
    assert codes(found) == ["R042"]
    source, left = compiled(folder, found)
    assert "R042" not in left
    assert source.index("Take") < source.index("HandingOverAnObject")


def test_the_real_recipe_of_sub_events_gets_the_orders_that_are_missing(corpus: Path, folder: Path) -> None:
    found = fix_recipe(corpus / "recipes" / "GetFromRefrigerator@2010-11.owl", accepted=frozenset({"R042"}))
    assert codes(found).count("R042") == 2
    assert "R042" not in compiled(folder, found)[1]


def test_of_an_order_that_is_missing_in_a_table_of_chunks_it_is_told_that_it_is_not_written(folder: Path) -> None:
    chunks = "Individual: give Types: Give\nIndividual: take Types: Take\n"
    table = "Individual: t Types: knowrob:PurposefulAction Facts: knowrob:subAction give, knowrob:subAction take\n"
    steps = "knowrob:subAction some Take"
    text = MANCHESTER.format(items=steps, frames=table + chunks).replace("Class: Serve\n", "Class: Unused\n", 1)
    text = text.replace(f"        knowrob:PurposefulAction,\n{steps}", "        knowrob:PurposefulAction")
    found = fixed(folder, text, "R042", name="r.omn")
    assert found.done == ()
    ((fix, why),) = found.impossible
    assert (fix.code, "sub-actions are not listed in restrictions" in why) == ("R042", True)


def test_taking_a_thing_for_the_only_individual_of_its_class_changes_nothing_of_the_plan(folder: Path) -> None:
    path = DIAGNOSTICS / "R034_only_individual.omn"
    found = fixed(folder, path.read_text(encoding="utf-8"), "R034", name="r.omn")
    assert changed(found) == [
        "-         knowrob:objectActedOn some knowrob:DrinkingBottle",
        "+         knowrob:objectActedOn value bottle1",
    ]
    assert functions(compiled(folder, found)[0]) == functions(compile_recipe(path).source)


def test_a_state_becomes_a_sub_action_behind_the_last_one(folder: Path) -> None:
    path = DIAGNOSTICS / "R051_unlisted_state.omn"
    found = fixed(folder, path.read_text(encoding="utf-8"), name="r.omn")
    assert "+         knowrob:subAction some Tell," in changed(found)
    assert functions(compiled(folder, found)[0]) == functions(compile_recipe(path).source)


def test_what_nothing_uses_is_taken_out_only_if_that_is_accepted(folder: Path) -> None:
    text = (DIAGNOSTICS / "R039_unused.omn").read_text(encoding="utf-8")
    found = fixed(folder, text, name="r.omn")
    assert (found.done, [fix.code for fix in found.unaccepted]) == ((), ["R039", "R039"])
    found = fixed(folder, text, "R039", name="r.omn")
    assert codes(found) == ["R039"] * 3, "the cup is unused once the place that it was for is gone"
    assert "Individual:" not in found.after
