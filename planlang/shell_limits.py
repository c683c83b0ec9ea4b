"""Limits of resources that the shell, a service manager or a batch system has set for this process and its children."""

from __future__ import annotations

try:
    import resource
except ImportError:  # not on Windows
    resource = None  # type: ignore[assignment]

_NAMES = {"RLIMIT_CPU": ("-t", 1, " s of CPU time"), "RLIMIT_AS": ("-v", 1_000_000, " MB of memory")}
_NAMES |= {"RLIMIT_DATA": ("-d", 1_000_000, " MB of data"), "RLIMIT_FSIZE": ("-f", 1_000_000, " MB for a file")}
"""Limits that are not set by default: the option of ``ulimit``, the unit of the number shown, its name."""


def cpu_seconds() -> int | None:
    """Return the limit of CPU time [s]; None without one."""
    return None if resource is None else inherited(resource.RLIMIT_CPU)


def inherited(kind: int) -> int | None:
    """Return a limit of resources, such as ``RLIMIT_AS``; None without one."""
    soft, hard = resource.getrlimit(kind)
    stated = [one for one in (soft, hard) if one != resource.RLIM_INFINITY]
    return min(stated, default=None)


def lower(kind: int, amount: int) -> int:
    """Limit this process to ``amount``, or to what it inherited if that is less; return which of them it is."""
    most = inherited(kind)
    kept = amount if most is None else min(amount, most)
    resource.setrlimit(kind, (kept, kept))
    return kept


def stated() -> str:
    """List the limits that somebody has set, for a message: ``100 s of CPU time (ulimit -t)``; "" without any."""
    if resource is None:
        return ""
    known = ((getattr(resource, name), shown) for name, shown in _NAMES.items() if hasattr(resource, name))
    found = ((inherited(kind), *shown) for kind, shown in known)
    return ", ".join(
        f"{most / unit:g}{what} (ulimit {option})" for most, option, unit, what in found if most is not None
    )
