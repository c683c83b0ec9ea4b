"""Opening what a user names, and what is kept between runs: used when it is right, made anew, and never required."""

from __future__ import annotations

import os
import socket
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from planlang.cache import Cache
from planlang.compiler import compile_recipe
from planlang.diagnostics import BadInput
from planlang.files import bundled, from_printable, printable, read_file
from planlang.ontology import documents, load
from planlang.ontology.documents import read_syntax
from planlang.ontology.manchester import read_manchester
from planlang.ontology.triples import Parsed, Triples
from planlang.outputs import header
from tests.support.refusals import refusal

CACHE = Cache("kind", most=3, largest=10_000)
CONTENT = bytes(range(256)) * 8


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the folder where entries are kept."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "home"))
    return tmp_path / "home" / "planlang" / "kind"


def only(folder: Path) -> Path:
    (entry,) = folder.iterdir()
    return entry


def _flip(path: Path) -> None:
    content = bytearray(path.read_bytes())
    for place in range(0, len(content), 70):
        content[place] ^= 16
    path.write_bytes(content)


def _in_place_of(path: Path, make: Callable[[Path], object]) -> None:
    path.unlink()
    make(path)


def _socket(path: Path) -> None:
    here = os.getcwd()
    os.chdir(path.parent)  # a socket's address may have 107 bytes
    with socket.socket(socket.AF_UNIX) as made:
        made.bind(path.name)
    os.chdir(here)


def _sparse(path: Path) -> None:
    with path.open("r+b") as file:
        file.truncate(62 << 30)


def _header(path: Path) -> None:
    header = (
        np.lib.format.MAGIC_PREFIX + b"\x01\x00v\x00{'descr': '<f8', 'fortran_order': False, 'shape': (8349416423,)}"
    )
    path.write_bytes(header.ljust(2000))


def _full_folder(path: Path) -> None:
    path.mkdir()
    (path / "file").write_text("")


