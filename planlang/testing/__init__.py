"""Testing plans: in virtual time, with scripted robots, injected faults, and every order that tasks could run in.

General layout: ``running`` runs a plan; ``script``, ``scripted`` and ``belief`` are the robot, ``faults`` what goes
wrong; ``history``, ``steps`` and ``verdicts`` answer questions from the trace; ``exploring`` looks for schedules that
matter, with ``schedules``, ``shrinking`` and ``columns``; ``extensions`` are orders, ``plugin`` is for pytest.
"""

from planlang.testing.exploring import Exploration, ScheduleDependence, explore
from planlang.testing.extensions import Extensions, all_linear_extensions
from planlang.testing.faults import Fault
from planlang.testing.history import Count, History, NoSuchStep, Verdict
from planlang.testing.running import PlanRun, compiled, replay, run_plan
from planlang.testing.script import Belief, Rule, Script
from planlang.testing.scripted import ScriptedExecutive
from planlang.testing.steps import Step

__all__ = [
    "Belief",
    "Count",
    "Exploration",
    "Extensions",
    "Fault",
    "History",
    "NoSuchStep",
    "PlanRun",
    "Rule",
    "ScheduleDependence",
    "Script",
    "ScriptedExecutive",
    "Step",
    "Verdict",
    "all_linear_extensions",
    "compiled",
    "explore",
    "replay",
    "run_plan",
]
