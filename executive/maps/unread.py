"""What becomes of things that a map states and that cannot be read: an error, unless the user goes on without them.

Unread is whatever has a shape or a pose and is not in the world as the map states it: an obstacle that nobody sees, a
thing at another place. Where a map states no shape at all, nothing is unread: the object is a mere place.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from planlang.diagnostics import BadInput, Diagnostic, Severity, has_errors


def settled(found: Iterable[Diagnostic], *, ignore_unread: bool) -> list[Diagnostic]:
    """Return the diagnostics of reading a map; with ``ignore_unread``, its errors are warnings.

    Otherwise raises BadInput with all of them if one is an error.
    """
    found = list(found)
    if not ignore_unread and has_errors(found):
        raise BadInput(found)
    return [replace(one, severity=Severity.WARNING) if one.severity is Severity.ERROR else one for one in found]