DAMAGES: dict[str, Callable[[Path], object]] = {
    "empty": lambda path: path.write_bytes(b""),
    "cut off in the digest": lambda path: os.truncate(path, 40),
    "only the digest": lambda path: os.truncate(path, 64),
    "cut off in the content": lambda path: os.truncate(path, 1000),
    "one byte short": lambda path: os.truncate(path, path.stat().st_size - 1),
    "something appended": lambda path: path.write_bytes(path.read_bytes() + b"\n"),
    "flipped bits": _flip,
    "zeros": lambda path: path.write_bytes(bytes(path.stat().st_size)),
    "a header that asks for 62 GiB": _header,
    "a size of 62 GiB": _sparse,
    "a folder": lambda path: _in_place_of(path, Path.mkdir),
    "a folder that is not empty": lambda path: _in_place_of(path, _full_folder),
    "a FIFO": lambda path: _in_place_of(path, os.mkfifo),
    "a socket": lambda path: _in_place_of(path, _socket),
    "a link to itself": lambda path: _in_place_of(path, lambda there: there.symlink_to(there)),
    "a link to nothing": lambda path: _in_place_of(path, lambda there: there.symlink_to("nothing")),
    "a link to a device": lambda path: _in_place_of(path, lambda there: there.symlink_to("/dev/zero")),
    "no permission": lambda path: path.chmod(0),
    "gone": Path.unlink,
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_entry_counts_as_not_kept_and_is_replaced(damage: str, folder: Path) -> None:
    CACHE.keep("key", CONTENT)
    assert CACHE.load("key") == CONTENT
    DAMAGES[damage](only(folder))
    is_readable = damage == "no permission" and os.geteuid() == 0
    assert CACHE.load("key") == (CONTENT if is_readable else None)
    assert CACHE.keep("key", CONTENT)
    assert CACHE.load("key") == CONTENT
    assert only(folder).is_file()


def test_every_cut_is_noticed(folder: Path) -> None:
    CACHE.keep("key", CONTENT)
    whole = only(folder).read_bytes()
    for length in range(0, len(whole), 97):
        only(folder).write_bytes(whole[:length])
        assert CACHE.load("key") is None


def test_another_entry_under_this_name_is_not_taken_for_it(folder: Path) -> None:
    CACHE.keep("other", CONTENT)
    other = only(folder).read_bytes()
    only(folder).unlink()
    CACHE.keep("key", b"")
    only(folder).write_bytes(other)
    assert CACHE.load("key") is None


@pytest.mark.parametrize("mode", [0o777, 0o775, 0o757])
def test_nothing_is_loaded_from_a_folder_that_others_may_write(mode: int, folder: Path) -> None:
    CACHE.keep("key", CONTENT)
    folder.chmod(mode)
    assert CACHE.load("key") is None
    assert CACHE.keep("new", CONTENT)  # takes the folder back, without what was in it
    assert folder.stat().st_mode & 0o777 == 0o700
    assert (CACHE.load("key"), CACHE.load("new")) == (None, CONTENT)


@pytest.mark.parametrize("above", ["a file", "a link to itself", "a FIFO"])
def test_without_a_usable_folder_nothing_is_kept_and_nothing_fails(
    above: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    place = tmp_path / "place"
    {"a file": Path.touch, "a FIFO": os.mkfifo, "a link to itself": lambda path: path.symlink_to(path)}[above](place)
    monkeypatch.setenv("XDG_CACHE_HOME", str(place))
    assert not CACHE.keep("key", CONTENT)
    assert CACHE.load("key") is None


def test_an_entry_that_cannot_be_written_leaves_no_temporary_file(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*arguments: object) -> None:
        raise PermissionError

    monkeypatch.setattr(os, "replace", fail)
    assert not CACHE.keep("key", CONTENT)
    assert list(folder.iterdir()) == []


def test_the_oldest_entries_beyond_so_many_are_forgotten(folder: Path) -> None:
    for number in range(6):
        CACHE.keep(str(number), CONTENT)
        for entry in folder.iterdir():
            os.utime(entry, (entry.stat().st_mtime - 10,) * 2)
    assert [CACHE.load(str(number)) is not None for number in range(6)] == [False] * 3 + [True] * 3


def test_the_oldest_entries_beyond_so_many_bytes_are_forgotten(folder: Path) -> None:
    small = Cache("kind", most=100, total=4 * len(CONTENT))
    for number in range(6):
        small.keep(str(number), CONTENT)
        for entry in folder.iterdir():
            os.utime(entry, (entry.stat().st_mtime - 10,) * 2)
    assert [small.load(str(number)) is not None for number in range(6)] == [False] * 3 + [True] * 3


def test_what_is_too_large_is_not_kept() -> None:
    assert not CACHE.keep("key", bytes(10_001))


ROOM = """Prefix: : <http://example.org/room#>
Prefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>
Ontology: <http://example.org/room>

Individual: table1
    Types: knowrob:Table-PieceOfFurniture
    Facts: knowrob:translation "1.6 0 0.37", knowrob:boundingBoxSize "0.7 1.2 0.74"
"""


def test_a_file_of_the_user_is_parsed_once_and_again_when_it_has_changed(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    room, parsed = tmp_path / "room.omn", []

    def counted(content: bytes, file: str, **options: Any) -> Parsed:
        parsed.append(Path(file).name)
        return read_syntax(content, file, **options)

    monkeypatch.setattr(documents, "read_syntax", counted)
    room.write_text(ROOM)
    first, second = load(room, builtin=False), load(room, builtin=False)
    assert parsed == ["room.omn"]
    assert list(first.triples()) == list(second.triples())
    room.write_text(ROOM.replace("1.6", "1.7"))
    third = load(room, builtin=False)
    assert parsed == ["room.omn"] * 2
    assert list(third.triples()) != list(first.triples())


def test_an_upload_is_not_kept(folder: Path) -> None:
    load(Path("room.omn"), builtin=False, content=ROOM.encode())
    assert not (folder.parent / "documents").exists()


HOSTILE = {
    "no JSON": b"{",
    "too deep": b"[" * 100_000,
    "no list": b"3",
    "no columns": b'["b",["x"]]',
    "columns of different lengths": b'["b",["x"],[0],[0],[0],[1],[]]',
    "a term that is not there": b'["b",["x"],[0],[0],[1],[1],[1]]',
    "a term before the first": b'["b",["x"],[0],[0],[-1],[1],[1]]',
    "a term of numbers": b'["b",["x",[1,2,3]],[0],[0],[1],[1],[1]]',
    "a term without a text": b'["b",["x",[]],[0],[0],[1],[1],[1]]',
    "a term of four texts": b'["b",["x",["a","b","c","d"]],[0],[0],[1],[1],[1]]',
    "a number for a term": b'["b",[7],[0],[0],[0],[1],[1]]',
    "a number that is too large": b'["b",["x"],[0],[0],[0],[99999999999],[1]]',
    "a number that is not whole": b'["b",["x"],[0.5],[0],[0],[1],[1]]',
    "no label": b'[5,["x"],[0],[0],[0],[1],[1]]',
}


@pytest.mark.parametrize("content", HOSTILE.values(), ids=HOSTILE)
def test_an_entry_with_a_right_digest_and_a_wrong_content_is_not_used(content: bytes) -> None:
    with pytest.raises(ValueError):  # noqa: PT011  json has messages of its own
        Triples.unpacked(content, "room.omn")


def test_every_bundled_ontology_comes_back_from_its_bytes_as_it_was_read() -> None:
    for path in sorted(bundled("ontologies").rglob("*.omn")):
        parsed = read_manchester(path.read_bytes(), path.name, base="http://x.org/").triples
        again = Triples.unpacked(parsed.packed(), "elsewhere.omn")
        assert [(t.subject, t.predicate, t.object) for t in again] == [
            (t.subject, t.predicate, t.object) for t in parsed
        ]
        assert {triple.span.file for triple in again} == {"elsewhere.omn"}
        assert [triple.span[1:] for triple in again] == [triple.span[1:] for triple in parsed]


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
    with refusal("C001"):
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
