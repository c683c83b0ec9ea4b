"""Narratives of runs: everything comes back, whoever reads the RDF; what was recovered can be asked for."""

from __future__ import annotations

import json
from contextlib import suppress
from dataclasses import replace
from datetime import UTC, datetime
from functools import cache
from typing import Any

import hypothesis
import pyoxigraph
import pytest
from cut_runs import completed, cut
from examples import examples
from hypothesis import settings
from hypothesis import strategies as st
from random_trees import Grower, outcome_of
from rdf_graphs import graph_of, read_by_rdflib

from planlang import Recovery, TaskTree, Trace, action, an_object, failures, perform, with_failure_handling
from planlang.diagnostics import BadInput, Span
from planlang.experience import Experience, State, Thing, experience_in, experience_of, narrative, read_narrative
from planlang.experience.narrative import DUL, EXPERIENCE, SOMA
from planlang.experience.poses import transforms_in
from planlang.failures import GraspMissed, ObjectUnfetchable, PlanFailure
from planlang.files import bundled
from planlang.geometry import Pose
from planlang.ontology import Literal, Triple, load
from planlang.ontology.terms import RDF, expand
from planlang.ontology.turtle import read_turtle
from planlang.runs import DamagedTrace, RecordedRun
from planlang.runs.codec import dump, links
from planlang.testing import PlanRun, Script, run_plan
from tests.support.refusals import refusal

BASE = "http://example.org/run"
CUP = an_object("Cup", iri="http://example.org/room#cup1")


def there_and_back(experience: Experience) -> Experience:
    return read_narrative(narrative(experience, BASE), "narrative.ttl")


def trace_of(source: bytes) -> list[dict[str, Any]]:
    tree = Grower(source).tree()
    trace = Trace()
    fluents = 1 + max([part.number for part in tree.walk() if part.kind == "fluent"], default=0)
    with suppress(Exception):
        outcome_of(tree, [True] * fluents, trace=trace)
    return trace.events


@settings(max_examples=examples(500), deadline=None)
@hypothesis.given(st.binary(min_size=24, max_size=80), st.floats(0, 1))
@pytest.mark.filterwarnings("ignore::planlang.kernel.errors.CutShort")
def test_a_random_run_comes_back_from_its_narrative_whole_and_cut_off(source: bytes, share: float) -> None:
    events = trace_of(source)
    for some in (events, events[: max(1, round(share * len(events)))]):
        told = experience_of(some)
        assert there_and_back(told) == told
        assert told.is_whole == any(one["event"] == "ended" and one["parent"] is None for one in some)
        nodes = {str(node.path): node for node in TaskTree.of(some)}
        paths: dict[int, str] = {}
        for one in told.activities:
            path = paths[one.number] = one.name if one.parent is None else f"{paths[one.parent]}/{one.name}"
            node = nodes.pop(path)
            assert (one.kind, one.state.value, one.parameters) == (node.kind, node.status, node.parameters)
            assert (one.begin, one.end, one.result) == (node.start, node.end, node.result)  # a step is a second here
            assert (one.failure is None) == (node.failure is None)
            told = [] if one.failure is None else [link.message for link in one.failure.chain()]
            assert told == [link["message"] for link in links(node.failure)]
        assert nodes == {}


async def fetch() -> None:
    async def grasp() -> None:
        try:
            await perform(action("GraspingSomething", object_acted_on=CUP))
        except GraspMissed as missed:
            raise ObjectUnfetchable(what="cup1") from missed

    await with_failure_handling(grasp, Recovery(ObjectUnfetchable, retries=2))


@cache
def recovered_events() -> list[dict[str, Any]]:
    run = run_plan(
        fetch, script=Script().on("GraspingSomething", fails=GraspMissed, times=1, after=1.0), resumable=True
    )
    assert run.failure is None
    header, *rest = run.events
    return [{**header, "parameters": {"cup": dump(CUP)}, "robot": "amigo"}, *rest]  # as planlang run writes them


def recovered_run() -> Experience:
    return experience_of(recovered_events())


def test_a_recovered_run_tells_participants_roles_resolutions_and_the_chain_of_causes() -> None:
    run = recovered_run()
    assert there_and_back(run) == run
    first = next(one for one in run.activities if one.kind == "perform")
    assert first.state is State.FAILED
    assert [(role.property, role.filler) for role in first.roles] == [("objectActedOn", "cup1")]
    assert first.participants == ("cup1",)
    assert run.things == (Thing("cup1", "Object", "Cup", "http://example.org/room#cup1"),)
    assert [(one.designator.text, one.to.value) for one in first.resolutions] == [
        ("GraspingSomething(object_acted_on=cup1)", "process module")
    ]
    decided = [one for node in run.activities for one in node.occurrences if one.event == "recovery"]
    assert [
        (one.details["decision"], [link.type for link in one.failure.chain()]) for one in decided if one.failure
    ] == [("retry", ["ObjectUnfetchable", "GraspMissed"])]
    assert {failure.type for _, failure in run.recovered()} == {"GraspMissed", "ObjectUnfetchable"}
    assert {survivor.kind for survivor, _ in run.recovered()} == {"with_failure_handling"}


