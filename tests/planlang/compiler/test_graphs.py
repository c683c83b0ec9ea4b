"""Drawings of tasks: what they show in each format, layers, and that names chosen by strangers stay names."""

from __future__ import annotations

import re
from dataclasses import replace
from graphlib import CycleError
from itertools import combinations, pairwise
from xml.etree import ElementTree

import pytest
from hypothesis import given
from hypothesis import strategies as st

from planlang.compiler import compile_recipe
from planlang.compiler.drawing import FORMATS, Order, TaskGraph, dot, mermaid, svg, task_graph
from planlang.compiler.drawing.layers import layered
from planlang.compiler.drawing.svg import arranged
from planlang.compiler.drawing.task_graph import width
from planlang.diagnostics import Span
from planlang.files import bundled
from planlang.recipe import (
    Allen,
    Ending,
    Kind,
    Ordering,
    Overlap,
    Parameter,
    Place,
    Recipe,
    RecipeSet,
    Source,
    StateMachine,
    Step,
    Thing,
    Transition,
)

BASE = "http://planlang.org/test#"
SVG = "{http://www.w3.org/2000/svg}"
HOSTILE = [
    '"]; } digraph { x -> y [label="',
    "</title></svg><script>alert(1)</script>",
    "a]] end\nsubgraph x %%{init: {}}%% `**b**` #quot; &lt; &#60;",
    "--><!-- ]]> \\",
    "back\\slash\\\\n \\",
    "\N{RIGHT-TO-LEFT OVERRIDE}gnp.exe\0\x1b[31m\ud800\ufffe",
    "onload='x' \" onclick=\"x",
    "あ" * 300,
]


@pytest.fixture(scope="module")
def drink() -> TaskGraph:
    plan = compile_recipe(bundled("recipes") / "serve_a_drink.omn")
    return task_graph(plan.recipes, plan.added)


def recipe(names: str, *pairs: str, callee: dict[str, str] | None = None, task: str = "Task") -> Recipe:
    """Steps a, b, ... of one letter each, ordered by pairs of letters."""
    steps = tuple(
        Step(BASE + name, "Reaching", (), (BASE + callee[name],) if callee and name in callee else (), "primitive")
        for name in names
    )
    orderings = tuple(Ordering(BASE + a, BASE + b, f"{BASE}{a}Before{b}", span=Span("x.omn", 7)) for a, b in pairs)
    return Recipe(BASE + task, "PurposefulAction", steps, orderings)


def graph(*recipes: Recipe, added: tuple[str, ...] = ()) -> TaskGraph:
    found = RecipeSet(recipes[0].iri, {one.iri: one for one in recipes}, Source("x.omn", "0" * 64))
    return task_graph(found, {recipes[0].iri: [(BASE + a, BASE + b) for a, b in added]})


def pairs(drawn: TaskGraph, order: Order) -> set[str]:
    names = {box.key: box.name for group in drawn.groups() for box in group.boxes}
    return {names[arrow.before] + names[arrow.after] for group in drawn.groups() for arrow in group.of(order)}


def hostile_graph(text: str) -> TaskGraph:
    place = Place(BASE + text, (("in_reach_of", (Thing(Kind.OBJECT, "Cup", BASE + text),)),), text)
    fillers = (Parameter(text, place), Parameter("objectActedOn", text), Parameter("toLocation", place))
    inner = Recipe(BASE + "Inner" + text, text, (Step(BASE + "i" + text, text, fillers, (), "p", text),))
    steps = (
        Step(BASE + "a" + text, text, fillers, (), "p", text, Span(text, 3)),
        Step(BASE + "b" + text, text, fillers, (inner.iri,), None, text, Span(text, 4)),
    )
    orderings = (Ordering(steps[0].iri, steps[1].iri, BASE + text, span=Span(text, 5)),)
    outer = Recipe(BASE + text, text, steps, orderings, fillers, text)
    return task_graph(RecipeSet(outer.iri, {outer.iri: outer, inner.iri: inner}, Source(text, "0" * 64)))


def test_orders_that_follow_from_others_are_left_out() -> None:
    drawn = graph(recipe("abc", "ab", "bc", "ac"))
    assert pairs(drawn, Order.STATED) == {"ab", "bc"}
    assert drawn.group.arrows[0].hover == "a before b: aBeforeb (x.omn line 7)"


def test_orders_that_a_scope_adds_are_told_apart_and_explained() -> None:
    drawn = graph(recipe("abc", "ab"), added=("bc",))
    assert pairs(drawn, Order.ADDED) == {"bc"}
    assert "dashed: added by the compiler" in svg(drawn)
    assert "dashed: added by the compiler" not in svg(graph(recipe("abc", "ab", "bc")))


