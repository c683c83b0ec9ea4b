"""The task tree of a run, and its exports."""

from __future__ import annotations

import json
import re
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import hypothesis
import pytest
from hypothesis import settings
from hypothesis import strategies as st

from planlang import *
from planlang.failures import BranchEvaporated, GraspMissed
from planlang.testing import Script, run_plan
from tests.support.examples import examples


async def grasp() -> None:
    await sleep(1)
    raise GraspMissed(arm="left")


@plan("http://example.org/r#Serve")
async def serve(*, cup: str) -> str:
    await pursue(partial(sleep, 9), fast=partial(sleep, 2))
    await try_all(partial(tag, "grasp", grasp), partial(sleep, 3))
    return cup


def tree_of(body: Any, **options: Any) -> TaskTree:
    trace = Trace()
    with suppress(PlanFailure):
        run(body, host=VirtualHost(), trace=trace, **options)
    return TaskTree.of(trace)


def test_a_node_keeps_path_kind_parameters_status_result_start_and_end() -> None:
    tree = tree_of(partial(serve, cup="blue"))
    root = tree.roots[0]
    assert (root.name, root.kind, root.parent) == ("serve", "plan", None)
    assert root.parameters == {"iri": "http://example.org/r#Serve", "parameters": {"cup": "blue"}}
    assert (root.status, root.result, root.start, root.end, root.reason) == ("succeeded", "blue", 0, 5, "")
    assert [child.name for child in root.children] == ["pursue", "try_all"]
    assert [(n.name, n.status, n.end) for n in root.children[0].children] == [
        ("sleep", "evaporated", 2),
        ("fast", "succeeded", 2),
    ]


def test_a_tree_is_printed_with_times_and_each_failure_where_it_arose() -> None:
    async def never() -> None:
        await sleep(9)

    async def fails() -> None:
        closing = partial(perform, action("ClosingAGripper"), name="Close")
        reaching = partial(perform, action("Reaching", x=1.0))
        await seq(reaching, partial(try_in_order, closing, grasp))

    async def main() -> None:
        handle = task("never")
        evaporate(handle)
        with suppress(BranchEvaporated):
            await par(partial(tag, "never", never))
        await fails()

    script = Script().on("Close", fails=lambda: GraspMissed("x" * 99), after=0.5)
    run = run_plan(main, script=script)
    tree = TaskTree.of(run.trace)
    assert str(tree) == run.tree()
    lines = str(tree).splitlines()
    assert lines[:6] == [
        "main: 0 to 2.5 s, failed",
        "  par: 0 s, failed",
        "    tag: 0 s, failed with BranchEvaporated: a branch was evaporated from outside: path main/par/tag/never",
        "      never: evaporated before it began",
        "  seq: 0 to 2.5 s, failed",
        "    perform: 0 to 1 s, succeeded",
    ]
    assert "      Reaching(x=1.0): 0 to 1 s, succeeded" in lines
    assert f"          Close, ClosingAGripper(): 1 to 1.5 s, failed with GraspMissed: {'x' * 99}" in lines
    assert lines[-1] == "        grasp: 1.5 to 2.5 s, failed with GraspMissed: the gripper closed on nothing: left arm"
    (closed,) = [node for node in tree if node.name == "Close" and node.kind == "perform"]
    assert closed.summary(10) == "1 to 1.5 s, failed with GraspMissed: xxxxxxx..."
    cut = TaskTree.of([event for event in run.events if event["event"] != "ended"])
    assert str(cut).splitlines()[0] == "main: 0 s on, running"


def test_constructs_keep_their_results_too() -> None:
    async def word() -> str:
        return "word"

    constructs: list[Any] = [
        partial(seq, word),
        partial(par, word),
        partial(pursue, word),
        partial(race, word),
        partial(try_all, word),
        partial(try_in_order, word),
        partial(timeout, 1, word),
    ]
    tree = tree_of(partial(par, *constructs))
    results = [child.children[0].result for child in tree.roots[0].children[0].children]
    assert results == [["word"], ["word"], "word", ["word", "word"], "word", "word", "word"]


def test_a_failed_node_keeps_its_failure_and_says_it() -> None:
    node = tree_of(partial(serve, cup="blue")).nodes["serve/try_all/tag/grasp"]
    assert (node.status, node.kind) == ("failed", "tag")
    assert node.failure is not None
    assert node.failure["type"] == "GraspMissed"
    assert node.reason == "GraspMissed: the gripper closed on nothing: left arm"


def test_states_and_performs_are_nodes_too(executive: Any, module: Any) -> None:
    async def look(wanted: Action) -> str:
        return "found"

    executive.extra.append(module("eyes", ("LookingForSomething",), look))
    states = {"look": partial(perform, action("LookingForSomething")), "end": partial(seq)}
    machine = partial(state_machine, states, {("look", "found"): "end"}, "look", "end")
    tree = tree_of(machine, executive=executive)
    kinds = {node.path.removeprefix("state_machine/state_machine/"): node.kind for node in tree}
    assert kinds["look"] == "state"
    assert kinds["look/LookingForSomething"] == "perform"
    assert tree.nodes["state_machine/state_machine/look/LookingForSomething"].parameters == {
        "action": "LookingForSomething()"
    }


