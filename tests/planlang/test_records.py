"""Classes of planlang.records behave as those of the standard library do, and are made without compiling anything."""

from __future__ import annotations

import builtins
import copy
import dataclasses
import inspect
import pickle
from collections.abc import Callable
from dataclasses import FrozenInstanceError, field
from typing import Any

import pytest

from planlang import records


def classes(dataclass: Any) -> dict[str, Any]:
    """Classes with all that planlang uses, made by one decorator or the other."""

    @dataclass(frozen=True, slots=True)
    class Point:
        x: float
        y: float = 0.0

    @dataclass(slots=True)
    class Bag:
        name: str
        things: list[str] = field(default_factory=list)
        count: int = field(default=0, init=False)
        weight: float = field(default=1.0, compare=False, repr=False)

        def __post_init__(self) -> None:
            self.count = len(self.things)

    @dataclass(frozen=True, kw_only=True)
    class Base:
        verbose: bool = False

    @dataclass(frozen=True, kw_only=True)
    class Options(Base):
        """With a text of its own: for one that has none the standard library asks for the base's signature."""

        file: str

    @dataclass(frozen=True, slots=True, eq=False)
    class Alone:
        x: int

    @dataclass(frozen=True)
    class Own:
        x: int

        def __eq__(self, other: object) -> bool:
            return isinstance(other, Own) and abs(self.x - other.x) < 2

        def __hash__(self) -> int:
            return 7

        def __repr__(self) -> str:
            return "own"

    return {kind.__name__: kind for kind in (Point, Bag, Options, Alone, Own)}


OURS, THEIRS = classes(records.dataclass), classes(dataclasses.dataclass)
USES: tuple[Callable[[dict[str, Any]], object], ...] = (
    lambda c: repr([c["Point"](1.0), c["Point"](y=2.0, x=1.0), c["Bag"]("a", ["b"]), c["Options"](file="f")]),
    lambda c: (c["Point"](1.0) == c["Point"](1.0, 0.0), c["Point"](1.0) == (1.0, 0.0), c["Point"](1.0) != 1.0),
    lambda c: (hash(c["Point"](1.0)) == hash(c["Point"](1.0)), len({c["Point"](1.0), c["Point"](1.0)})),
    lambda c: (c["Bag"].__hash__, c["Bag"]("a") == c["Bag"]("a", weight=2.0), c["Bag"]("a", ["b"]).count),
    lambda c: c["Bag"]("a").things is c["Bag"]("a").things,
    lambda c: (c["Alone"](1) == c["Alone"](1), hash(c["Alone"](1)) == hash(c["Alone"](1))),
    lambda c: (c["Own"](1) == c["Own"](2), hash(c["Own"](1))),
    lambda c: [(one.name, one.init, one.kw_only) for kind in c.values() for one in dataclasses.fields(kind)],
    lambda c: (c["Point"].__match_args__, c["Options"].__match_args__, c["Point"].__slots__),
    lambda c: repr(dataclasses.replace(c["Point"](1.0), y=3.0)) + repr(dataclasses.asdict(c["Bag"]("a", ["b"]))),
    lambda c: repr([copy.copy(c["Point"](1.0)), copy.deepcopy(c["Bag"]("a", ["b"])), repr(c["Own"](1))]),
    lambda c: sorted(c["Point"](1.0).__reduce_ex__(4)[2]),
)
MISUSES: tuple[Callable[[dict[str, Any]], object], ...] = (
    lambda c: c["Point"](),
    lambda c: c["Point"](1.0, 2.0, 3.0),
    lambda c: c["Options"]("f"),
    lambda c: setattr(c["Point"](1.0), "x", 2.0),
    lambda c: delattr(c["Options"](file="f"), "file"),
)


@pytest.mark.parametrize("use", USES)
def test_each_use_gives_what_the_standard_library_gives(use: Callable[[dict[str, Any]], object]) -> None:
    assert use(OURS) == use(THEIRS)


@pytest.mark.parametrize("misuse", MISUSES)
def test_each_misuse_raises_what_the_standard_library_raises(misuse: Callable[[dict[str, Any]], object]) -> None:
    raised = []
    for kinds in (OURS, THEIRS):
        with pytest.raises((TypeError, FrozenInstanceError)) as caught:
            misuse(kinds)
        raised.append((type(caught.value), str(caught.value)))
    assert raised[0] == raised[1]


@records.dataclass(frozen=True, slots=True)
class Pickled:
    """One that pickle finds."""

    x: int
    y: tuple[str, ...] = ()


@records.dataclass(frozen=True)
class Named:
    """Fields that are called like what the constructor works with."""

    given: int
    set: int
    made: list[int] = dataclasses.field(default_factory=list)
    absent: int = 3


def test_no_name_of_a_field_meets_one_of_the_constructor() -> None:
    assert Named(1, 2) == Named(given=1, set=2, made=[], absent=3)


def test_frozen_ones_with_slots_are_pickled() -> None:
    assert pickle.loads(pickle.dumps(Pickled(1, ("a",)))) == Pickled(1, ("a",))


def test_nothing_is_compiled_before_the_first_instance(monkeypatch: pytest.MonkeyPatch) -> None:
    compiled: list[object] = []
    original = builtins.exec
    monkeypatch.setattr(builtins, "exec", lambda *a, **named: compiled.append(a[0]) or original(*a, **named))
    point = classes(records.dataclass)["Point"]
    assert not any("self" in str(text) for text in compiled)  # since 3.13 an empty function is compiled
    before = len(compiled)
    point(1.0), point(2.0)
    assert len(compiled) == before + 1


def test_the_signature_is_that_of_the_constructor_before_the_first_instance() -> None:
    @records.dataclass(frozen=True)
    class Untouched:
        one: int
        other: int = 2

    assert str(inspect.signature(Untouched)).startswith("(one, other=")
    assert " at 0x" not in str(inspect.signature(Untouched))
    with pytest.raises(TypeError):
        inspect.signature(Untouched).bind()
    assert Untouched(1).other == 2