def test_a_run_that_was_killed_and_resumed_tells_what_one_tells_that_was_not() -> None:
    async def twice() -> None:
        await with_failure_handling(fetch)
        await with_failure_handling(fetch)

    def ran(past: RecordedRun | None = None) -> PlanRun[Any]:
        script = Script().on("GraspingSomething", after=1.0)
        return run_plan(twice, script=script, resumable=True, resume=past)

    whole = ran()
    resumed = ran(cut(whole, completed(whole)[0] + 3))
    assert any(one["event"] == "resumed" for one in resumed.events)
    assert experience_of(resumed.events) == experience_of(whole.events)


def test_rdflib_and_pyoxigraph_read_the_same_graph() -> None:
    text = narrative(recovered_run(), BASE)
    ours = read_turtle(text, "narrative.ttl", base=BASE).triples
    assert read_by_rdflib(text, "turtle", BASE) == graph_of(ours)
    quads = list(pyoxigraph.parse(text.encode(), format=pyoxigraph.RdfFormat.TURTLE))
    theirs = [Triple(*(_term(one) for one in quad.triple), Span("theirs")) for quad in quads]  # type: ignore[arg-type]
    assert experience_in(theirs, "theirs") == recovered_run()


def _term(node: Any) -> str | Literal:
    if isinstance(node, pyoxigraph.Literal):
        kind = node.datatype.value
        return Literal(node.value, None if kind.endswith("#string") else kind)
    return str(node.value)


def test_a_narrative_has_the_same_bytes_each_time_and_times_since_it_began() -> None:
    run, began = recovered_run(), datetime(2026, 11, 23, 12, tzinfo=UTC)
    assert narrative(run, BASE) == narrative(there_and_back(run), BASE)
    assert f'soma:hasIntervalBegin "{began.timestamp()!r}"^^xsd:double' in narrative(run, BASE, began)


@settings(max_examples=examples(500), deadline=None)
@hypothesis.given(st.text(), st.text(), st.recursive(st.none() | st.text() | st.floats(allow_nan=False), st.lists))
def test_texts_of_any_characters_come_back(name: str, message: str, result: Any) -> None:
    failure = {"type": name, "message": message, "where": name, "siblings": {message: name}}
    events = [
        {"step": 0, "event": "header", "schema": 5, "plan": name or "p", "rate": 30, "robot": message},
        {"step": 0, "event": "started", "node": 1, "parent": None, "kind": name, "name": message, "action": message},
        {"step": 7, "event": "ended", "node": 1, "status": "failed", "result": result, "failure": failure},
    ]
    told = experience_of(json.loads(json.dumps(events)))
    assert there_and_back(told) == told
    text = narrative(told, BASE)
    assert read_by_rdflib(text, "turtle", BASE) == graph_of(read_turtle(text, "narrative.ttl", base=BASE).triples)


def test_which_designators_ran_and_what_they_were_resolved_to_is_one_question_in_sparql() -> None:
    store = pyoxigraph.Store()
    store.load(narrative(recovered_run(), BASE).encode(), format=pyoxigraph.RdfFormat.TURTLE)
    question = """
        PREFIX experience: <http://planlang.org/kb/experience.owl#>
        PREFIX soma: <http://www.ease-crc.org/ont/SOMA.owl#>
        SELECT ?designator ?value ?state WHERE {
            ?action experience:hasResolution ?resolution ; soma:hasExecutionState ?state .
            ?resolution experience:resolves/experience:text ?designator .
            ?resolution experience:value ?value ; experience:atStep ?step
        } ORDER BY ?step"""
    rows = [[one.value.rpartition("#")[2] for one in row] for row in store.query(question)]  # type: ignore[union-attr]
    wanted, module = "GraspingSomething(object_acted_on=cup1)", "rule of GraspingSomething"
    states = ["ExecutionState_Failed", "ExecutionState_Succeeded"]
    assert rows == [[wanted, module, state] for state in states]


