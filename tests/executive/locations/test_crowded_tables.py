"""Facts about questions at tables crowded with glasses: what is known to be in the way is not looked at again."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import pytest

from executive.locations import Resolver
from executive.motion import Chain
from planlang.failures import LocationUnresolvable
from planlang.protocols import Solution
from sim import PlanningWorld
from tests.support.locations.crowded_tables import ASKED, crowded_table
from tests.support.locations.dense_sampler import refutation
from tests.support.locations.oracle import Oracle
from tests.support.locations.rooms import asked, room_of
from tests.support.locations.stage import Stage, robot_of


@dataclass(slots=True)
class Work:
    """What was computed: exact checks of the planning world, and targets of inverse kinematics."""

    checks: int = 0
    targets: int = 0


@pytest.fixture
def work(monkeypatch: pytest.MonkeyPatch) -> Work:
    """The work done from now on."""
    done, contacts, solve = Work(), PlanningWorld.contacts, Chain.solve

    def counted_contacts(self, *arguments, **options):  # type: ignore[no-untyped-def]
        done.checks += 1
        return contacts(self, *arguments, **options)

    def counted_solve(self, targets, seeds):  # type: ignore[no-untyped-def]
        done.targets += len(targets)
        return solve(self, targets, seeds)

    monkeypatch.setattr(PlanningWorld, "contacts", counted_contacts)
    monkeypatch.setattr(Chain, "solve", counted_solve)
    monkeypatch.setattr("executive.locations.resolver.explain_bases", lambda *_: None)  # other searches
    return done


def first_of(seed: int) -> Solution | None:
    """The first place at a crowded table, None if there is none."""
    stage = Stage(crowded_table(seed), robot_of("amigo"))
    try:
        return next(_bases(stage.platform.resolver))
    except LocationUnresolvable:
        return None
    finally:
        stage.close()


def _bases(resolver: Resolver) -> Iterator[Solution]:
    return resolver.bases(ASKED)


def test_where_the_hand_itself_is_stopped_no_other_base_pose_is_tried_for_it(work: Work) -> None:
    assert first_of(9025) is None
    assert work.checks < 60
    assert work.targets < 2_000


def test_a_place_that_is_found_late_takes_few_exact_checks(work: Work) -> None:
    assert first_of(9038) is not None
    assert work.checks < 300


def test_a_place_that_lacks_sight_alone_is_given_after_a_look_without_a_second_search(work: Work) -> None:
    found = first_of(9024)
    assert found is not None
    assert [step.type for step in found.before] == ["Translation-LocationChange", "LookingForSomething"]
    assert work.checks < 90


@pytest.mark.long
@pytest.mark.parametrize("seed", [9003, 9009, 9025])
def test_a_dense_sampler_finds_no_place_where_the_answer_is_no(seed: int) -> None:
    assert first_of(seed) is None
    oracle = Oracle(crowded_table(seed), robot_of("amigo"))
    assert refutation(oracle, "bottle", side=True) is None
    oracle.close()


@pytest.mark.long
def test_the_dense_sampler_finds_places_where_there_are_some() -> None:
    oracle = Oracle(crowded_table(9001), robot_of("amigo"))
    assert refutation(oracle, "bottle", side=True) is not None
    oracle.close()


def test_a_no_takes_a_number_of_checks_and_targets_that_does_not_grow_with_the_room(work: Work) -> None:
    assert first_of(9008) is None
    assert work.targets < 16_000
    before = work.checks
    stage = Stage(room_of("hard", 30011), robot_of("amigo"))
    assert not stage.ask(asked(stage.room)).solved
    stage.close()
    assert work.checks - before < 3_000
