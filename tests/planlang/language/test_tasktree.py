"""The task tree of a run, its exports, and which task a name stands for before and after it has run."""

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
from virtual_time import go

from planlang import *
from planlang.failures import BranchEvaporated, GraspMissed
from planlang.testing import Script, run_plan


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
    assert lines[-1] == "        grasp: 1.5 to 2.5 s, failed with GraspMissed: the gripper closed on nothing: arm left"
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
    assert node.reason == "GraspMissed: the gripper closed on nothing: arm left"


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
    raise PlanFailure('a "quoted" \\ message\nin two lines; with <b>, #35; and ]')


def test_dot_quotes_what_would_end_a_label() -> None:
    text = tree_of(partial(par, odd)).dot()
    assert text.startswith("digraph plan {")
    assert (
        r'label="odd\nfailed 0-0 s\nPlanFailure: a \"quoted\" \\ message\nin two lines; with <b>, #35; and ]"' in text
    )
    assert "  n0 -> n1;\n  n1 -> n2;\n}\n" in text


def test_mermaid_writes_signs_with_a_meaning_as_entities() -> None:
    text = tree_of(partial(par, odd)).mermaid()
    assert text.startswith("flowchart TD\n")
    assert (
        'n2["odd<br>failed 0-0 s<br>PlanFailure: a #34;quoted#34; #92; message<br>'
        'in two lines#59; with #60;b#62;, #35;35#59; and #93;"]:::failed' in text
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
        ("no trace\n", "no JSON"),
        ('{"step": 0}\n', "no record of a trace"),
        ('{"event": "x"}\n', "no record of a trace"),
        ("[1]\n", "no record of a trace"),
    ],
)
def test_what_is_no_trace_is_refused_with_file_and_line(tmp_path: Path, text: str, problem: str) -> None:
    target = tmp_path / "odd.jsonl"
    target.write_text(text)
    with pytest.raises(ValueError, match=rf"odd\.jsonl:1: this is {problem}"):
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


@settings(max_examples=150, deadline=None)
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


def test_a_name_asked_for_in_an_inner_plan_before_it_has_run_stands_for_the_outer_plans_task() -> None:
    @plan
    async def watcher() -> float:
        handle = task("drive")
        assert (handle.path, handle.status.value) == (None, Status.CREATED)
        await join(handle)
        assert handle.path == "body/par/later/drive"
        return now()

    async def later() -> None:
        await sleep(1)
        await tag("drive", partial(sleep, 2))

    async def body() -> float:
        return (await par(watcher, later))[0]

    assert go(body) == 3


def test_of_two_plans_that_tag_the_same_name_the_nearest_enclosing_one_is_meant() -> None:
    seen: list[str | None] = []

    @plan
    async def inner() -> None:
        async def look() -> None:
            await sleep(0.1)
            seen.append(task("same").path)

        await par(partial(tag, "same", partial(sleep, 1)), look)

    async def body() -> None:
        await par(partial(tag, "same", partial(sleep, 1)), inner)
        seen.append(task("same").path)

    go(body)
    assert seen == ["body/par/inner/par/tag/same", "body/par/tag/same"]


def test_a_handle_bound_to_an_outer_task_is_rebound_by_the_inner_plans_own_tag() -> None:
    @plan
    async def inner() -> tuple[str | None, str | None]:
        handle = task("same")
        await sleep(1)
        before = handle.path
        await tag("same", partial(sleep, 0.1))
        return before, handle.path

    async def body() -> Any:
        async def later() -> None:
            await sleep(0.5)
            await tag("same", partial(sleep, 5))

        return (await par(inner, later))[0]

    assert go(body) == ("body/par/later/same", "body/par/inner/same")


def test_all_who_asked_see_the_status_of_the_task() -> None:
    @plan
    async def watcher() -> float:
        await join(task("drive"))
        return now()

    async def body() -> Any:
        async def later() -> None:
            await sleep(1)
            await tag("drive", partial(sleep, 1))

        own = task("drive")
        return [*(await par(watcher, watcher, later, lambda: join(own)))[:2], own.status.value]

    assert go(body) == [2, 2, Status.SUCCEEDED]


def test_suspending_a_task_that_nobody_has_tagged_yet_holds_it_from_its_beginning() -> None:
    @plan
    async def controller() -> None:
        handle = task("drive")
        suspend(handle)
        await sleep(3)
        wake_up(handle)

    async def body() -> float:
        async def later() -> None:
            await sleep(1)
            await tag("drive", partial(sleep, 0))

        await par(controller, later)
        return now()

    assert go(body) == 3