def test_a_recipe_that_two_steps_call_is_drawn_once() -> None:
    drawn = graph(recipe("ab", "ab", callee={"a": "In", "b": "In"}), recipe("xy", "xy", task="In"))
    first, second = drawn.group.boxes
    assert [box.name for box in first.groups[0].boxes] == ["x", "y"]
    assert second.groups == ()
    assert second.lines == ("as drawn elsewhere: In",)


def test_the_drink_is_five_boxes_of_which_one_holds_six(drink: TaskGraph) -> None:
    assert [len(group.boxes) for group in drink.groups()] == [5, 6]
    root = ElementTree.fromstring(svg(drink))
    steps = [g for g in root.iter(f"{SVG}g") if "step" in g.get("class", "").split()]
    assert len(steps) == 11
    texts = ["".join(text.itertext()) for text in root.iter(f"{SVG}text")]
    assert "toLocation: approachPose (inFrontOf-Generally bottle1)" in texts
    titles = ["".join(title.itertext()) for title in root.iter(f"{SVG}title")]
    step = r"ReachToHandoverPose\noffer the bottle to the patient\nReaching\ntoLocation: .+\nserve_a_drink.omn line \d+"
    order = r"GraspBottle before MoveBaseToHandoverPose: GraspBeforeCarrying \(serve_a_drink.omn line \d+\)"
    assert any(re.fullmatch(step, title) for title in titles)
    assert any(re.fullmatch(order, title) for title in titles)


def test_inner_boxes_lie_inside_of_their_recipe_and_no_two_others_overlap(drink: TaskGraph) -> None:
    found = arranged(drink.group)
    where = {placed.box.key: placed for placed in found.boxes}
    for group in drink.groups():
        for box in group.boxes:
            outer = where[box.key]
            for inner in (where[one.key] for below in box.groups for one in below.boxes):
                assert outer.x < inner.x
                assert inner.x + inner.width < outer.x + outer.width
                assert outer.y + 60 < inner.y, "the recipe's own text has room above"
                assert inner.y + inner.height < outer.y + outer.height


def test_dot_and_mermaid_nest_recipes_and_keep_reduced_orders(drink: TaskGraph) -> None:
    assert dot(drink).count("subgraph cluster_") == 1
    assert dot(drink).count(" -> ") == 4 + 5
    assert "lhead=cluster_" in dot(drink)
    assert mermaid(drink).count("subgraph ") == 2
    assert mermaid(drink).count(" --> ") == 4 + 5
    assert mermaid(drink).count("\n") < 40


@pytest.mark.parametrize("suffix", FORMATS)
def test_equal_recipes_give_equal_drawings(suffix: str, drink: TaskGraph) -> None:
    plan = compile_recipe(bundled("recipes") / "serve_a_drink.omn")
    assert FORMATS[suffix](task_graph(plan.recipes, plan.added)) == FORMATS[suffix](drink)
    assert str(bundled("recipes")) not in FORMATS[suffix](drink), "no folder of this machine shows"


@pytest.mark.parametrize("text", HOSTILE, ids=range(len(HOSTILE)))
def test_hostile_names_are_text_in_svg(text: str) -> None:
    drawn = svg(hostile_graph(text))
    root = ElementTree.fromstring(drawn.encode("utf-8"))
    tags = {element.tag.removeprefix(SVG) for element in root.iter()}
    assert tags <= {"svg", "title", "style", "defs", "marker", "path", "rect", "text", "g"}
    assert not [key for element in root.iter() for key in element.attrib if key.startswith("on")]
    assert not re.search("[\0\x1b\u202e]", drawn)


@pytest.mark.parametrize("text", HOSTILE, ids=range(len(HOSTILE)))
def test_hostile_names_are_strings_in_dot_and_mermaid(text: str) -> None:
    def outside(drawn: str) -> str:
        return re.sub(r'"(?:[^"\\\n]|\\.)*"', '""', drawn)

    harmless = hostile_graph("x")
    assert outside(dot(hostile_graph(text))) == outside(dot(harmless))
    assert outside(mermaid(hostile_graph(text))) == outside(mermaid(harmless))
    labels = re.findall(r'\["([^"]*)"\]', mermaid(hostile_graph(text)))
    assert all(re.fullmatch(r"(?:[\w …_.,:/=+()-]|#\d+;|<br/>)*", label) for label in labels), labels


