"""Conditions about what actions change: contents, heat, devices, things that are destroyed or come into being.

As goals they are looked up in the executive's belief, as :func:`planlang.holding` is.
"""

from __future__ import annotations

from planlang.designators import Condition, Object, local_name
from planlang.misuse import Usage, WrongValue, amount

_DEVICES = {"DeviceStateOn": "on", "DeviceStateOff": "off"}
_CONTAINS = Usage("contains", {"what": "bowl", "substance": "milk"}, {"at_least": "50.0"})
_BAKED = Usage("baked", {"what": "dough"}, {"seconds": "180.0"})
_SWITCHED_ON = Usage("switched_on", {"device": "stove"})
_DESTROYED = Usage("destroyed", {"what": "egg"})
_CREATED = Usage("created", {"what": "dough"})
_TRANSFORMED = Usage("transformed_into", {"what": "egg", "result": "dough"})


def contains(what: Object, substance: Object, at_least: float | None = None) -> Condition:
    """Return the condition that a substance is in a thing, or lies on it: any, or at least an amount [ml]."""
    _CONTAINS.instance("what", what, Object, "an object")
    _CONTAINS.instance("substance", substance, Object, "an object")
    return Condition("contains", (what, substance, *_number(_CONTAINS, "at_least", at_least)))


def baked(what: Object, seconds: float | None = None) -> Condition:
    """Return the condition that both sides were over heat: for some time [s], or as long as its class takes."""
    _BAKED.instance("what", what, Object, "an object")
    return Condition("baked", (what, *_number(_BAKED, "seconds", seconds)))


def switched_on(device: Object) -> Condition:
    """Return the condition that a device is on."""
    _SWITCHED_ON.instance("device", device, Object, "an object")
    return Condition("switched_on", (device,))


def state_word(state: str) -> str:
    """Return what people call a state in which an action puts a thing: on, off, else its name (Clean)."""
    return _DEVICES.get(local_name(state), local_name(state))


def destroyed(what: Object) -> Condition:
    """Return the condition that an object, or one of its class, is not there any more."""
    _DESTROYED.instance("what", what, Object, "an object")
    return Condition("destroyed", (what,))


def created(what: Object) -> Condition:
    """Return the condition that an object, or one of its class, has come into being and is there."""
    _CREATED.instance("what", what, Object, "an object")
    return Condition("created", (what,))


def transformed_into(what: Object, result: Object) -> Condition:
    """Return the condition that an object has become a part of another one, maybe in several steps."""
    _TRANSFORMED.instance("what", what, Object, "an object")
    _TRANSFORMED.instance("result", result, Object, "an object")
    return Condition("transformed_into", (what, result))


def _number(usage: Usage, parameter: str, value: float | None) -> tuple[float, ...]:
    if value is not None and amount(value) is None:
        raise usage.wrong(parameter, value, "a finite number >= 0", WrongValue)
    return () if value is None else (float(value),)