def test_a_designator_without_individual_is_resolved_to_one_of_its_class_under_the_name_of_the_map() -> None:
    bound = [[dump(CUP), "cup1"], [dump(an_object("WipingTool")), "sponge1"]]
    left = {"step": 3, "event": "completed", "node": 1, "left": {"belief": {"bound": bound}}}
    told = experience_of([HEADER, ROOT, left])
    assert there_and_back(told) == told
    store = pyoxigraph.Store()
    store.load(narrative(told, BASE).encode(), format=pyoxigraph.RdfFormat.TURTLE)
    question = """
        PREFIX experience: <http://planlang.org/kb/experience.owl#>
        SELECT ?text ?label ?kind WHERE {
            ?resolution experience:resolves/experience:text ?text ; experience:resolvedTo ?thing .
            ?thing <http://www.w3.org/2000/01/rdf-schema#label> ?label ; a ?kind
        } ORDER BY ?text"""
    rows = [[one.value for one in row] for row in store.query(question)]  # type: ignore[union-attr]
    assert rows == [["WipingTool", "sponge1", expand("WipingTool")], ["cup1", "cup1", expand("Cup")]]


def test_the_class_of_an_action_is_in_the_namespace_of_the_recipe_around_it() -> None:
    mine, library = "http://example.org/mine#Serve", "http://example.org/library#Grasp"
    performed = {"kind": "perform", "classes": ["Reaching"]}
    records: list[dict[str, Any]] = [
        {**HEADER, "iri": mine},
        {**ROOT, "kind": "plan", "iri": mine},
        {**ROOT, **performed, "node": 2, "parent": 1, "name": "Take", "action": "Take(object_acted_on=cup1)"},
        {**ROOT, "kind": "plan", "node": 3, "parent": 2, "name": "grasp", "iri": library},
        {**ROOT, **performed, "node": 4, "parent": 3, "name": "Near", "action": "Near()"},
        {**ROOT, "kind": "perform", "node": 5, "parent": 3, "name": "Look", "action": "LookingForSomething()"},
    ]
    triples = read_turtle(narrative(experience_of(records), BASE), "n.ttl", base=BASE).triples
    kinds = {(str(one.subject), one.object) for one in triples if one.predicate == RDF.type}
    for number, kind in ((2, "http://example.org/mine#Take"), (4, "http://example.org/library#Near")):
        assert {(f"{BASE}#action{number}", kind), (f"{BASE}#action{number}", expand("Reaching"))} <= kinds
    assert (f"{BASE}#action5", expand("LookingForSomething")) in kinds


HEADER = {"step": 0, "event": "header", "schema": 5, "plan": "p", "rate": 30}
ROOT = {"step": 0, "event": "started", "node": 1, "parent": None, "kind": "branch", "name": "p"}


@pytest.mark.parametrize(
    ("records", "line", "reason"),
    [
        ([{**HEADER, "rate": 0}], 1, "rate"),
        ([{**HEADER, "rate": "fast"}], 1, "number"),
        ([HEADER, {**ROOT, "step": 2**70}], 2, "too late"),
        ([HEADER, {**ROOT, "parent": 7}], 2, "has not started"),
        ([HEADER, {**ROOT, "node": -1}], 2, "number"),
        ([HEADER, {**ROOT, "name": 7}], 2, "text"),
        ([HEADER, {"step": 0, "event": "ended", "node": 1, "status": "failed"}], 2, "parent"),
        ([HEADER, ROOT, {**ROOT, "event": "ended", "status": "odd"}], 3, "odd"),
        ([HEADER, ROOT, {**ROOT, "event": "ended", "status": "failed", "failure": []}], 3, "failure"),
        ([HEADER, ROOT, {"step": 0, "event": "request", "node": 1}], 3, "module"),
    ],
)
def test_a_damaged_trace_is_refused_with_its_line(records: list[dict[str, Any]], line: int, reason: str) -> None:
    with pytest.raises(DamagedTrace, match=reason) as refused:
        experience_of(records)
    assert refused.value.line == line


ANYTHING = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=5,
)


@settings(max_examples=examples(1000), deadline=None)
@hypothesis.given(st.data())
def test_a_trace_with_anything_in_the_place_of_something_is_told_or_refused(data: st.DataObject) -> None:
    records = json.loads(json.dumps(recovered_events()))
    for _ in range(data.draw(st.integers(1, 3))):
        spot = records
        while True:
            keys = list(spot) if isinstance(spot, dict) else list(range(len(spot)))
            key = data.draw(st.sampled_from(keys))
            if not isinstance(spot[key], dict | list) or not spot[key] or data.draw(st.integers(0, 3)) == 0:
                break
            spot = spot[key]
        spot[key] = data.draw(ANYTHING)
    try:
        told = experience_of(records)
    except DamagedTrace:
        return
    assert there_and_back(told) == told
    assert all(len(one.position) == 3 for one in transforms_in(records))


