"""Conditions on what actions change: contents, baking, devices, destroyed and created objects.

As goals they are evaluated in the executive's belief, like :func:`planlang.holding`.
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
    """Condition: an object contains a substance or has it on top; any amount, or ``at_least`` [ml]."""
    _CONTAINS.instance("what", what, Object, "an object")
    _CONTAINS.instance("substance", substance, Object, "an object")
    return Condition("contains", (what, substance, *_number(_CONTAINS, "at_least", at_least)))


def baked(what: Object, seconds: float | None = None) -> Condition:
    """Condition: both sides were heated for ``seconds``, by default as long as its class takes."""
    _BAKED.instance("what", what, Object, "an object")
    return Condition("baked", (what, *_number(_BAKED, "seconds", seconds)))


def switched_on(device: Object) -> Condition:
    """Condition: a device is on."""
    _SWITCHED_ON.instance("device", device, Object, "an object")
    return Condition("switched_on", (device,))


def state_word(state: str) -> str:
    """Return the everyday word for a state: on, off, or else its local name (Clean)."""
    return _DEVICES.get(local_name(state), local_name(state))


def destroyed(what: Object) -> Condition:
    """Condition: an object, or one of its class, no longer exists."""
    _DESTROYED.instance("what", what, Object, "an object")
    return Condition("destroyed", (what,))


def created(what: Object) -> Condition:
    """Condition: an object, or one of its class, was created and exists."""
    _CREATED.instance("what", what, Object, "an object")
    return Condition("created", (what,))


def transformed_into(what: Object, result: Object) -> Condition:
    """Condition: an object has become part of another one, perhaps in several steps."""
    _TRANSFORMED.instance("what", what, Object, "an object")
    _TRANSFORMED.instance("result", result, Object, "an object")
    return Condition("transformed_into", (what, result))


def _number(usage: Usage, parameter: str, value: float | None) -> tuple[float, ...]:
    if value is not None and amount(value) is None:
        raise usage.wrong(parameter, value, "a finite number >= 0", WrongValue)
    return () if value is None else (float(value),)
