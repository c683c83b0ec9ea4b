"""What varies in a sweep: values of options by name, and variants with options of their own, of text or of Python."""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Mapping
from typing import Any

from planlang.diagnostics import WrongOption
from planlang.words import Option

LONGEST_LABEL = 80
"""Maximum length of a variant's name that a user states [characters]."""


def varied(given: Any) -> dict[str, list[Any]]:
    """Names -> values, of a mapping or of texts NAME=V1,V2. Raises WrongOption.

    Commas separate values where a name is stated once; stated several times, it has one value in each, commas and all.
    """
    if isinstance(given, Mapping):
        return {str(name): _listed(name, values) for name, values in given.items()}
    found: dict[str, list[str]] = {}
    for text in [given] if isinstance(given, str) else given:
        name, equals, values = (part.strip() for part in str(text).partition("="))
        if not (name and equals and values):
            example = Option("vary", {"robot": "amigo,pr2"})
            raise WrongOption(f"{text!r} is not NAME=VALUE,VALUE; write for example ", example)
        found.setdefault(name, []).append(values)
    split = {name: texts if len(texts) > 1 else texts[0].split(",") for name, texts in found.items()}
    return {name: _each_once(name, [one.strip() for one in texts]) for name, texts in split.items()}


def labelled(given: Any) -> dict[str, Mapping[str, Any] | list[str]]:
    """Labels -> options, of a mapping, or their words of texts "LABEL: --robot my.toml". Raises WrongOption."""
    if isinstance(given, Mapping):
        for label, options in given.items():
            if not isinstance(options, Mapping):
                raise WrongOption(f"variant {_label(label)!r}: write its options as a dictionary")
        return {_label(label): dict(options) for label, options in given.items()}
    found: dict[str, Mapping[str, Any] | list[str]] = {}
    for text in [given] if isinstance(given, str) else given:
        label, colon, words = str(text).partition(":")
        if not colon:
            example = Option("variant", {"mine": {"robot": "my.toml"}})
            raise WrongOption(f"{text!r} is not LABEL: OPTIONS; write for example ", example)
        if (label := _label(label)) in found:
            raise WrongOption(f"two variants are called {label}")
        try:
            found[label] = shlex.split(words)
        except ValueError as problem:
            raise WrongOption(f"variant {label}: {str(problem).lower()}") from None
    return found


def _label(given: Any) -> str:
    """Check the name of a variant, which stands in tables and in keys of worlds."""
    label = " ".join(str(given).split())
    if not label or len(label) > LONGEST_LABEL or not label.isprintable():
        raise WrongOption(
            f"{str(given)[:100]!r} cannot be the name of a variant: write 1 to {LONGEST_LABEL} characters"
        )
    return label


def _listed(name: Any, values: Any) -> list[Any]:
    if isinstance(values, str | bytes | Mapping) or not isinstance(values, Iterable):
        raise WrongOption(f"{name}={values!r}: write the values of what varies as a list")
    return _each_once(name, list(values))


def _each_once(name: Any, values: list[Any]) -> list[Any]:
    """Check that there are values, none of them empty or stated twice."""
    if not values or "" in values:
        raise WrongOption(f"a value of {name} is empty")
    if twice := [one for number, one in enumerate(values) if one in values[:number]]:
        raise WrongOption(f"{name}={twice[0]} is stated twice")
    return values