def test_a_long_line_is_broken_in_its_box_and_whole_in_the_tooltip() -> None:
    place = Place(
        BASE + "handPose-approachObject", (("in_front_of", (Thing(Kind.OBJECT, "Cup", BASE + "cupOnTheTable"),)),)
    )
    step = Step(BASE + "a", "Reaching", (Parameter("toLocation", place),), (), "p")
    drawn = graph(Recipe(BASE + "T", "PurposefulAction", (step,)))
    whole = "toLocation: handPose-approachObject (inFrontOf-Generally cupOnTheTable)"
    root = ElementTree.fromstring(svg(drawn))
    texts = ["".join(text.itertext()) for text in root.iter(f"{SVG}text")]
    assert whole not in texts
    assert whole == " ".join(" ".join(texts[-2:]).split())
    assert any(whole in (title.text or "") for title in root.iter(f"{SVG}title"))


def test_alternatives_of_a_step_stand_side_by_side_in_frames() -> None:
    outer = Recipe(BASE + "T", "PurposefulAction", (Step(BASE + "a", "Reaching", (), (BASE + "P", BASE + "Q")),))
    drawn = graph(outer, recipe("x", task="P"), recipe("y", task="Q"))
    assert svg(drawn).count('class="frame"') == 2
    assert "one way: P" in dot(drawn)
    assert "one way: Q" in mermaid(drawn)


def search() -> Recipe:
    """Look until something is found, going on in between: a loop, a state that follows itself, a way out."""
    transitions = (
        Transition(BASE + "a", BASE + "b", Ending.FALSE, BASE + "CONDITION_FALSE"),
        Transition(BASE + "b", BASE + "a", Ending.DONE),
        Transition(BASE + "b", BASE + "b", Ending.OTHER, BASE + "AGAIN"),
        Transition(BASE + "a", BASE + "c", Ending.TRUE, BASE + "CONDITION_TRUE"),
        Transition(BASE + "a", BASE + "c", Ending.FAILED, BASE + "FAILED"),
    )
    return replace(recipe("abc"), machine=StateMachine(BASE + "a", (BASE + "c",), transitions))


def test_states_are_drawn_with_their_outcomes_even_in_circles() -> None:
    drawn = graph(search())
    labels = {(arrow.before, arrow.after): arrow.label for arrow in drawn.group.of(Order.TRANSITION)}
    a, b, c = (box.key for box in drawn.group.boxes)
    assert labels == {
        (a, b): "CONDITION_FALSE",
        (b, a): "completed",
        (b, b): "AGAIN",
        (a, c): "CONDITION_TRUE, FAILED",
    }
    assert [box.lines[0] for box in drawn.group.boxes if box.lines] == ["start state", "end state"]
    for written in (svg(drawn), dot(drawn), mermaid(drawn).replace("#95;", "_")):
        assert all(written.count(label) for label in labels.values())


def test_an_arrow_that_goes_back_up_ends_below_the_box_it_leads_to() -> None:
    found = arranged(graph(search()).group)
    (upward,) = (route for route in found.routes if route.is_upward)
    top, bottom = found.boxes[0], found.boxes[1]
    assert upward.points[0][1] == top.y + top.height
    assert upward.points[-1][1] == bottom.y


def test_overlaps_are_drawn_without_heads_and_order_nothing() -> None:
    overlaps = (Overlap(BASE + "a", Allen.DURING, BASE + "b"), Overlap(BASE + "a", Allen.STARTS, BASE + "Task"))
    drawn = graph(replace(recipe("abc", "bc"), overlaps=overlaps))
    assert pairs(drawn, Order.OVERLAP) == {"ab"}
    assert pairs(drawn, Order.STATED) == {"bc"}
    assert drawn.group.boxes[0].lines == ("starts the whole task",)
    paths = [path for path in ElementTree.fromstring(svg(drawn)).iter(f"{SVG}path") if path.get("class") == "overlap"]
    assert [path.get("marker-end") for path in paths] == [None]
    assert "dir=none" in dot(drawn)
    assert '-.-|"during"|' in mermaid(drawn)


def test_hovering_over_a_step_shows_its_recoveries_and_where_it_is_stated() -> None:
    plan = compile_recipe(bundled("recipes") / "serve_a_drink.omn")
    drawn = task_graph(plan.recipes, plan.added, plan.recoveries)
    (grasp,) = (box for box in drawn.group.boxes if box.name == "GraspBottle")
    assert "on GraspMissed: look and repeat (bottle1), up to 2 times, else ObjectUnfetchable" in grasp.hover
    assert grasp.hover[-1].startswith("serve_a_drink.omn line ")
    assert "on GraspMissed" in svg(drawn)


