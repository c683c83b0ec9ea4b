"""Attacks are the same for the same seed and number, and only ends that a command states are good."""

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

HERE = Path(__file__).parent


@pytest.fixture(scope="module")
def attacks() -> Iterator[Any]:
    sys.path.insert(0, str(HERE))
    import attacks

    yield attacks
    sys.path.remove(str(HERE))


@pytest.fixture(scope="module")
def sources(attacks: Any, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Files of all names that lines have, with little in them."""
    folder = tmp_path_factory.mktemp("sources")
    for name in {one for names in (*attacks.KINDS.values(), *attacks.BELOW.values()) for one in names}:
        (folder / name).write_text(f'<a b="1"/>\n{name} = 2\n')
    return folder


@pytest.mark.parametrize("part", ["files", "arguments", "environments", "limits"])
def test_a_case_depends_on_its_part_seed_and_number_alone(attacks: Any, sources: Path, part: str) -> None:
    cases = [attacks.case_of(part, 3, number, sources) for number in range(50)]
    assert [attacks.case_of(part, 3, number, sources) for number in reversed(range(50))] == cases[::-1]
    assert len({(one.words, tuple(one.files), str(one.environment), str(one.limits)) for one in cases}) > 20


def test_all_commands_are_attacked(attacks: Any, sources: Path) -> None:
    from tests.support.cli_runs import COMMANDS

    cases = [attacks.case_of("arguments", 1, number, sources) for number in range(1500)]
    assert {name.split()[0] for name in COMMANDS} <= {case.words[0] for case in cases}
    said = {word for case in cases for word in case.words}
    assert {"--json", "--seed", "--ontologies", "--key-file", "--worlds"} <= said


@pytest.mark.parametrize(
    ("status", "said", "is_good"),
    [
        (0, "done", True),
        (2 << 8, "error C001", True),
        (70 << 8, "internal error in f (g.py:1): ValueError: x", False),
        (71 << 8, "error C020", False),
        (11, "", False),
        (1 << 8, "Traceback (most recent call last):\nValueError", False),
        (0, "a\x1b[31m", False),
        (0, "a\u202e", False),
    ],
)
def test_only_ends_that_a_command_states_are_good(attacks: Any, status: int, said: str, *, is_good: bool) -> None:
    case = attacks.Case("arguments", 0, 0, ("list", "robots"))
    assert (attacks.problem_of(case, status, said, said, interrupted=False) is None) == is_good
