"""Add a dialect of recipes: a reader of its own, registered, without a change of planlang.

The made-up dialect is a checklist: an individual whose facts ``hasItem`` name actions that are performed in the order
of the numbers in the labels of the items. What a reader yields are statements; the model, the checks, the fixes and the
compiler follow from those.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import pytest

from planlang.compiler import compile_recipe
from planlang.diagnostics import BadInput
from planlang.ontology import Ontology
from planlang.recipe import readers
from planlang.recipe.model import Dialect, Ordering
from planlang.recipe.readers import Loose, Reader, register
from planlang.recipe.statements import REGISTERED_WORDS, Statements, SubAction, facts

CHECKLIST = Dialect("checklist", "an individual with items, in the order of their labels")


def tasks(ontology: Ontology) -> Iterator[str]:
    """The individuals of the main document that have items."""
    for triple in ontology.using("hasItem"):
        if isinstance(triple.subject, str) and ontology.main(triple.subject):
            yield triple.subject


def read(ontology: Ontology, iri: str) -> Statements | None:
    """The items of a checklist, each before the next; None if the individual has none."""
    items = {str(fact.term): fact.span for fact in facts(ontology, iri, "hasItem")}
    names = sorted(items, key=lambda name: int(ontology.label(name) or 0))
    orderings = tuple(Ordering(before, after, span=items[after]) for before, after in pairwise(names))
    steps = tuple(SubAction(name, (), items[name]) for name in names)
    return Statements(iri, CHECKLIST, steps, orderings) if items else None


READER = Reader(
    tasks,
    read,
    Loose("checked items", ("isChecked",), "hasItem", "give the checklist `hasItem` with each of them"),
    words=("hasItem", "isChecked"),
)

RECIPE = """
Prefix: : <http://planlang.org/test#>
Prefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>
Prefix: rdfs: <http://www.w3.org/2000/01/rdf-schema#>
Ontology: <http://planlang.org/test>

ObjectProperty: hasItem
Individual: tidyUp
    Types: knowrob:PurposefulAction
    Facts: hasItem {first}, hasItem look
Individual: park
    Annotations: rdfs:label "2"
    Types: knowrob:ClosingAGripper
Individual: look
    Annotations: rdfs:label "10"
    Types: knowrob:LookingForSomething
"""


@pytest.fixture(autouse=True)
def checklists(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setattr(readers, "READERS", list(readers.READERS))
    register(READER)
    yield
    REGISTERED_WORDS.clear()


def written(folder: Path, text: str) -> Path:
    path = folder / "tidy.omn"
    path.write_text(text)
    return path


def test_a_recipe_of_the_new_dialect_compiles(tmp_path: Path) -> None:
    plan = compile_recipe(written(tmp_path, RECIPE.format(first="park")))
    assert plan.recipes.main.dialect is CHECKLIST
    performed = [line.split('name="')[1].rstrip('")') for line in plan.source.splitlines() if "await perform(" in line]
    assert performed == ["park", "look"]
    assert [str(one) for one in plan.diagnostics if one.code != "R040"] == []


def test_the_checks_judge_it_like_any_other(tmp_path: Path) -> None:
    with pytest.raises(BadInput) as caught:
        compile_recipe(written(tmp_path, RECIPE.format(first="dance")))
    assert [one.code for one in caught.value.diagnostics] == ["R020"]


def test_parts_without_a_task_are_explained(tmp_path: Path) -> None:
    text = (
        RECIPE.split("Individual: tidyUp")[0] + "DataProperty: isChecked\nIndividual: park\n    Facts: isChecked true\n"
    )
    with pytest.raises(BadInput) as caught:
        compile_recipe(written(tmp_path, text))
    assert [one.code for one in caught.value.diagnostics] == ["R003"]
    assert caught.value.diagnostics[0].message.startswith("this file has checked items, but no task")


def test_a_typo_in_its_words_is_one_error(tmp_path: Path) -> None:
    text = RECIPE.format(first="park").replace("hasItem look", "hasItm look")
    with pytest.raises(BadInput) as caught:
        compile_recipe(written(tmp_path, text))
    assert [(one.code, one.help) for one in caught.value.diagnostics] == [("R058", "did you mean `hasItem`?")]
