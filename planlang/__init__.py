"""The names that plans import, and the functions of planlang as a library."""

from importlib import import_module
from typing import TYPE_CHECKING

from planlang.designators import (
    Action,
    Condition,
    Device,
    Location,
    Object,
    Person,
    Posture,
    Relation,
    Situation,
    a_device,
    a_location,
    a_person,
    a_posture,
    a_situation,
    action,
    action_class,
    an_object,
    holding,
    located,
)
from planlang.failures import PlanFailure
from planlang.kernel import (
    CleanupOverrun,
    DeadlockError,
    Evaporated,
    Fluent,
    Host,
    NoProgress,
    PlanStructureError,
    RealTimeHost,
    RunError,
    Signal,
    SimulationHost,
    Status,
    StepLimit,
    StuckTask,
    VirtualHost,
    checkpoint,
    in_thread,
    now,
    rng,
    shield,
    sleep,
    wait_for,
)
from planlang.language.branches import (
    par,
    par_each,
    pursue,
    race,
    seq,
    try_all,
    try_each_in_order,
    try_in_order,
    unwind_protect,
)
from planlang.language.budgets import budget, timeout
from planlang.language.conditions import Policy, achieve, holds, whenever, with_policies
from planlang.language.executive import Executive
from planlang.language.location import at_location
from planlang.language.performing import Request, monitor, perform, perform_async, with_requests
from planlang.language.plans import (
    Handle,
    Plan,
    evaporate,
    join,
    on_suspension,
    plan,
    retry_after_suspension,
    suspend,
    tag,
    task,
    task_suspended,
    wake_up,
)
from planlang.language.process_module import ProcessModule
from planlang.language.recovery import (
    PROPAGATE,
    RETRY,
    Recovery,
    RecoveryResult,
    Return,
    explain,
    retry,
    with_failure_handling,
)
from planlang.language.resources import using
from planlang.language.running import run
from planlang.object_changes import baked, contains, created, destroyed, switched_on, transformed_into
from planlang.recoveries import (
    fetch_again,
    ignore,
    look_and_repeat,
    look_from_another_place,
    open_what_is_in_the_way,
    put_down_and_regrasp,
    recovery_strategy,
    step_back_and_repeat,
)
from planlang.runs import Trace

__all__ = [
    "PROPAGATE",
    "RETRY",
    "Action",
    "CleanupOverrun",
    "Condition",
    "DeadlockError",
    "Device",
    "Evaporated",
    "Executive",
    "Feature",
    "Fluent",
    "Handle",
    "Host",
    "Location",
    "MotionConstraint",
    "NoProgress",
    "Object",
    "Person",
    "Plan",
    "PlanFailure",
    "PlanStructureError",
    "Policy",
    "Posture",
    "ProcessModule",
    "RealTimeHost",
    "Recovery",
    "RecoveryResult",
    "Relation",
    "Request",
    "Return",
    "RunError",
    "Signal",
    "SimulationHost",
    "Situation",
    "Status",
    "StepLimit",
    "StuckTask",
    "TaskNode",
    "TaskTree",
    "Trace",
    "VirtualHost",
    "a_constraint",
    "a_device",
    "a_feature",
    "a_location",
    "a_person",
    "a_posture",
    "a_situation",
    "achieve",
    "action",
    "action_class",
    "an_object",
    "at_location",
    "baked",
    "budget",
    "checkpoint",
    "contains",
    "created",
    "destroyed",
    "evaporate",
    "explain",
    "fetch_again",
    "given",
    "holding",
    "holds",
    "ignore",
    "in_thread",
    "join",
    "located",
    "look_and_repeat",
    "look_from_another_place",
    "monitor",
    "now",
    "on_suspension",
    "open_what_is_in_the_way",
    "par",
    "par_each",
    "partial_order",
    "perform",
    "perform_async",
    "plan",
    "process_module",
    "pursue",
    "put_down_and_regrasp",
    "race",
    "recovery_strategy",
    "retry",
    "retry_after_suspension",
    "rng",
    "run",
    "seq",
    "shield",
    "sleep",
    "state_machine",
    "step_back_and_repeat",
    "suspend",
    "switched_on",
    "tag",
    "task",
    "task_suspended",
    "timeout",
    "transformed_into",
    "try_all",
    "try_each_in_order",
    "try_in_order",
    "unwind_protect",
    "using",
    "wait_for",
    "wake_up",
    "whenever",
    "with_failure_handling",
    "with_policies",
    "with_requests",
]


# The library's functions stay out of __all__: `from planlang import *` in a plan would hide Python's own compile.
if TYPE_CHECKING:
    from executive.library.recipes import check as check
    from executive.library.recipes import compile as compile
    from executive.library.worlds import locate as locate
    from executive.library.worlds import simulate as simulate
    from executive.library.worlds import sweep as sweep
    from planlang.diagnostics import BadInput as BadInput
    from planlang.language.ordering import given, partial_order
    from planlang.language.process_module import process_module
    from planlang.language.state_machine import state_machine
    from planlang.language.tasktree import TaskTree
    from planlang.motion_constraints import Feature, MotionConstraint, a_constraint, a_feature
    from planlang.runs.run_tree import TaskNode

    __version__: str
else:  # with a __getattr__ in its sight, mypy would accept any name
    _LATER = {
        **dict.fromkeys(("check", "compile"), "executive.library.recipes"),
        **dict.fromkeys(("locate", "simulate", "sweep"), "executive.library.worlds"),
        "BadInput": "planlang.diagnostics",
        "Feature": "planlang.motion_constraints",
        "MotionConstraint": "planlang.motion_constraints",
        "TaskNode": "planlang.runs.run_tree",
        "TaskTree": "planlang.language.tasktree",
        "a_constraint": "planlang.motion_constraints",
        "a_feature": "planlang.motion_constraints",
        "given": "planlang.language.ordering",
        "partial_order": "planlang.language.ordering",
        "process_module": "planlang.language.process_module",
        "state_machine": "planlang.language.state_machine",
    }

    def __getattr__(name: str) -> object:
        """Import on first use what few plans need: partial orders, constraints, process modules, the library."""
        if name in _LATER:
            return getattr(import_module(_LATER[name]), name)
        if name != "__version__":
            raise AttributeError(f"module 'planlang' has no attribute {name!r}")
        from importlib.metadata import version

        return version("planlang")

    def __dir__() -> list[str]:
        return sorted({*globals(), *_LATER})
