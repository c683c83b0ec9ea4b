"""Variants of a sweep: the same worlds with other options, made of what varies."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import product
from typing import Any

from executive.options.declaring import Stated, declared
from executive.options.running import RunSettings, SituationSettings, SweepOptions
from planlang.diagnostics import BadInput, WrongOption
from planlang.records import dataclass
from planlang.spelling import guess, similar
from planlang.words import Option, Text, word_of

MOST_VARIANTS = 50
"""Maximum number of variants."""
OF_ROWS = (
    *("world", "repeat", "variant", "seed", "outcome", "reached", "claimed"),
    *("failure", "message", "duration", "final_state", "largest_tilts", "faults"),
)
"""Columns of rows that no parameter of a plan may take."""
PARAMETER = "set."
"""Stands before the name of a parameter that is called like an option or a column of rows."""
CERTAIN = 0.9
"""Similarity to an option from which a name is taken for a misspelling of it: parameters are known too late."""


@dataclass(frozen=True, slots=True)
class Variant:
    """A named setting of a sweep."""

    name: str
    settings: Mapping[str, Any]
    """Its options by name; ``set`` has only parameters that it binds itself."""
    columns: Mapping[str, str]
    """What varies in the sweep, in this variant: columns of its rows, empty for what it leaves at its default."""

    def options(self, common: SweepOptions) -> SweepOptions:
        """Options of a sweep of this variant alone."""
        return replace(common, **_together(common, self.settings), vary=None, variant=None)

    def key(self, seed: int) -> str:
        """Key of a world with this variant."""
        return f"{self.name} {seed}"


def variants_of(options: SweepOptions) -> tuple[Variant, ...]:
    """Variants of a sweep: each that has a label, with each combination of what varies; none if nothing does.

    Raises WrongOption, or BadInput for a value.
    """
    named: Sequence[tuple[str, Mapping[str, Any]]] = [
        (label, _of_words(label, own) if isinstance(own, list) else _of_values(label, own))
        for label, own in (options.variant or {}).items()
    ]
    varied = [[(name, *_setting(name, value)) for value in values] for name, values in (options.vary or {}).items()]
    number = math.prod(map(len, varied), start=max(1, len(named)))
    if number > MOST_VARIANTS:
        raise WrongOption(f"these are {number:,} variants; at most {MOST_VARIANTS} are run")
    _check_once(named, varied)
    found: dict[str, Mapping[str, Any]] = {}
    for label, own in named or ([("", {})] if varied else []):
        for chosen in product(*varied):
            texts = (
                f"{name}={_text(_parameter(name, value) if key == 'set' else value)}" for name, key, value in chosen
            )
            name = " ".join(filter(None, (label, *texts)))
            if name in found:
                raise WrongOption(f"two variants are called {name}")
            found[name] = _merged(own, chosen)
    return tuple(_with_columns(found, options))


def _check_once(
    named: Sequence[tuple[str, Mapping[str, Any]]], varied: Sequence[Sequence[tuple[str, str, Any]]]
) -> None:
    """Check that nothing varies under two names, or is set by a variant with a label, too. Raises WrongOption."""
    once = dict[str, str]()
    for (name, key, value), *_ in varied:
        (column,) = _flat({key: value})
        if column in once:
            raise WrongOption(f"{once[column]} and {name} vary the same")
        once[column] = name
    for label, own in named:
        if twice := next((column for column in _flat(own) if column in once), None):
            raise WrongOption(f"variant {label} sets {twice}, which ", Option("vary"), " varies")


def _merged(own: Mapping[str, Any], chosen: Sequence[tuple[str, str, Any]]) -> Mapping[str, Any]:
    settings = dict(own)
    for _, key, value in chosen:
        settings[key] = {**settings.get("set", {}), **value} if key == "set" else value
    return settings


def _with_columns(found: Mapping[str, Mapping[str, Any]], options: SweepOptions) -> Iterator[Variant]:
    """Yield variants whose rows have a column for each option and parameter that any of them sets."""
    names = dict.fromkeys(name for settings in found.values() for name in _flat(settings))
    for name, settings in found.items():
        whole = _flat(_together(options, settings))
        common = {**_flat({key: getattr(options, key) for key in _varying()}), **whole}
        cells = {one: _text(common[one]) if common.get(one) is not None else "" for one in names}
        yield Variant(name, settings, cells)


def _flat(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Options and parameters by the names of their columns."""
    flat = {name: value for name, value in settings.items() if name != "set"}
    return flat | {_column(name): value for name, value in (settings.get("set") or {}).items()}