def test_a_chain_of_causes_and_a_nesting_without_end_are_refused() -> None:
    failure: dict[str, Any] = {"type": "A", "message": "a"}
    deep: list[Any] = []
    for _ in range(300):
        failure, deep = {"type": "A", "message": "a", "cause": failure}, [deep]
    for more in ({"failure": failure}, {"result": deep}):
        with pytest.raises(DamagedTrace, match="more than"):
            experience_of([HEADER, ROOT, {**ROOT, "event": "ended", "status": "failed", **more}])


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ("a soma:Episode", "a soma:Other", "soma:Episode"),
        ("dul:hasConstituent :action2", "dul:hasConstituent :action1", "parent"),
        ('experience:number "2"^^xsd:integer', 'experience:number "1"^^xsd:integer', "twice"),
        ('experience:number "2"^^xsd:integer', 'experience:number "two"', "whole number"),
        ("soma:hasExecutionState soma:ExecutionState_Succeeded", "soma:hasExecutionState soma:Fine", "state"),
        ("experience:hasCause :failure2", "experience:hasCause :failure1", "causes"),
        ('experience:parameters "{', 'experience:parameters "{{', "JSON"),
        ("dul:executesTask :task1 ;", "", "executesTask"),
    ],
)
def test_a_narrative_that_contradicts_itself_is_refused(old: str, new: str, reason: str) -> None:
    text = narrative(recovered_run(), BASE)
    assert old in text
    with refusal("K080", naming=reason) as refused:
        read_narrative(text.replace(old, new), "narrative.ttl")
    assert {one.code for one in refused.value.diagnostics} == {"K080"}


@settings(max_examples=examples(1000), deadline=None)
@hypothesis.given(st.data())
def test_a_graph_with_statements_taken_out_and_put_together_anew_is_told_or_refused(data: st.DataObject) -> None:
    triples = list(read_turtle(narrative(recovered_run(), BASE), "n.ttl", base=BASE).triples)
    for _ in range(data.draw(st.integers(1, 4))):
        place, other = (data.draw(st.integers(0, len(triples) - 1)) for _ in range(2))
        one, another = triples[place], triples[other]
        made = data.draw(st.sampled_from(("none", "subject", "predicate", "object", "text")))
        if made == "none":
            del triples[place]
        else:
            value = Literal(data.draw(st.text(max_size=3))) if made == "text" else getattr(another, made)
            triples[place] = replace(one, **{"object" if made == "text" else made: value})
    try:
        told = experience_in(triples, "n.ttl")
    except BadInput as problem:
        hypothesis.event(problem.diagnostics[0].code)
        return
    assert isinstance(narrative(told, BASE), str)


@pytest.mark.parametrize("rate", ["0", "-1.0", "1e300"])
def test_a_narrative_whose_rate_is_none_is_refused(rate: str) -> None:
    triples = read_turtle(narrative(recovered_run(), BASE), "n.ttl", base=BASE).triples
    broken = [replace(one, object=Literal(rate)) if one.predicate.endswith("#rate") else one for one in triples]
    with refusal("K080"):
        experience_in(broken, "n.ttl")


def test_the_vocabulary_has_all_failures_of_the_plan_language_below_each_other_as_there() -> None:
    words = load(bundled("ontologies") / "experience.omn")
    kinds = [one for one in vars(failures).values() if isinstance(one, type) and issubclass(one, PlanFailure)]
    for kind in kinds:
        above = {one.__name__ for one in kind.__mro__ if issubclass(one, PlanFailure)} - {kind.__name__}
        assert all(words.is_a(kind.__name__, one) for one in above), f"ontologies/experience.omn lacks {kind}"
        assert words.is_a(kind.__name__, "FailureOfAPlan")


def test_each_term_of_a_narrative_is_stated_in_the_vocabulary_or_called_as_one_of_knowrob() -> None:
    words = load(bundled("ontologies") / "experience.omn")
    for space in (DUL, SOMA, EXPERIENCE):
        lacking = {one for one in space.terms if not words.defined(space + one) and not words.is_property(space + one)}
        assert lacking <= {"Action", "Agent", "InformationObject", "TimeInterval", "json"}


def test_what_is_believed_to_have_moved_where_a_step_completes_is_told_what_is_held_in_the_frame_of_its_hand() -> None:
    place, offset = dump(Pose((1.0, 2.0, 0.5))), dump(Pose((0.0, 0.0, 0.1)))
    belief = {"poses": {"cup1": place, "cup2": place}, "held": {"cup2": [[["right", "hand_link", offset]], place, []]}}
    left = {"belief": belief, "base": [1.0, 0.0, 0.0]}
    records = [HEADER, {"step": 9, "event": "completed", "node": 1, "left": left}]
    found = {(one.child, one.frame): (one.step, one.position, one.by) for one in transforms_in(records)}
    assert found == {
        ("base", "map"): (9, (1.0, 0.0, 0.0), "world"),
        ("cup1", "map"): (9, (1.0, 2.0, 0.5), "belief"),
        ("cup2", "hand_link"): (9, (0.0, 0.0, 0.1), "belief"),
    }
