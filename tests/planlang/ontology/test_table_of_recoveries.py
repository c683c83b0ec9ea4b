"""The tables of docs/guides/recoveries.md are those of ontologies/recovery.omn: running this file writes them."""

from __future__ import annotations

import re
from pathlib import Path

import planlang.failures as failures
from planlang.files import bundled
from planlang.ontology import Ontology, expand, load, shorten

PAGE = Path(__file__).resolve().parents[3] / "docs" / "guides" / "recoveries.md"


def words(ontology: Ontology, individual: str, fact: str) -> str:
    """The values of a property, each as code."""
    return ", ".join(f"`{shorten(str(value))}`" for value in ontology.values(individual, fact))


def noticed(ontology: Ontology, individual: str) -> str:
    """What shows the failures of a recovery, each once."""
    senses = [
        str(one) for failure in ontology.iris(individual, "recoversFailure") for one in senses_of(ontology, failure)
    ]
    return ", ".join(str(ontology.label(one)) for one in dict.fromkeys(senses))


def senses_of(ontology: Ontology, failure: str) -> tuple[str, ...]:
    """What shows a failure: that of its nearest class of which anything is stated."""
    kinds = getattr(failures, shorten(failure)).__mro__
    stated = (ontology.iris(expand(kind.__name__), "noticedBy") for kind in kinds)
    return next(filter(None, stated), ())


def number(ontology: Ontology, individual: str, fact: str) -> float:
    value = ontology.value(individual, fact)
    return value.number() if hasattr(value, "number") else 0.0


def tables() -> dict[str, str]:
    """The tables, by name."""
    ontology = load(bundled("ontologies") / "knowrob.omn")
    rows = ["| Failures | noticed by | of actions | strategy | attempts | ends in |", f"|{6 * '---|'}"]
    for one in sorted(ontology.individuals("Recovery"), key=lambda one: number(ontology, one, "rank")):
        cells = [words(ontology, one, fact) for fact in ("recoversFailure", "recoversAction", "strategy")]
        cells.insert(1, noticed(ontology, one))
        attempts = f"{number(ontology, one, 'attempts'):g}"
        rows.append(f"| {' | '.join([*cells, attempts, words(ontology, one, 'escalatesTo')])} |".replace("|  |", "| |"))
    strategies = [
        f"* `{shorten(one)}`: {ontology.label(one)}." for one in sorted(ontology.individuals("RecoveryStrategy"))
    ]
    return {"recoveries": "\n".join(rows), "strategies": "\n".join(strategies)}


def rewritten(text: str) -> str:
    for name, table in tables().items():
        begin, end = f"<!-- begin of the table of {name} -->\n", f"<!-- end of the table of {name} -->"
        text = re.sub(f"(?s){begin}.*?{end}", lambda _, whole=f"{begin}{table}\n{end}": whole, text)
    return text


def test_the_page_lists_the_recoveries_and_strategies_that_the_ontology_states() -> None:
    text = PAGE.read_text(encoding="utf-8")
    assert text == rewritten(text), f"run python {Path(__file__).name} to write the tables"


def test_each_failure_that_a_robot_recovers_from_says_what_shows_it() -> None:
    ontology = load(bundled("ontologies") / "knowrob.omn")
    recovered = {one for rule in ontology.individuals("Recovery") for one in ontology.iris(rule, "recoversFailure")}
    assert sorted(one for one in recovered if not senses_of(ontology, one)) == []


if __name__ == "__main__":
    PAGE.write_text(rewritten(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