def test_a_task_evaporated_before_it_is_tagged_never_begins() -> None:
    begun: list[str] = []

    async def drive() -> None:
        begun.append("drive")

    async def body() -> Status:
        handle = task("drive")
        assert evaporate(handle)
        assert not evaporate(handle)
        assert not suspend(handle)
        with pytest.raises(BranchEvaporated):
            await tag("drive", drive)
        return handle.status.value

    assert go(body) is Status.EVAPORATED
    assert begun == []


def test_what_an_ended_plan_asked_for_is_forgotten() -> None:
    @plan
    async def asks() -> Handle:
        return task("later")

    async def body() -> str | None:
        handle = await asks()
        await tag("later", partial(sleep, 0))
        return handle.path

    assert go(body) is None


def test_join_raises_the_programming_error_of_the_task() -> None:
    async def broken() -> None:
        await sleep(1)
        raise KeyError("broken")

    seen: list[str] = []

    async def body() -> None:
        async def joins() -> None:
            try:
                await join(task("broken"))
            except KeyError:
                seen.append("key error")
                raise

        await par(partial(tag, "broken", broken), joins)

    with pytest.raises(KeyError, match="broken"):
        go(body)


def test_task_suspended_wakes_only_what_it_has_suspended() -> None:
    async def body() -> float:
        handle = task("worker")

        async def worker() -> None:
            for _ in range(2):
                await try_all(partial(tag, "worker", partial(sleep, 1)), partial(sleep, 5))

        async def control() -> None:
            await sleep(0.5)
            async with task_suspended(handle):
                await sleep(1)
                evaporate(handle)
            await sleep(6)

        await par(worker, control)
        return now()

    assert go(body) == 7.5


def test_two_live_tags_of_one_name_are_refused_with_the_right_form() -> None:
    async def body() -> None:
        await par(partial(tag, "same", partial(sleep, 1)), partial(tag, "same", partial(sleep, 1)))

    with pytest.raises(PlanStructureError, match=r"tagged 'same'(.|\n)*wrong(.|\n)*right.*same 2"):
        go(body)


def test_a_tag_is_named_by_a_string() -> None:
    with pytest.raises(TypeError, match="name of tag has to be a string"):
        go(partial(tag, 3, partial(sleep, 1)))
    with pytest.raises(TypeError, match="body of tag"):
        go(partial(tag, partial(sleep, 1), "name"))


async def stop() -> None:
    """Not a plain function."""


@pytest.mark.parametrize("called", [False, True])
def test_on_suspension_takes_a_plain_function(called: bool) -> None:
    async def body() -> None:
        wrong: Any = stop() if called else stop
        async with on_suspension(wrong):
            pass

    with pytest.raises(TypeError, match=r"plain function(.|\n)*wrong(.|\n)*right"):
        go(body)


def test_a_task_is_asked_for_in_a_plan_only() -> None:
    with pytest.raises(PlanStructureError, match="no plan is running"):
        task("drive")


def test_a_handle_and_a_plan_tell_what_they_are() -> None:
    @plan
    async def named() -> None: ...

    async def body() -> list[str]:
        handle = task("drive")
        before = repr(handle)
        assert handle.children == ()
        assert not wake_up(handle)
        await tag("drive", partial(sleep, 0))
        return [before, repr(handle), repr(named)]

    assert go(body) == ["<task drive, created>", "<task body/drive, succeeded>", "<plan named>"]


def test_a_deadlock_tells_for_the_end_of_which_task_a_join_waits() -> None:
    async def body() -> None:
        await join(task("never"))

    with pytest.raises(DeadlockError, match=r"body waits for the end of task 'never' at test_tasktree\.py"):
        run(body, host=VirtualHost())


def test_a_deadlock_tells_of_a_task_that_was_suspended_before_it_began() -> None:
    async def body() -> None:
        suspend(task("held"))
        await par(partial(tag, "held", partial(sleep, 1)), lambda: join(task("held")))

    with pytest.raises(DeadlockError) as caught:
        run(body, host=VirtualHost())
    assert "  body/par/tag/held is suspended" in str(caught.value)
    assert "waits for the end of task 'held'" in str(caught.value)


def test_a_handle_asked_for_inside_stays_with_the_live_task_of_its_plan() -> None:
    seen: list[str | None] = []

    @plan
    async def inner() -> None:
        handle = task("work")
        await par(partial(tag, "work", partial(sleep, 1)), look)
        seen.append(handle.path)

    async def look() -> None:
        await sleep(0.5)

    async def outer_tag() -> None:
        await sleep(0.25)
        await tag("work", partial(sleep, 0.1))

    @plan
    async def top() -> None:
        await par(inner, outer_tag)

    go(top)
    assert seen == ["top/par/inner/par/tag/work"]
