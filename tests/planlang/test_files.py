"""Facts about opening what a user names: whatever is in a file's place ends in one diagnostic, in bounded memory."""

from __future__ import annotations

import os
import socket
from pathlib import Path

import pytest

from planlang.compiler import compile_recipe
from planlang.diagnostics import BadInput
from planlang.files import bundled, from_printable, printable, read_file
from planlang.outputs import header


def test_a_file_is_read_and_a_link_followed(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"text")
    (tmp_path / "link").symlink_to("file")
    assert read_file(tmp_path / "link", largest=4) == b"text"


@pytest.mark.parametrize(
    ("kind", "said"),
    [
        ("nothing", "thing does not exist"),
        ("folder", "thing is a folder"),
        ("fifo", "thing is not a regular file"),
        ("socket", "thing is not a regular file"),
        ("zero", "thing is not a regular file"),
        ("full", "thing is not a regular file"),
        ("loop", "thing cannot be read: Too many levels of symbolic links"),
        ("large", "the file is larger than 16 MB"),
        ("below a file", "thing cannot be read: Not a directory"),
    ],
)
def test_what_is_no_file_that_can_be_read_is_one_error(
    kind: str, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "thing"
    match kind:
        case "folder":
            path.mkdir()
        case "fifo":
            os.mkfifo(path)
        case "socket":
            monkeypatch.chdir(tmp_path)  # a socket's address may have 107 bytes
            with socket.socket(socket.AF_UNIX) as made:
                made.bind("thing")
        case "zero" | "full":
            path.symlink_to(f"/dev/{kind}")
        case "loop":
            path.symlink_to(path)
        case "large":
            with path.open("wb") as file:
                file.truncate(62 << 30)
        case "below a file":
            (tmp_path / "file").touch()
            path = tmp_path / "file" / "thing"
    with pytest.raises(BadInput) as caught:
        read_file(path, "B001")
    (found,) = caught.value.diagnostics
    assert (found.code, found.message) == ("B001", said)
    assert found.span is not None
    assert found.span.file == str(path)


@pytest.mark.parametrize("name", ["x" * 5000, "nul\0"])
def test_a_name_that_no_file_can_have_is_one_error(name: str) -> None:
    with pytest.raises(BadInput, match="cannot be read"):
        read_file(Path(name))


def test_a_name_that_is_not_utf_8_is_shown_in_text() -> None:
    name = os.fsdecode(b"caf\xe9.omn")
    assert printable(name) == "caf%E9.omn"
    assert from_printable("caf%E9.omn") == name
    assert printable("café.omn") == "café.omn"


def test_a_recipe_whose_name_is_not_utf_8_compiles_to_a_plan_that_knows_it(tmp_path: Path) -> None:
    recipe = tmp_path / os.fsdecode(b"caf\xe9.omn")
    recipe.write_bytes((bundled("recipes") / "serve_a_drink.omn").read_bytes())
    source = compile_recipe(recipe).source
    compile(source.encode(), "plan", "exec")
    found = header(source)
    assert found is not None
    assert found.find_recipe(tmp_path / "plan.py") == recipe
