"""The kernel: tasks, a deterministic event loop, integer clock, fluents, hosts. It knows no construct by name.

General layout, each file importing only those above it: ``errors``, ``hosts`` (what lets time pass, and timers),
``signals`` (what can be waited for), ``tree`` (nodes, their names, and the two interfaces through which a run is
recorded). ``core`` is what the rest shares: tasks, the state of a run, how a task waits. On it stand
``tracebacks`` (where tasks are), ``cancel`` (evaporation and suspension), ``schedule``, ``primitives``,
``fluent``, ``threads`` and ``scope``, which constructs are made of. ``event_loop`` drives all that;
``runner`` begins and ends a run, and sees to the process around it.
"""

from planlang.kernel.cancel import checkpoint, shield
from planlang.kernel.core import Scheduler, Task
from planlang.kernel.errors import (
    CleanupOverrun,
    CutShort,
    DeadlockError,
    Evaporated,
    NoProgress,
    PlanStructureError,
    RunError,
    StepLimit,
    StuckTask,
)
from planlang.kernel.fluent import Fluent, WorldFluent, wait_for
from planlang.kernel.hosts import Host, LiveHost, RealTimeHost, SimulationHost, Source, VirtualHost
from planlang.kernel.primitives import node, now, record, rng, sleep
from planlang.kernel.runner import run_plan, unwatched
from planlang.kernel.scope import All, Scope, failure_of
from planlang.kernel.signals import Signal
from planlang.kernel.threads import compute_in_thread, in_thread, still_computing
from planlang.kernel.tree import Observer, Recorded, Status

__all__ = [
    "All",
    "CleanupOverrun",
    "CutShort",
    "DeadlockError",
    "Evaporated",
    "Fluent",
    "Host",
    "LiveHost",
    "NoProgress",
    "Observer",
    "PlanStructureError",
    "RealTimeHost",
    "Recorded",
    "RunError",
    "Scheduler",
    "Scope",
    "Signal",
    "SimulationHost",
    "Source",
    "Status",
    "StepLimit",
    "StuckTask",
    "Task",
    "VirtualHost",
    "WorldFluent",
    "checkpoint",
    "compute_in_thread",
    "failure_of",
    "in_thread",
    "node",
    "now",
    "record",
    "rng",
    "run_plan",
    "shield",
    "sleep",
    "still_computing",
    "unwatched",
    "wait_for",
]
