"""Dataclasses that compile nothing when their module is imported.

The standard library generates the source of up to seven methods for each dataclass and compiles it, which takes a tenth
of a short run. Here the methods are closures, except for ``__init__``, which is compiled for the first instance. For
``fields``, ``replace``, ``match`` and type checkers the classes are ordinary dataclasses.
"""

from __future__ import annotations

import dataclasses
import reprlib
from collections.abc import Callable, Sequence
from dataclasses import MISSING, Field, FrozenInstanceError
from operator import attrgetter
from typing import TYPE_CHECKING, Any, NoReturn

if TYPE_CHECKING:
    from dataclasses import dataclass as dataclass
else:

    def dataclass(cls: type | None = None, /, **options: Any) -> Any:
        """Make a dataclass, as the standard library's decorator does, but without ``order`` and ``InitVar``."""
        return _made(cls, **options) if cls is not None else lambda cls: _made(cls, **options)


_set = object.__setattr__


def _made(cls: Any, *, eq: bool = True, repr: bool = True, frozen: bool = False, **options: bool) -> Any:
    own = set(vars(cls))
    # Python sets __hash__ to None in a class that defines __eq__; that is not a hash of its own
    own -= {"__hash__"} if "__eq__" in own and vars(cls)["__hash__"] is None else set()
    made: Any = dataclasses.dataclass(init=False, repr=False, eq=False, **options)(cls)
    fields = dataclasses.fields(made)
    methods: dict[str, Any] = {"__init__": _FirstInit(made, frozen)}
    if repr:
        methods["__repr__"] = _repr([one.name for one in fields if one.repr])
    if eq:
        methods["__eq__"] = _eq(_values([one.name for one in fields if one.compare]))
        hashed = _values([one.name for one in fields if (one.compare if one.hash is None else one.hash)])
        methods["__hash__"] = (lambda self: hash(hashed(self))) if frozen else None
    if frozen:
        methods |= {"__setattr__": _refuse("assign to"), "__delattr__": _refuse("delete")}
        if options.get("slots"):
            methods |= _state([one.name for one in fields])
    for name, method in methods.items():
        if name not in own:
            setattr(made, name, method)
    return made


class _FromFactory:
    """Default of a parameter whose value a factory makes, in signatures."""

    def __repr__(self) -> str:
        return "<factory>"


class _FirstInit:
    """Placeholder for a constructor, which the first look at it replaces: for an instance, or a signature."""

    def __init__(self, made: Any, frozen: bool) -> None:
        self._made, self._frozen = made, frozen

    def __get__(self, instance: object, owner: type | None = None) -> Any:
        init = self._made.__init__ = _compiled_init(self._made, self._frozen)
        return init.__get__(instance, owner)


def _compiled_init(made: Any, frozen: bool) -> Any:
    """Compile the constructor of a class, with defaults, factories and ``__post_init__``."""
    every: Sequence[Field[Any]] = dataclasses.fields(made)
    # these cannot clash with names made from fields, which begin with _default_ and _make_
    known: dict[str, Any] = {"__name__": __name__, "_set": _set, "_given": (given := _FromFactory())}
    parameters, keywords, body = ["self"], list[str](), list[str]()
    for one in every:
        value = one.name
        if one.default_factory is not MISSING:
            known[f"_make_{one.name}"], known[f"_default_{one.name}"] = one.default_factory, given
            value = f"_make_{one.name}()" + (f" if {one.name} is _given else {one.name}" if one.init else "")
        elif one.default is not MISSING:
            known[f"_default_{one.name}"] = one.default
            value = one.name if one.init else f"_default_{one.name}"
        elif not one.init:
            continue
        if one.init:
            default = f"_default_{one.name}"
            (keywords if one.kw_only else parameters).append(one.name + f"={default}" * (default in known))
        body.append(f"_set(self, {one.name!r}, {value})" if frozen else f"self.{one.name} = {value}")
    body += ["self.__post_init__()"] * hasattr(made, "__post_init__")
    signature = ", ".join([*parameters, *(["*", *keywords] if keywords else [])])
    text = f"def __init__({signature}):\n " + ("\n ".join(body) or "pass")
    made_here: dict[str, Any] = {}
    exec(text, known, made_here)
    init = made_here["__init__"]
    init.__qualname__, init.__module__ = f"{made.__qualname__}.__init__", made.__module__
    return init


def _values(names: Sequence[str]) -> Callable[[Any], tuple[Any, ...]]:
    """Make a function that reads attributes of an object as a tuple."""
    if len(names) > 1:
        return attrgetter(*names)
    return lambda one: tuple([getattr(one, name) for name in names])


def _eq(values: Callable[[Any], tuple[Any, ...]]) -> Callable[[Any, Any], Any]:
    def equal(self: Any, other: Any) -> Any:
        return values(self) == values(other) if other.__class__ is self.__class__ else NotImplemented

    return equal


def _repr(names: Sequence[str]) -> Callable[[Any], str]:
    @reprlib.recursive_repr()
    def represented(self: Any) -> str:
        shown = ", ".join(f"{name}={getattr(self, name)!r}" for name in names)
        return f"{self.__class__.__qualname__}({shown})"

    return represented


def _refuse(verb: str) -> Callable[..., NoReturn]:
    def refused(self: object, name: str, *value: object) -> NoReturn:
        raise FrozenInstanceError(f"cannot {verb} field {name!r}")

    return refused


def _state(names: Sequence[str]) -> dict[str, Callable[..., Any]]:
    """Make the methods that copy and pickle a frozen object with slots."""

    def state_of(self: Any) -> list[Any]:
        return [getattr(self, name) for name in names]

    def restore(self: Any, state: list[Any]) -> None:
        for name, value in zip(names, state, strict=True):
            _set(self, name, value)

    return {"__getstate__": state_of, "__setstate__": restore}
