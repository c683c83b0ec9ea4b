"""The plan language: what plans are written with. Each construct stands on the kernel; its module says what it does.

General layout: ``branches`` is how constructs take their arguments; ``sequence``, ``parallel``, ``ordering`` and
``machine`` are the constructs with branches; ``bounds``, ``budgets``, ``restarting``, ``policies``, ``waiting`` and
``goals`` put conditions on one body; ``recovery`` and ``strategies`` handle failures; ``plans`` and ``tags`` name parts
of a plan. ``performing``, ``requests``, ``location`` and ``resources`` act through the executive of ``executive``.
``running`` runs a plan, ``resuming`` goes on with an interrupted run, ``replaying`` repeats one.
"""

from planlang.language.bounds import timeout, unwind_protect
from planlang.language.budgets import budget
from planlang.language.executive import Executive, ProcessModule
from planlang.language.explaining import explain
from planlang.language.goals import achieve, holds
from planlang.language.location import at_location
from planlang.language.machine import state_machine
from planlang.language.ordering import partial_order
from planlang.language.parallel import par, par_each, pursue, race, try_all
from planlang.language.passing import given
from planlang.language.performing import perform, perform_or
from planlang.language.plans import Plan, plan
from planlang.language.policies import Policy, with_policies
from planlang.language.recovery import PROPAGATE, RETRY, Recovery, Return, retry, with_failure_handling
from planlang.language.requests import Request, monitor, perform_async, with_requests
from planlang.language.resources import using
from planlang.language.restarting import retry_after_suspension
from planlang.language.running import run
from planlang.language.sequence import seq, try_each_in_order, try_in_order
from planlang.language.strategies import ignore, look_and_repeat, look_from_another_place, repeat
from planlang.language.tags import Handle, evaporate, join, on_suspension, suspend, tag, task, task_suspended, wake_up
from planlang.language.tasktree import TaskNode, TaskTree
from planlang.language.waiting import whenever

__all__ = [
    "PROPAGATE",
    "RETRY",
    "Executive",
    "Handle",
    "Plan",
    "Policy",
    "ProcessModule",
    "Recovery",
    "Request",
    "Return",
    "TaskNode",
    "TaskTree",
    "achieve",
    "at_location",
    "budget",
    "evaporate",
    "explain",
    "given",
    "holds",
    "ignore",
    "join",
    "look_and_repeat",
    "look_from_another_place",
    "monitor",
    "on_suspension",
    "par",
    "par_each",
    "partial_order",
    "perform",
    "perform_async",
    "perform_or",
    "plan",
    "pursue",
    "race",
    "repeat",
    "retry",
    "retry_after_suspension",
    "run",
    "seq",
    "state_machine",
    "suspend",
    "tag",
    "task",
    "task_suspended",
    "timeout",
    "try_all",
    "try_each_in_order",
    "try_in_order",
    "unwind_protect",
    "using",
    "wake_up",
    "whenever",
    "with_failure_handling",
    "with_policies",
    "with_requests",
]
