"""The search over alternatives: what is taken leaves nothing unmet, and what is not says why."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from hypothesis import given
from hypothesis import strategies as st

from executive.enabling.search import Combination, Need, Offer, combine


def found(wanted: Sequence[Need], offered: Mapping[Need, Sequence[Offer]], has: Sequence[Need] = ()) -> Combination:
    return combine(wanted, lambda need: "the robot has it" if need in has else None, lambda need: offered.get(need, ()))


def test_the_map_without_the_missing_laser_is_chosen() -> None:
    """The example of figure 7: a 3-D map would need a tilting laser."""
    tilted = Offer("map3d.lab", "Map3D", ("TiltingLaser",))
    flat = Offer("map2d.lab", "Map2D", ("Laser",))
    combination = found(["EnvironmentMap"], {"EnvironmentMap": [tilted, flat]}, has=["Laser"])
    answer = combination.answers["EnvironmentMap"]
    assert list(combination.offers()) == [flat]
    assert answer.considered == ((tilted, ("TiltingLaser",)), (flat, ()))
    assert combination.unmet == ()


def test_what_nothing_meets_is_named() -> None:
    combination = found(["Map", "Arm"], {"Map": [Offer("m", "Map", ("Laser",))]})
    assert combination.unmet == ("Map", "Arm")
    assert list(combination.offers()) == []
    assert combination.answers["Laser"].considered == ()


def test_an_earlier_offer_is_taken_also_if_it_needs_more() -> None:
    deep = Offer("deep", "A", ("B",))
    offers = {"A": [deep, Offer("flat", "A")], "B": [Offer("b", "B", ("C",))], "C": [Offer("c", "C")]}
    assert [one.uid for one in found(["A"], offers).offers()] == ["c", "b", "deep"]


def test_nothing_is_met_by_itself() -> None:
    egg, hen = Offer("egg", "Egg", ("Hen",)), Offer("hen", "Hen", ("Egg",))
    assert found(["Egg"], {"Egg": [egg], "Hen": [hen]}).unmet == ("Egg",)
    given_one = found(["Egg"], {"Egg": [egg], "Hen": [hen, Offer("bought", "Hen")]})
    assert [one.uid for one in given_one.offers()] == ["bought", "egg"]


def test_six_deep_among_thousands_of_alternatives_with_cycles_is_looked_at_once() -> None:
    asked: list[Need] = []

    def offers(need: Need) -> list[Offer]:
        asked.append(need)
        level = int(need.partition("-")[0])
        below = [f"{level + 1}-{number}" for number in range(20)] if level < 6 else ["0-0"]
        blind = [Offer(f"{need}/{number}", need, (below[number % len(below)], "Nothing")) for number in range(99)]
        return [*blind, Offer(f"{need}/last", need, tuple(below[:2]) if level < 6 else ())]

    combination = combine(["0-0"], lambda _: None, lambda need: [] if need == "Nothing" else offers(need))
    assert combination.unmet == ()
    assert len(asked) == len(set(asked)) == 121
    assert [one.uid for one in combination.offers()][-1] == "0-0/last"


def test_a_chain_of_ten_thousand_needs_is_followed_to_its_end() -> None:
    offers = {f"{level}": [Offer(f"{level}", "", (f"{level + 1}",))] for level in range(10_000)}
    assert found(["0"], offers).unmet == ("0",)
    assert len(list(found(["0"], offers, has=["10000"]).offers())) == 10_000


def test_of_what_costs_something_to_have_no_more_is_asked_than_a_need_takes_to_be_met() -> None:
    asked: list[str] = []

    def offers(need: Need) -> Iterator[Offer]:
        for number, needs in enumerate((("Nothing",), ("B",), ())):
            asked.append(f"{need}{number}")
            yield Offer(f"{need}{number}", need, needs if need == "A" else ())

    combination = combine(["A"], lambda _: None, lambda need: iter(()) if need == "Nothing" else offers(need))
    assert [one.uid for one in combination.offers()] == ["B0", "A1"]
    assert asked == ["A0", "A1", "B0"]


def test_one_entry_that_meets_two_needs_is_taken_for_both() -> None:
    both = Offer("both", "A")
    offers = {"A": [Offer("best", "A"), both], "B": [both]}
    assert list(found(["A", "B"], offers).offers()) == [both]
    own = Offer("own", "A", is_own=True)
    assert list(found(["A", "B"], {**offers, "A": [own, both]}).offers()) == [own, both]


NEEDS = st.integers(0, 7).map(str)


@given(
    st.dictionaries(NEEDS, st.lists(st.lists(NEEDS, max_size=3), max_size=4)),
    st.lists(NEEDS, min_size=1, max_size=3),
    st.sets(NEEDS, max_size=2),
)
def test_a_need_is_met_exactly_if_a_tree_without_circles_meets_it(
    offered: dict[Need, list[list[Need]]], wanted: list[Need], has: set[Need]
) -> None:
    offers = {
        need: [Offer(f"{need}/{number}", need, tuple(needs)) for number, needs in enumerate(each)]
        for need, each in offered.items()
    }
    met = set(has)
    while more := {n for n, each in offers.items() if n not in met and any(met.issuperset(one.needs) for one in each)}:
        met |= more
    combination = found(wanted, offers, sorted(has))
    assert set(combination.unmet) == set(wanted) - met
    one_by_one = combine(wanted, lambda need: need if need in has else None, lambda need: iter(offers.get(need, ())))
    assert one_by_one.unmet == combination.unmet
    done = set(has)
    for offer in combination.offers():
        assert done.issuperset(offer.needs)
        done.add(offer.about)
