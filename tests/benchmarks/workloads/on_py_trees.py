"""The part of the work that py_trees has: it knows no tasks, and ticks all its nodes in each step."""

from __future__ import annotations

import py_trees

from workloads import STEPS, clock


def spawn(size: int) -> float:
    begin = clock()
    root = py_trees.composites.Parallel("par", py_trees.common.ParallelPolicy.SuccessOnAll())
    root.add_children([py_trees.behaviours.Success(str(number)) for number in range(size)])
    root.tick_once()
    return clock() - begin


def evaporate(size: int) -> float:
    root = py_trees.composites.Parallel("par", py_trees.common.ParallelPolicy.SuccessOnAll())
    root.add_children([py_trees.behaviours.Running(str(number)) for number in range(size)])
    root.tick_once()
    begin = clock()
    root.stop(py_trees.common.Status.INVALID)
    return clock() - begin


def fluent(size: int) -> float:
    board = py_trees.blackboard.Client(name="bench")
    board.register_key("flag", access=py_trees.common.Access.WRITE)
    board.flag = False
    root = py_trees.composites.Parallel("par", py_trees.common.ParallelPolicy.SuccessOnAll())
    compare = py_trees.common.ComparisonExpression("flag", True, lambda left, right: left == right)
    root.add_children([py_trees.behaviours.WaitForBlackboardVariableValue(str(n), compare) for n in range(size)])
    root.tick_once()
    begin = clock()
    board.flag = True
    root.tick_once()
    return clock() - begin


def step(size: int) -> float:
    root = py_trees.composites.Parallel("par", py_trees.common.ParallelPolicy.SuccessOnAll())
    root.add_children([py_trees.behaviours.Running(str(number)) for number in range(size)])
    few = STEPS // 10
    begin = clock()
    for _ in range(few):
        root.tick_once()
    return (clock() - begin) * (STEPS / few)
