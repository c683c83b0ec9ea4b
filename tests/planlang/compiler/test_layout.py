"""Emitted lines are what ``ruff format`` makes of them where nobody has set a width."""

import random
import subprocess
import sys

from planlang.compiler.layout import Call, Display, Expression, Text, statement


def formatted(source: str) -> str:
    """What ruff makes of a source."""
    command = [sys.executable, "-m", "ruff", "format", "--isolated", "-"]
    return subprocess.run(command, input=source, capture_output=True, text=True, check=True).stdout


def some_expression(rng: random.Random, depth: int) -> Expression:
    name = "x" + "abcdefgh"[rng.randrange(8)] * rng.randrange(1, 30)
    inside = [some_expression(rng, depth - 1) for _ in range(rng.randrange(5))] if depth else []
    match rng.randrange(4) if inside else 0:
        case 0:
            return Text(name)
        case 1:
            return Display(rng.choice(["()", "[]"]), tuple(inside))
        case 2:
            return Display("{}", tuple(inside), tuple(Text(f'"{name}{index}"') for index in range(len(inside))))
        case _:
            split = rng.randrange(len(inside) + 1)
            positional = [(None, item) for item in inside[:split]]
            keywords = [(f"k{index}", item) for index, item in enumerate(inside[split:])]
            return Call(name, (*positional, *keywords))


def test_formatter_leaves_any_call_as_it_was_laid_out() -> None:
    rng = random.Random(7)
    lines = ["async def plan():"]
    for _ in range(1500):
        arguments = tuple((None, some_expression(rng, 3)) for _ in range(rng.randrange(4)))
        lines += statement(Call("perform", arguments), depth=rng.choice([1, 1, 1]), before="await ")
    source = "\n".join(lines) + "\n"
    assert formatted(source) == source


def test_arguments_share_a_line_before_they_get_one_each() -> None:
    arguments = tuple((None, Text("a" * 26)) for _ in range(3))
    assert len(statement(Call("f" * 40, arguments), depth=0)) == 3


def test_items_of_a_display_never_share_a_line_once_it_is_broken() -> None:
    items = tuple(Text("a" * 30) for _ in range(5))
    assert len(statement(Display("[]", items), depth=0)) == 7


def test_tuple_of_one_keeps_its_comma() -> None:
    assert statement(Display("()", (Text("a"),)), depth=0) == ["(a,)"]
