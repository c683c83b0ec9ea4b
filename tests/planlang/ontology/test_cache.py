"""The cache of parsed vocabulary: used when it is right, ignored when it is not, never required."""

import os
from pathlib import Path

import pytest

from planlang.ontology import cache
from planlang.ontology.manchester import read_manchester
from planlang.ontology.terms import Triple
from planlang.resources import bundled

CONTENT = b'Prefix: : <http://x.org/#>\nClass: A Annotations: :p "t"@en, :p "5" SubClassOf: :q some {:a}, :q value 3\n'


@pytest.fixture(autouse=True)
def _own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))


def triples() -> list[Triple]:
    return read_manchester(CONTENT, "t.omn", base="http://x.org/").triples


def entries(tmp_path: Path) -> list[Path]:
    return list((tmp_path / "cache" / "planlang" / "ontology").iterdir())


def test_what_is_kept_is_fetched_with_positions_in_the_asked_file(tmp_path: Path) -> None:
    assert cache.fetch(CONTENT, "t.omn") is None
    cache.keep(CONTENT, triples())
    assert cache.fetch(CONTENT, "t.omn") == triples()
    moved = cache.fetch(CONTENT, "elsewhere.omn")
    assert moved is not None
    assert {triple.span.file for triple in moved} == {"elsewhere.omn"}


def test_other_content_is_another_entry(tmp_path: Path) -> None:
    cache.keep(CONTENT, triples())
    assert cache.fetch(CONTENT + b"\n", "t.omn") is None


@pytest.mark.parametrize("damage", [b"", b"\n", b"{}", b"\xff\xfe", b"[" * 10_000])
def test_a_damaged_entry_is_ignored_and_replaced(tmp_path: Path, damage: bytes) -> None:
    cache.keep(CONTENT, triples())
    (entry,) = entries(tmp_path)
    entry.write_bytes(damage)
    assert cache.fetch(CONTENT, "t.omn") is None
    cache.keep(CONTENT, triples())
    assert cache.fetch(CONTENT, "t.omn") == triples()


def test_a_cut_off_entry_is_ignored(tmp_path: Path) -> None:
    cache.keep(CONTENT, triples())
    (entry,) = entries(tmp_path)
    whole = entry.read_bytes()
    for length in range(0, len(whole), 50):
        entry.write_bytes(whole[:length])
        assert cache.fetch(CONTENT, "t.omn") is None


def test_without_a_usable_folder_nothing_is_kept_and_nothing_fails(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "a_file").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "a_file"))
    cache.keep(CONTENT, triples())
    assert cache.fetch(CONTENT, "t.omn") is None


def test_no_temporary_files_remain(tmp_path: Path) -> None:
    for _ in range(3):
        cache.keep(CONTENT, triples())
    assert [path.suffix for path in entries(tmp_path)] == [".json"]


def test_an_entry_that_cannot_be_replaced_leaves_no_temporary_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*arguments: object) -> None:
        raise PermissionError

    monkeypatch.setattr(os, "replace", fail)
    cache.keep(CONTENT, triples())
    assert entries(tmp_path) == []


def test_only_so_many_entries_are_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cache, "MOST_ENTRIES", 3)
    for number in range(6):
        cache.keep(CONTENT + b"#" * number, triples())
    assert len(entries(tmp_path)) == 3


def test_every_bundled_file_comes_back_from_the_cache_as_it_was_read() -> None:
    for path in sorted(bundled("ontologies").rglob("*.omn")):
        content = path.read_bytes()
        parsed = read_manchester(content, path.name, base="http://x.org/").triples
        cache.keep(content, parsed)
        assert cache.fetch(content, path.name) == parsed
