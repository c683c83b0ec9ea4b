"""One task of a home: its files, its run, and what is kept of it."""

from __future__ import annotations

import time
import traceback
from collections import defaultdict
from collections.abc import Sequence
from contextlib import chdir
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from executive.maps import read_map, scene_of
from executive.robots import Robot, bind_robot
from planlang.diagnostics import BadInput
from planlang.ontology import load
from sim import Scene
from sim.joints import JointKind
from sim.tolerances import SHUT_SHARE
from sim.truth import opened
from tests.benchmarks.homes import (  # noqa: F401  they register their templates
    closed_tasks,
    door_tasks,
    flat_tasks,
    further_tasks,
    more_tasks,
    open_tasks,
)
from tests.benchmarks.homes.furnishing import NoRoom
from tests.benchmarks.homes.robots import OPTIONS, named
from tests.benchmarks.homes.series import Case
from tests.benchmarks.homes.tasks import Need, Task, drawn
from tests.benchmarks.homes.witness import Verdict, Witness, suited_to
from tests.benchmarks.homes.written import map_text, recipe_text
from tests.support.scenarios import Scenario, Watched, judged

SERVED = 0.5
"""Share of its range by which a leaf has to be open to count as opened."""


def task_of(case: Case) -> Task:
    """Return the task of a case: in a home with things that the robot can hold."""
    return drawn(case.template, case.seed, suited_to(robot_of(case.robot)))


@cache
def robot_of(name: str) -> Robot:
    """Return a robot of the benchmark."""
    return bind_robot(named(name))


def job(world: dict[str, Any]) -> dict[str, Any]:
    """Do the case of a world of a sweep; return its row."""
    case = Case(world["template"], world["seed"], world["robot"], world["displaced"])
    return run(case, world.get("witnessed", "failed"))


def certify(world: dict[str, Any]) -> dict[str, Any]:
    """Ask the witness about the case of a world of a sweep, in the home as its map says; return the row."""
    case = Case(world["template"], world["seed"], world["robot"])
    task = task_of(case)
    with TemporaryDirectory() as folder:
        scene = scene_of(read_map(load(write(task, case.seed, Path(folder))[1])))
    found = verdict(task, scene, case.robot)
    return {"template": case.template, "seed": case.seed, "robot": case.robot, "outcome": found.answer.value} | {
        "witness": found.row()
    }


def write(task: Task, seed: int, folder: Path) -> tuple[Path, Path]:
    """Write the files of a task; return recipe and map."""
    recipe, home = folder / f"{task.template}_{seed}.recipe.omn", folder / f"{task.template}_{seed}.map.omn"
    recipe.write_text(task.recipe or recipe_text(task.steps, task.home), encoding="utf-8")
    home.write_text(map_text(task.home), encoding="utf-8")
    return recipe, home


def run(case: Case, witnessed: str = "failed") -> dict[str, Any]:
    """Run a task; return its row. The witness decides if the task is possible: "all", "failed" or "none" of them."""
    began, cpu = time.perf_counter(), time.process_time()
    row: dict[str, Any] = {"template": case.template, "seed": case.seed, "robot": case.robot}
    row["displaced"] = case.displaced
    try:
        task = task_of(case)
    except NoRoom as problem:
        return row | {"outcome": "not drawn", "cause": str(problem)}
    with TemporaryDirectory() as folder, chdir(folder):
        recipe, home = write(task, case.seed, Path(folder))
        trial = Trial(task)
        row |= trial.run(case, arguments(case, task, recipe, home))
        row |= {"wall": round(time.perf_counter() - began, 1), "cpu": round(time.process_time() - cpu, 1)}
        if witnessed == "all" or (witnessed == "failed" and not row.get("reached")):
            scene = trial.scene or scene_of(read_map(load(home)))
            row["witness"] = verdict(task, scene, case.robot).row()
    return row


def arguments(case: Case, task: Task, recipe: Path, home: Path) -> tuple[str, ...]:
    """Return what ``planlang run`` gets for a task that was written to files, but for the seed."""
    unknown = [word for name in task.unknown for word in ("--unknown", name)]
    named_files = str(recipe), "--robot", named(case.robot), "--environment", str(home)
    return (*named_files, *OPTIONS.get(case.robot, ()), *unknown)


def verdict(task: Task, scene: Scene, robot: str) -> Verdict:
    """Return what the witness says of a task in a true scene."""
    witness = Witness(scene, robot_of(robot))
    try:
        return witness.decide(task.needs)
    finally:
        witness.close()


class Trial:
    """A run of a task, watched."""

    def __init__(self, task: Task) -> None:
        self.task = task
        self.scene: Scene | None = None
        """The scene as it really was, None if the run did not begin."""
        self.harm: list[str] = []
        self.widest: dict[str, float] = defaultdict(float)
        self.last: dict[str, float] = defaultdict(float)

    def run(self, case: Case, arguments: Sequence[str]) -> dict[str, Any]:
        """Run it; return what is kept of it."""
        return self.judged(arguments, case.seed + 1 if case.displaced else 0)

    def judged(self, arguments: Sequence[str], seed: int) -> dict[str, Any]:
        """Run it in the world of a seed; return what is kept of it."""
        task = self.task
        scenario = Scenario(task.template, arguments, self._goal, (*task.watchers, self._watch))
        try:
            found = judged(scenario, seed)
        except BadInput as problem:
            return {"outcome": "bad input", "cause": "; ".join(str(one) for one in problem.diagnostics[:3])}
        except Exception:
            return {"outcome": "internal error", "cause": traceback.format_exc()[-1500:]}
        return {
            "outcome": found.result.outcome.value,
            "reached": found.reached,
            "unmet": list(found.unmet),
            "harm": self.harm,
            "failure": list(found.result.failures),
            "message": found.result.message[:2000],
            "duration": round(found.result.duration, 1),
            "leaves": self._served(),
        }

    def _goal(self, watched: Watched) -> list[str]:
        self.harm = list(self.task.unharmed(watched))
        return [*self.task.wanted(watched), *self.harm]

    def _watch(self, watched: Watched) -> None:
        self.scene = self.scene or watched.world.scene
        for joint in self.scene.joints:
            self.last[joint.leaf] = opened(watched.world, joint.leaf)
            self.widest[joint.leaf] = max(self.widest[joint.leaf], self.last[joint.leaf])

    def _served(self) -> dict[str, list[int]]:
        """Return for "open" and "close" how many leaves were to be opened or closed, and how many were."""
        wanted = {kind: [one for one in self.task.needs if one.kind == kind] for kind in ("open", "close")}
        wide = [need for need in wanted["open"] if any(self.widest[leaf] >= SERVED for leaf in self._leaves(need))]
        shut = [
            need
            for need in wanted["close"]
            if any(self.widest[leaf] >= SERVED for leaf in self._leaves(need))
            and all(self.last[leaf] <= SHUT_SHARE for leaf in self._leaves(need))
        ]
        return {"open": [len(wanted["open"]), len(wide)], "close": [len(wanted["close"]), len(shut)]}

    def _leaves(self, need: Need) -> list[str]:
        """Return the leaf of a need; of two doors side by side either will do."""
        joints = () if self.scene is None else self.scene.joints
        kinds = {joint.leaf: joint.kind for joint in joints}
        doors = [one.leaf for one in joints if one.holder == need.at and one.kind is JointKind.HINGED]
        return doors if need.either and kinds.get(need.thing) is JointKind.HINGED else [need.thing]
