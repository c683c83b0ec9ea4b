"""Testing plans in virtual time, with scripted robots, injected faults, and all possible schedules of the tasks.

General layout: ``running`` runs a plan; ``script`` and ``scripted`` are the robot, in whose steps ``planlang.faults``
injects failures; ``history`` answers questions from the trace; ``exploring`` searches for schedules that change the
outcome; ``extensions`` enumerates the orders of a partial order; ``plugin`` is the pytest plugin, with tests in many
``worlds``.
"""

from planlang.faults.steps import Fault
from planlang.runs import TaskNode as Step
from planlang.testing.exploring import Exploration, ScheduleDependence, explore
from planlang.testing.extensions import Extensions, all_linear_extensions
from planlang.testing.history import Count, History, NoSuchStep, Verdict
from planlang.testing.running import PlanRun, UnusedRule, compiled, replay, run_plan
from planlang.testing.script import Belief, Rule, Script
from planlang.testing.scripted import ScriptedExecutive

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
    "UnusedRule",
    "Verdict",
    "all_linear_extensions",
    "compiled",
    "explore",
    "replay",
    "run_plan",
]
