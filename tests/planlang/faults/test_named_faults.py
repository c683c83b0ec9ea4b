"""Faults are stated in one grammar, and drawn by the number of the opportunity."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from planlang.faults.drawing import Draw, Drawn
from planlang.faults.kinds import KINDS, Opportunity
from planlang.faults.named import NUMBERS, NamedFault, When, WrongFault, read_faults
from planlang.faults.stated import StatedFaults

TIMES = st.integers(0, 5000).map(lambda tenth: tenth / 10)
WHENS = st.one_of(
    st.builds(lambda first, more: When(first, None if more is None else first + more), st.integers(1, 99),
              st.none() | st.integers(0, 9)),
    st.builds(lambda since, more: When(1, None, since, None if more is None else since + more), TIMES,
              st.none() | st.integers(0, 90)),
    st.builds(lambda since: When(1, 1, since), TIMES),
)  # fmt: skip


@given(st.sampled_from(KINDS), st.none() | st.just("cup1"), st.booleans(), WHENS)
def test_what_a_fault_says_of_itself_is_read_as_the_same_fault(kind, of, has_value, when) -> None:  # type: ignore[no-untyped-def]
    value = None
    if has_value and kind.value is not None:
        value = f"{NUMBERS[kind.value][1]:g}" if kind.value in NUMBERS else "Cup"
    fault = NamedFault(kind, of, value, when)
    assert NamedFault.read(str(fault)) == fault


def test_several_faults_are_separated_by_spaces_and_happen_once_by_default() -> None:
    assert list(map(str, read_faults(["arm:stalls@2 camera:blind@3s-8s", "gripper.left:misses"]))) == [
        "arm:stalls@2",
        "camera:blind@3s-8s",
        "gripper.left:misses@1",
    ]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("griper:misses", "did you mean gripper?"),
        ("gripper:mises", "did you mean misses?"),
        ("gripper", "write PART:KIND@WHEN"),
        ("gripper:misses@soon", "write a number"),
        ("gripper:misses@0", "never comes"),
        ("camera:blind@8s-3s", "never comes"),
        ("gripper:misses=2", "has no value"),
        ("arm:stalls=2", "a number from 0 to 1"),
    ],
)
def test_a_fault_that_there_is_not_is_refused_with_advice(text: str, said: str) -> None:
    with pytest.raises(WrongFault, match=said.replace("?", r"\?")):
        read_faults([text])


def opportunities(draw: Draw, number: int, of: Opportunity = Opportunity.ARM, rate: float = 1.0) -> list[Drawn | None]:
    return [draw.at(of, ("left",), 0.5 * step, lambda kind, name, value: True) for step in range(number)]


def test_a_number_counts_the_opportunities_of_its_part_and_a_time_the_first_from_then_on() -> None:
    found = opportunities(Draw(read_faults(["arm.left:stalls@3 arm.right:stalls@1 arm:stalls@2.2s"]), 0.0, 1), 8)
    assert [step for step, one in enumerate(found) if one is not None] == [2, 5]


def test_during_a_time_each_opportunity_has_the_fault() -> None:
    found = opportunities(Draw(read_faults(["arm:stalls@1s-2s"]), 0.0, 1), 8)
    assert [step for step, one in enumerate(found) if one is not None] == [2, 3, 4]


def test_what_is_drawn_depends_on_the_seed_and_the_number_of_the_opportunity_alone() -> None:
    def drawn(seed: int, named: str = "") -> list[str]:
        return list(map(str, opportunities(Draw(read_faults([named]), 0.2, seed), 500)))

    assert drawn(3) == drawn(3) != drawn(4)
    assert 0.14 < 1 - drawn(3).count("None") / 500 < 0.26
    other = drawn(3, "arm:stalls@1")
    assert other[1:] == drawn(3)[1:]


def test_by_chance_only_what_a_robot_can_make_good_happens() -> None:
    for opportunity in Opportunity:
        found = {one.kind for one in opportunities(Draw((), 1.0, 5), 300, opportunity) if one is not None}
        assert found == {one for one in KINDS if one.opportunity is opportunity and one.recovers}


def test_a_file_states_faults_a_rate_and_how_the_run_is_expected_to_end(tmp_path: Path) -> None:
    file = tmp_path / "faults.toml"
    file.write_text('faults = ["person:refuses@always"]\nrate = 0.1\nexpect = "HandoverNotTaken"\n')
    stated = StatedFaults.of_file(file).also(["arm:stalls"], 0.0)
    assert (list(map(str, stated.named)), stated.rate, stated.expect) == (
        ["person:refuses@always", "arm:stalls@1"],
        0.1,
        "HandoverNotTaken",
    )


@pytest.mark.parametrize("content", ["faults = 3", "rate = 2", "expected = 'done'", "faults = [", "expect = 'no way'"])
def test_a_file_that_states_something_else_is_refused(content: str, tmp_path: Path) -> None:
    file = tmp_path / "faults.toml"
    file.write_text(content)
    with pytest.raises(WrongFault):
        StatedFaults.of_file(file)
