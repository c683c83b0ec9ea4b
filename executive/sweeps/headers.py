"""Headers of the files of sweeps: what the rows of each variant depend on, and how two sweeps differ."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

Header = dict[str, Any]
CONTENT = "content of "
"""Stands before the name of a file whose digest follows."""
ENVIRONMENT = f"{CONTENT}environment"
"""The map; a number follows of those of further things."""
MOST_NAMED = 5
"""Maximum number of variants that a sentence lists."""
MOST_TOLD = 8
"""Maximum number of differences between variants that are said."""
Part = Mapping[str, Any]
"""What the rows of a variant depend on, by name: arguments, settings, limits, digests of files."""


def parts_of(header: Header) -> dict[str, Part]:
    """Variants -> what their rows depend on; a sweep without variants has one part, called ""."""
    about = header["about"]
    variants = about.get("variants", {})
    names = sorted(variants, key=len, reverse=True)  # as one may begin like another
    found: dict[str, dict[str, Any]] = {"": {}, **{name: {} for name in variants}}
    for key, value in about.items():
        name = next((one for one in names if key.startswith(f"{one}: ")), "")
        if key != "variants":
            found[name][key.removeprefix(f"{name}: ") if name else key] = value
    common = found.pop("") if variants else {}
    return {name: {**common, **own} for name, own in found.items()}


def environments_of(header: Header) -> dict[str, Part]:
    """Variants -> the digests of their maps, by the name in the header; a sweep without variants has one, called ""."""
    return {
        name: {key: value for key, value in part.items() if key.startswith(ENVIRONMENT)}
        for name, part in parts_of(header).items()
    }


def differences(header: Header, other: Header) -> list[str]:
    """Describe how a sweep differs from another one; empty for shards of one sweep."""
    texts = different_parts(header, other)
    if len(header["worlds"]) != len(other["worlds"]):
        texts.append(f"it has {len(header['worlds'])} worlds, not {len(other['worlds'])}")
    elif not texts and header["worlds_sha256"] != other["worlds_sha256"]:
        texts.append("the worlds differ")
    return texts


def different_parts(header: Header, other: Header, *, environments: bool = True) -> list[str]:
    """Describe how a sweep differs from another one beside its worlds, and, unless they count, its environments.

    What differs in the same way in several variants is said once.
    """
    texts = [
        f"{name} is {header[name]}, not {other[name]}" for name in ("version", "job") if header[name] != other[name]
    ]
    here, there = parts_of(header), parts_of(other)
    pairs = [(name, name) for name in here if name in there] or [(name, "") for name in here if "" in there]
    if here.keys() != there.keys():
        texts.append(_other_variants(list(filter(None, here)), list(filter(None, there))))
    found: dict[str, list[str]] = {}
    for name, match in pairs:
        for text in _told(here[name], there[match], environments=environments):
            found.setdefault(text, []).append(name)
    each = [text if len(names) == len(here) else f"{listed(names)}: {text}" for text, names in found.items()]
    texts += each[:MOST_TOLD] + ([f"and {len(each) - MOST_TOLD} more"] if len(each) > MOST_TOLD else [])
    if not texts and header["about"].get("variants") != other["about"].get("variants"):
        texts.append("its variants vary something else")
    return texts


def listed(names: Sequence[str]) -> str:
    """List names of variants, not too many."""
    return ", ".join(names[:MOST_NAMED]) + (", ..." if len(names) > MOST_NAMED else "")


def _other_variants(here: Sequence[str], there: Sequence[str]) -> str:
    if not here:
        return "it has no variants"
    return f"its variants are {listed(here)}" + (f", not {listed(there)}" if there else "")


def _told(one: Part, other: Part, *, environments: bool) -> Iterator[str]:
    """Say what differs between two parts; of what is long only that it does."""
    names = [
        name
        for name in sorted({*one, *other})
        if one.get(name) != other.get(name) and (environments or not name.startswith(ENVIRONMENT))
    ]
    contents = [name.removeprefix(CONTENT) for name in names if name.startswith(CONTENT)]
    for name in names:
        if name.startswith(CONTENT) or (name == "settings" and "arguments" in names):  # of which settings are a part
            continue
        if name == "arguments" and name in one and name in other:
            yield _other_words(one[name], other[name])
        elif isinstance(one.get(name), dict | list) or isinstance(other.get(name), dict | list):
            yield f"other {name}" if name.endswith("s") else f"another {name}"
        else:
            verb = "are" if name.endswith("s") else "is"
            yield f"{name} {verb} {one.get(name)!s:.200}, not {other.get(name)!s:.200}"
    if contents:
        yield f"other contents of {', '.join(contents)}"


def _other_words(one: str, other: str) -> str:
    """Say in which options two commands differ."""
    (first, *options), (other_first, *other_options) = (str(call).split(" --") for call in (one, other))
    own = [f"--{text}" for text in options if text not in other_options]
    lacking = [f"--{text}" for text in other_options if text not in options]
    if first != other_first:
        own, lacking = [first, *own], [other_first, *lacking]
    if own and lacking:
        return f"{' '.join(own)}, not {' '.join(lacking)}"
    return (
        f"with {' '.join(own)}" if own else f"without {' '.join(lacking)}" if lacking else "arguments in another order"
    )
