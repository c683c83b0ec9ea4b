"""Prints the answers in some rooms to the last bit: two processes that print the same are equal.

python -m tests.support.locations.answers 2 normal hard
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence

from planlang.designators import a_location
from tests.support.locations.rooms import KINDS, THE_BOTTLE, THE_PATIENT, rooms
from tests.support.locations.stage import Stage, robot_of

LOCATIONS = (
    a_location(in_reach_of=THE_BOTTLE),
    a_location(in_reach_of=THE_PATIENT),
    a_location(visible_from=THE_BOTTLE),
)


def lines(number: int, kinds: Sequence[str]) -> Iterator[str]:
    """Base, arm and counts of the first places in rooms of some kinds, a line for each location."""
    for kind in kinds:
        for room in rooms(kind, number):
            stage = Stage(room, robot_of("amigo"))
            for location in LOCATIONS:
                answer = stage.ask(location, 3)
                places = [[value.hex() for value in map(float, s.base)] for s in answer.solutions]
                details = [sorted(map(str, s.detail.items())) for s in answer.solutions]
                yield f"{room.name} {location} {places} {details} {answer.failure}"
            stage.close()


def main() -> None:
    """Print them."""
    number = int(sys.argv[1]) if len(sys.argv) > 1 else 1
    for line in lines(number, sys.argv[2:] or KINDS):
        print(line)


if __name__ == "__main__":
    main()
