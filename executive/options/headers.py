"""What the header of a trace states of the options of its run."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from typing import Any

from executive.options.declaring import InHeader, declared
from executive.options.running import RunSettings
from planlang.diagnostics import BadInput


def in_header() -> Mapping[str, InHeader]:
    """Options that the header of a trace states, by name."""
    stated = {name: one.declared.in_header for name, one in declared(RunSettings).items()}
    return {name: one for name, one in stated.items() if one is not None}


def header_entries(settings: RunSettings, **instead: Any) -> dict[str, Any]:
    """Make the entries of a header: options that are set, with the values of ``instead`` for some of them.

    A value of ``instead`` may be empty, and is stated then: a robot may have no recognition model.
    """
    values = {name: instead.get(name, given_or(getattr(settings, name))) for name in in_header()}
    return {
        one.key: list(value) if isinstance(value, tuple) else value
        for name, one in in_header().items()
        if (value := values[name]) is not None
    }


def given_or(value: Any, otherwise: Any = None) -> Any:
    """Return the value of an option, or ``otherwise`` for none: for None, False, and what is empty; 0 is a value."""
    return value if value or type(value) in (int, float) else otherwise


def settings_from_header(header: Mapping[str, Any]) -> dict[str, Any]:
    """Options that a resumed run takes from the header of its trace, without those that it cannot have."""
    known, found = declared(RunSettings), dict[str, Any]()
    for option_name, one in in_header().items():
        option, value = known[option_name], header.get(one.key)
        _, is_list = option.kind
        if not one.taken or value is None or (is_list and not isinstance(value, list)):
            continue
        with suppress(ValueError, BadInput):
            found[option_name] = option.value(value)
    return found