def test_a_task_that_never_began_has_no_start() -> None:
    async def body() -> None:
        evaporate(task("never"))
        await tag("never", partial(sleep, 1))

    node = tree_of(body).nodes["body/never"]
    assert (node.status, node.start, node.end) == ("evaporated", None, 0)
    trace = Trace()
    run(partial(pursue, partial(sleep, 0)), host=VirtualHost(), trace=trace)
    late = {"node": 9, "parent": 2, "kind": "branch", "name": "late", "status": "evaporated"}
    trace.events.append({"step": 0, "event": "ended", **late})
    assert "late\\nevaporated, never begun" in TaskTree.of(trace.events).dot()


def test_json_lines_have_one_object_per_node_parents_first_with_keys_in_a_fixed_order() -> None:
    lines = [json.loads(line) for line in tree_of(partial(serve, cup="blue")).json_lines().splitlines()]
    assert list(lines[0]) == ["path", "parent", "kind", "name", "status", "start", "end", "parameters", "result"]
    assert lines[1] == {
        "path": "serve/pursue",
        "parent": "serve",
        "kind": "pursue",
        "name": "pursue",
        "status": "succeeded",
        "start": 0.0,
        "end": 2.0,
    }
    seen: set[str | None] = {None}
    for line in lines:
        assert line["parent"] in seen
        seen.add(line["path"])


async def odd() -> None:
    raise PlanFailure('a "quoted" \\ message\nin two lines; with <b>, #35; & ]')


def test_dot_quotes_what_would_end_a_label() -> None:
    text = tree_of(partial(par, odd)).dot()
    assert text.startswith("digraph plan {")
    assert (
        r'label="odd\nfailed 0-0 s\nPlanFailure: a \"quoted\" \\ message\nin two lines; with <b>, #35; &amp; ]"' in text
    )
    assert "  n0 -> n1;\n  n1 -> n2;\n}\n" in text


def test_mermaid_writes_signs_with_a_meaning_as_entities() -> None:
    text = tree_of(partial(par, odd)).mermaid()
    assert text.startswith("flowchart TD\n")
    assert (
        'n2["odd<br/>failed 0-0 s<br/>PlanFailure: a #34;quoted#34; #92; message<br/>'
        'in two lines#59; with #60;b#62;, #35;35#59; #38; #93;"]:::failed' in text
    )
    assert "  n0 --> n1\n  n1 --> n2\n" in text


def test_a_name_with_a_slash_does_not_make_a_new_level() -> None:
    tree = tree_of(partial(tag, "left/right", partial(par, partial(sleep, 1))))
    assert [node.name for node in tree] == ["tag", "left/right", "par", "sleep"]


def test_a_trace_file_is_read_and_a_line_cut_off_at_its_end_left_out(tmp_path: Path) -> None:
    target = tmp_path / "run.jsonl"
    with Trace.at(target) as trace:
        run(partial(serve, cup="blue"), host=VirtualHost(), trace=trace)
    assert TaskTree.read(target).json_lines() == tree_of(partial(serve, cup="blue")).json_lines()
    target.write_text(target.read_text()[:-20])
    assert TaskTree.read(target).roots[0].status == "running"
    assert TaskTree.read(target).roots[0].end is None
    assert "running 0- s" in TaskTree.read(target).dot()


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("no trace\n", "not JSON"),
        ('{"step": 0}\n', "not a record of a trace"),
        ('{"event": "x"}\n', "not a record of a trace"),
        ("[1]\n", "not a record of a trace"),
    ],
)
def test_what_is_no_trace_is_refused_with_file_and_line(tmp_path: Path, text: str, problem: str) -> None:
    target = tmp_path / "odd.jsonl"
    target.write_text(text)
    with pytest.raises(ValueError, match=rf"odd\.jsonl:1: {problem}"):
        TaskTree.read(target)


def test_a_trace_without_records_says_how_to_read_its_file(tmp_path: Path) -> None:
    with Trace.at(tmp_path / "run.jsonl") as trace:
        run(partial(sleep, 1), host=VirtualHost(), trace=trace)
        with pytest.raises(ValueError, match=r"wrong(.|\n)*right: TaskTree\.read"):
            TaskTree.of(trace)


def branches(depth: int) -> st.SearchStrategy[Any]:
    leaf = st.one_of(st.integers(0, 3).map(lambda seconds: partial(sleep, seconds)), st.just(grasp))
    if not depth:
        return leaf
    inner = branches(depth - 1)
    constructs = st.sampled_from([par, pursue, try_all, try_in_order, seq])
    return st.one_of(leaf, st.builds(lambda c, b: partial(c, *b), constructs, st.lists(inner, max_size=3)))


@settings(max_examples=examples(150), deadline=None)
@hypothesis.given(body=branches(3), schedule=st.one_of(st.none(), st.integers(0, 99)))
def test_every_node_ends_with_status_start_and_end_within_its_parent_and_is_in_all_exports(
    body: Any, schedule: int | None
) -> None:
    tree = tree_of(partial(par, body), schedule=schedule)
    assert len(list(tree)) == len(tree.nodes) == len(tree.json_lines().splitlines())
    for node in tree:
        assert node.status in ("succeeded", "failed", "evaporated")
        assert node.end is not None
        assert (node.failure is not None) == (node.status == "failed")
        if node.start is None:
            assert node.status == "evaporated"
            continue
        assert node.start <= node.end
        if node.parent is not None:
            assert node.parent.start is not None
            assert node.parent.end is not None
            assert node.parent.start <= node.start <= node.end <= node.parent.end
    for text, arrow in ((tree.dot(), " -> "), (tree.mermaid(), " --> ")):
        assert len(re.findall(r"^  n\d+\s?\[", text, re.M)) == len(tree.nodes)
        assert text.count(arrow) == len(tree.nodes) - 1
