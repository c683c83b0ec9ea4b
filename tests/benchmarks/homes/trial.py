"""One task of a home: its files, its run, and what is kept of it."""

from __future__ import annotations

import time
import traceback
from contextlib import chdir
from pathlib import Path
from tempfile import TemporaryDirectory

from planlang.diagnostics import BadInput
from tests.benchmarks.homes import closed_tasks, open_tasks  # noqa: F401  they register their templates
from tests.benchmarks.homes.furnishing import NoRoom
from tests.benchmarks.homes.tasks import drawn
from tests.benchmarks.homes.written import map_text, recipe_text
from tests.support.scenarios import Scenario, judged

OPTIONS = {"panda": ("--trust-map",)}


def write(template: str, seed: int, folder: Path) -> tuple[Path, Path]:
    """Write the files of a task; return recipe and map."""
    task = drawn(template, seed)
    recipe, home = folder / f"{template}_{seed}.recipe.omn", folder / f"{template}_{seed}.map.omn"
    recipe.write_text(recipe_text(task.steps, task.home), encoding="utf-8")
    home.write_text(map_text(task.home), encoding="utf-8")
    return recipe, home


def run(template: str, seed: int, robot: str, displaced: bool = False) -> dict[str, object]:
    """Run a task; return what there is to say of it."""
    began, cpu = time.perf_counter(), time.process_time()
    row: dict[str, object] = {"template": template, "seed": seed, "robot": robot}
    try:
        task = drawn(template, seed)
    except NoRoom as problem:
        return row | {"outcome": "not drawn", "cause": str(problem)}
    with TemporaryDirectory() as folder, chdir(folder):
        recipe, home = write(template, seed, Path(folder))
        more = [word for name in task.unknown for word in ("--unknown", name)]
        arguments = (str(recipe), "--robot", robot, "--environment", str(home), *OPTIONS.get(robot, ()), *more)
        try:
            found = judged(Scenario(template, arguments, task.goal, task.watchers), seed if displaced else 0)
            row |= {
                "outcome": found.result.outcome.value,
                "reached": found.reached,
                "unmet": list(found.unmet),
                "failure": list(found.result.failure),
                "message": found.result.message[:2000],
                "plan_seconds": round(found.result.seconds, 1),
            }
        except BadInput as problem:
            row |= {"outcome": "bad input", "cause": "; ".join(str(one) for one in problem.diagnostics[:3])}
        except Exception:
            row |= {"outcome": "internal error", "cause": traceback.format_exc()[-1500:]}
    return row | {"wall": round(time.perf_counter() - began, 1), "cpu": round(time.process_time() - cpu, 1)}
