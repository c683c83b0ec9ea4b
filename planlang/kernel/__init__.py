"""The kernel: tasks, deterministic scheduler, integer clock, fluents, hosts, trace. It knows no construct by name.

General layout: ``scheduler`` is the state of a run, ``rounds`` its loop, ``turn`` what a task does when it is its turn,
``endings`` how a run ends. ``scope`` is what constructs are made of; ``evaporation`` and ``suspension`` say who is
reached; ``primitives`` and ``fluent`` are what a task can wait for; ``hosts`` and ``realtime`` let time pass;
``threads`` runs blocking calls; ``watchdog`` interrupts what never waits; ``park`` is the narrow place where tasks and
scheduler meet; ``trace`` and ``listing`` tell what happened and where.
"""

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
from planlang.kernel.evaporation import shield
from planlang.kernel.expressions import Signal
from planlang.kernel.fluent import Fluent, WorldFluent, wait_for
from planlang.kernel.hosts import Host, SimulationHost, VirtualHost
from planlang.kernel.park import checkpoint
from planlang.kernel.primitives import now, record, rng, sleep
from planlang.kernel.realtime import LiveHost, RealTimeHost, Source
from planlang.kernel.scheduler import Scheduler
from planlang.kernel.scope import All, Scope, failure_of
from planlang.kernel.task import Status, Task
from planlang.kernel.threads import in_thread
from planlang.kernel.trace import Trace, with_paths

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
    "PlanStructureError",
    "RealTimeHost",
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
    "Trace",
    "VirtualHost",
    "WorldFluent",
    "checkpoint",
    "failure_of",
    "in_thread",
    "now",
    "record",
    "rng",
    "shield",
    "sleep",
    "wait_for",
    "with_paths",
]