def _column(parameter: str) -> str:
    return f"{PARAMETER}{parameter}" if parameter in OF_ROWS or parameter in _varying() else parameter


def _together(common: SweepOptions, settings: Mapping[str, Any]) -> dict[str, Any]:
    """Settings of a variant, with parameters that the whole sweep binds."""
    whole = dict(settings)
    if "set" in whole:
        whole["set"] = {**(common.set or {}), **whole["set"]}
    return whole


def _varying() -> Mapping[str, Stated]:
    """Options that may vary: those of the situation, the recipe, and the interpreter."""
    of_sweep = declared(SweepOptions)
    return {name: of_sweep[name] for name in (*declared(SituationSettings), "recipe", "python") if name in of_sweep}


def _setting(name: str, given: Any) -> tuple[str, Any]:
    """The option that a varied name means, and its value; any other name is a parameter."""
    known, key = _varying(), name.lstrip("-").replace("-", "_")
    if key in known and key != "set":
        try:
            return key, known[key].read([_at_home(given)]) if isinstance(given, str) else known[key].value(given)
        except ValueError as problem:
            raise WrongOption(Option("vary", {name: given}), f": {problem}") from None
        except BadInput as problem:
            first = problem.diagnostics[0].message
            advice = "; commas separate values: repeat the name for values that have some"
            raise WrongOption(Option("vary", {name: given}), ": ", first, advice) from None
    if key == "seed":
        raise WrongOption("seeds are those of the worlds: ", Option("first"), " and ", Option("worlds"), " state them")
    if key in known or key in declared(SweepOptions) or key in declared(RunSettings):
        raise WrongOption(f"{name} is no option of which a sweep runs variants")
    if not name.startswith(PARAMETER) and (alike := similar(key, known, least=CERTAIN)):
        advice = f"did you mean {alike[0]}? A parameter that is called so is {PARAMETER}{name}"
        raise WrongOption(Option("vary", {name: given}), f": there is no such option; {advice}")
    return "set", {name.removeprefix(PARAMETER): str(given)}


def _parameter(name: str, value: Mapping[str, str]) -> str:
    return value[name.removeprefix(PARAMETER)]


def _of_values(label: str, own: Mapping[str, Any]) -> Mapping[str, Any]:
    """Settings from options of Python."""
    settings, known = dict[str, Any](), _varying()
    for name, given in own.items():
        if name not in known:
            raise WrongOption(f"variant {label}: there is no option {name!r}", _guessed(name))
        try:
            settings[name] = known[name].value(given)
        except ValueError as problem:
            raise WrongOption(f"variant {label}: {name}={given!r}: {problem}") from None
    return settings


def _of_words(label: str, words: Sequence[str]) -> Mapping[str, Any]:
    """Settings from words of the command line: options, and at most one recipe or plan."""
    known = _varying()
    names = {word: name for name, one in known.items() for word in one.declared.words or (word_of(name),)}
    texts: dict[str, list[str]] = {}
    rest = list(words)
    while rest:
        word, equals, text = rest.pop(0).partition("=")
        if not word.startswith("--"):
            word, name, text = "", "recipe", word + equals + text
        elif word not in names:
            alike = guess(word, names).strip()
            raise WrongOption(f"variant {label}: there is no option {word}", f"; {alike}" if alike else "")
        else:
            name = names[word]
            if known[name].worded == (bool, False):
                text = text or "true"
            elif not equals:
                if not rest:
                    raise WrongOption(f"variant {label}: {word} needs a value")
                text = rest.pop(0)
        texts.setdefault(name, []).append(_at_home(text))
    settings = dict[str, Any]()
    for name, given in texts.items():
        try:
            settings[name] = known[name].read(given)
        except ValueError as problem:
            raise WrongOption(f"variant {label}: {name} {given[-1]}: {problem}") from None
        except BadInput as problem:
            raise WrongOption(f"variant {label}: ", problem.diagnostics[0].message) from None
    return settings


def _at_home(text: str) -> str:
    """Expand ``~/``, which a shell leaves alone within quotes and behind an equals sign."""
    return os.path.expanduser(text) if text.startswith("~/") else text


def _guessed(name: str) -> Text:
    guessed = guess(name.replace("-", "_"), _varying()).strip()
    return Text(f"; {guessed}" if guessed else "")


def _text(value: Any) -> str:
    """The value of an option, as the command line has it."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, tuple):
        return ",".join(f"{number:g}" for number in value)
    if isinstance(value, list):
        return ",".join(map(_text, value))
    if isinstance(value, str | os.PathLike):
        return os.fspath(value) if "\n" not in os.fspath(value) else "a text"
    return str(value)