def test_a_task_of_ten_thousand_steps_is_made_into_a_graph_without_its_closure() -> None:
    names = [f"s{number}" for number in range(10_000)]
    steps = tuple(Step(BASE + name, "Reaching", (), (), "primitive") for name in names)
    orderings = tuple(Ordering(BASE + a, BASE + b) for a, b in pairwise(names))
    found = Recipe(BASE + "Task", "PurposefulAction", steps, orderings)
    drawn = task_graph(RecipeSet(found.iri, {found.iri: found}, Source("x.omn", "0" * 64)))
    assert len(drawn.group.of(Order.STATED)) == 9_999


SIZE = (60.0, 20.0)

graphs = st.integers(1, 12).flatmap(
    lambda number: st.tuples(
        st.lists(st.tuples(st.floats(5, 200), st.floats(5, 90)), min_size=number, max_size=number),
        st.lists(
            st.tuples(st.integers(0, number - 1), st.integers(0, number - 1)).filter(lambda edge: edge[0] < edge[1]),
            unique=True,
        ),
    )
)


@given(graphs)
def test_no_box_overlaps_another_and_all_are_inside(
    drawn: tuple[list[tuple[float, float]], list[tuple[int, int]]],
) -> None:
    sizes, edges = drawn
    found = layered(sizes, edges)
    boxes = [(x, y, x + w, y + h) for (x, y), (w, h) in zip(found.corners, sizes, strict=True)]
    for a, b in combinations(boxes, 2):
        assert a[2] < b[0] or b[2] < a[0] or a[3] < b[1] or b[3] < a[1], "two boxes overlap"
    slack = 1e-6
    assert all(a[0] >= -slack and a[1] >= -slack for a in boxes)
    assert all(a[2] <= found.width + slack and a[3] <= found.height + slack for a in boxes)


@given(graphs)
def test_arrows_lead_down_from_box_to_box(drawn: tuple[list[tuple[float, float]], list[tuple[int, int]]]) -> None:
    sizes, edges = drawn
    found = layered(sizes, edges)
    for (before, after), points in zip(edges, found.routes, strict=True):
        assert [y for _, y in points] == sorted(y for _, y in points)
        (x, y), (w, h) = found.corners[before], sizes[before]
        assert x <= points[0][0] <= x + w
        assert points[0][1] == pytest.approx(y + h)
        (x, y), (w, _) = found.corners[after], sizes[after]
        assert x <= points[-1][0] <= x + w
        assert points[-1][1] == pytest.approx(y)


def test_a_rank_is_the_longest_path_to_it() -> None:
    corners = layered([SIZE] * 4, [(0, 1), (1, 2), (0, 2), (3, 2)]).corners
    assert corners[0][1] == corners[3][1] < corners[1][1] < corners[2][1]


def test_a_chain_is_one_column() -> None:
    corners = layered([SIZE] * 4, [(0, 1), (1, 2), (2, 3)]).corners
    assert len({x for x, _ in corners}) == 1


def test_barycentres_untangle_two_pairs() -> None:
    corners = layered([SIZE] * 4, [(0, 3), (1, 2)]).corners
    assert (corners[0][0] < corners[1][0]) == (corners[3][0] < corners[2][0])


def test_what_nothing_orders_stands_beside_the_rest() -> None:
    corners = layered([SIZE] * 3, [(0, 1)]).corners
    assert corners[2][0] > corners[1][0] + SIZE[0]
    assert corners[2][1] == corners[0][1]


def test_a_cycle_has_no_layers() -> None:
    with pytest.raises(CycleError, match="cycle"):
        layered([SIZE] * 2, [(0, 1), (1, 0)])


def test_constraints_of_motions_are_drawn_in_words() -> None:
    plan = compile_recipe(bundled("recipes") / "stir_soup.omn")
    graph = task_graph(plan.recipes, plan.added)
    for write in FORMATS.values():
        text = write(graph)
        assert "Constraint(" not in text
        assert "http://" not in text.partition("<g")[2]
    assert "TipInside (ToolTip of DeviceUsed to BottomInside of ObjectActedOn, 0.008 to 0.035 m)" in svg(graph)


@pytest.mark.parametrize("font", ["DejaVuSans", "LiberationSans-Regular"])
def test_lines_are_estimated_no_narrower_than_fonts_draw_them(font: str) -> None:
    pictures = pytest.importorskip("PIL.ImageFont")
    try:
        drawn = pictures.truetype(f"{font}.ttf", 100)
    except OSError:
        pytest.skip(f"{font} is not installed")
    for line in (
        "objectActedOn: bottle1",
        "toLocation: handoverPlace (inReachOf-Generally patient1)",
        "TipInside (ToolTip of DeviceUsed to BottomInside of ObjectActedOn, 0.008 to 0.035 m)",
        "SWITCHING THE WWW MACHINE OFF @ 100%",
    ):
        assert width(line, 100) >= drawn.getlength(line), line
