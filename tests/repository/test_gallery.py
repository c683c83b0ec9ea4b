"""The gallery shows every recipe that comes with planlang, with the command that made its picture."""

from __future__ import annotations

import re
import shlex

from planlang.files import Bundled
from tests.support.gallery import MOST_BYTES, PAGE, PICTURES, commands
from tests.support.scenarios import parsed


def test_each_bundled_recipe_is_in_the_gallery_with_a_command() -> None:
    shown = {shlex.split(command)[2] for command in commands().values()}
    assert sorted(set(Bundled.RECIPE.names()) - shown) == []


def test_each_command_of_the_gallery_can_be_parsed_and_writes_the_picture_below_it() -> None:
    for name, command in commands().items():
        assert parsed(shlex.split(command)[2:]).picture is not None
        behind = PAGE.read_text(encoding="utf-8").partition(command)[2]
        assert re.search(r"/(\w+)\.webp\)", behind)[1] == name  # type: ignore[index]


def test_the_pictures_of_the_gallery_are_those_of_its_commands_and_small() -> None:
    sizes = {path.stem: path.stat().st_size for path in PICTURES.iterdir()}
    assert sorted(sizes) == sorted(commands())
    assert [name for name, size in sizes.items() if size > MOST_BYTES] == []
