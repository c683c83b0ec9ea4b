"""The kernel: tasks, a deterministic event loop, integer clock, fluents, hosts. It knows no construct by name.

General layout, each file importing only those above it: ``errors``, ``hosts`` (what lets time pass, and timers),
``signals`` (what can be waited for), ``tree`` (nodes, their names, and the two interfaces through which a run is
recorded). ``core`` is what the rest shares: tasks, the state of a run, how a task waits. On it stand
``tracebacks`` (where tasks are), ``cancel`` (evaporation and suspension), ``schedule``, ``primitives``,
``fluent``, ``threads`` and ``scope``, which constructs are made of. ``event_loop`` drives all that;
``runner`` begins and ends a run, and sees to the process around it.
"""

from planlang.kernel.cancel import checkpoint as checkpoint
from planlang.kernel.cancel import shield as shield
from planlang.kernel.core import Scheduler as Scheduler
from planlang.kernel.core import Task as Task
from planlang.kernel.errors import CleanupOverrun as CleanupOverrun
from planlang.kernel.errors import CutShort as CutShort
from planlang.kernel.errors import DeadlockError as DeadlockError
from planlang.kernel.errors import Evaporated as Evaporated
from planlang.kernel.errors import NoProgress as NoProgress
from planlang.kernel.errors import PlanStructureError as PlanStructureError
from planlang.kernel.errors import RunError as RunError
from planlang.kernel.errors import StepLimit as StepLimit
from planlang.kernel.errors import StuckTask as StuckTask
from planlang.kernel.fluent import Fluent as Fluent
from planlang.kernel.fluent import WorldFluent as WorldFluent
from planlang.kernel.fluent import wait_for as wait_for
from planlang.kernel.hosts import Host as Host
from planlang.kernel.hosts import LiveHost as LiveHost
from planlang.kernel.hosts import RealTimeHost as RealTimeHost
from planlang.kernel.hosts import SimulationHost as SimulationHost
from planlang.kernel.hosts import Source as Source
from planlang.kernel.hosts import VirtualHost as VirtualHost
from planlang.kernel.primitives import node as node
from planlang.kernel.primitives import now as now
from planlang.kernel.primitives import record as record
from planlang.kernel.primitives import rng as rng
from planlang.kernel.primitives import sleep as sleep
from planlang.kernel.runner import run_plan as run_plan
from planlang.kernel.runner import unwatched as unwatched
from planlang.kernel.scope import All as All
from planlang.kernel.scope import Scope as Scope
from planlang.kernel.scope import failure_of as failure_of
from planlang.kernel.signals import Signal as Signal
from planlang.kernel.threads import compute_in_thread as compute_in_thread
from planlang.kernel.threads import in_thread as in_thread
from planlang.kernel.threads import still_computing as still_computing
from planlang.kernel.tree import Observer as Observer
from planlang.kernel.tree import Recorded as Recorded
from planlang.kernel.tree import Status as Status
