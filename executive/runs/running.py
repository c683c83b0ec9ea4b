"""Runs a recipe or a plan: compiles, binds the robot, builds the worlds, executes, tells how it ended."""

from __future__ import annotations

import inspect
import traceback
from collections.abc import Awaitable, Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, Any

from executive.belief import Belief, SemanticMap, read_map, scene_of
from executive.cli.console import DONE, FAILED, INTERRUPTED, MISSING_CAPABILITY
from executive.cli.outputs import replace as write_complete
from executive.cli.progress import ToldTrace, progress_lines
from executive.robots import Robot, bind_robot, missing_capabilities
from executive.robots.carrying import with_carrying
from executive.runs.assembly import platform_of, real_scene, world_at_start
from executive.runs.origins import Requirements, required, required_of_plan
from executive.runs.plan_actions import judged, needs_of
from executive.runs.plan_files import bound_parameters, compiled_plan, import_plan, line_in, main_plan
from executive.runs.resuming import bring_back, past_of, refuse_other, sha256, told_parameters
from executive.runs.robot_executive import RobotExecutive
from planlang import PlanFailure, RunError, SimulationHost, budget, explain, run
from planlang.designators import Object
from planlang.diagnostics import BadInput, Diagnostic, Span, error
from planlang.kernel.continued import Different
from planlang.kernel.exact import dump
from planlang.kernel.past import Past
from planlang.kernel.recorded import RecordedRun
from planlang.language.plans import Plan
from planlang.language.running import known as run_header
from planlang.ontology import load
from sim import PyBulletWorld
from sim.oracle import at_rest_on, held_by

if TYPE_CHECKING:
    from executive.pictures.recording import Recording

BUDGET = 600.0
"""Plan time after which a run is given up [s]."""


@dataclass(frozen=True, slots=True)
class RunOptions:
    """What to run, where, and what to leave behind."""

    plan: Path | None = None
    recipe: Path | None = None
    task: str | None = None
    ontologies: tuple[Path, ...] = ()
    allow_abstract: bool = False
    robot: Path | None = None
    urdf: Path | None = None
    environment: Path | None = None
    start: tuple[float, float, float] | None = None
    bindings: Mapping[str, str] | None = None
    seed: int = 0
    schedule: int | None = None
    gui: bool = False
    trace: Path | None = None
    picture: Path | None = None
    record: Path | None = None
    force: bool = False
    resume: RecordedRun | None = None
    """The trace of the run that goes on."""
    world_as_left: bool = False
    """Whether the user says that the world is as that trace left it; else it is brought back."""
    notes: tuple[Diagnostic, ...] = ()
    """What was found to say before."""
    progress: Callable[[str], None] = lambda line: None
    announce: Callable[[Sequence[Diagnostic]], None] = lambda found: None
    """Told what was repaired and assumed, once, before the plan runs."""


@dataclass(frozen=True, slots=True)
class RunResult:
    """How a run ended. ``final_state`` is what the simulator's truth says about the objects of the plan."""

    exit_code: int
    outcome: str
    final_state: tuple[str, ...] = ()
    diagnostics: tuple[Diagnostic, ...] = ()
    seconds: float = 0.0
    """Plan time [s]."""
    failure: tuple[str, ...] = ()
    """Classes of the failure that ended the plan and of its causes, the failure itself first."""


def run_plan_file(options: RunOptions) -> RunResult:
    """Run; the plan's own failures end in the result, bad input raises BadInput.

    The trace is written line by line; picture and recording are written at the end, also after a failure.
    """
    with ExitStack() as stack:
        found = list(options.notes)
        path, stated = (options.plan, None) if options.plan is not None else _compiled(options, stack, found)
        module = import_plan(path)
        plan = main_plan(module, options.task if options.plan is not None else None)
        if options.plan is not None:
            stated = required_of_plan(path, plan, found, folders=options.ontologies)
        assert options.environment is not None
        assert options.robot is not None
        ontology = load(options.environment, folders=options.ontologies)
        semantic_map = read_map(ontology)
        robot = with_carrying(bind_robot(options.robot, urdf=options.urdf, folders=options.ontologies))
        found.extend((*ontology.diagnostics, *semantic_map.diagnostics, *robot.diagnostics))
        scene = scene_of(semantic_map, found)
        bound = bound_parameters(plan, options.bindings or {}, semantic_map, found)
        able = judged(needs_of(module, plan), partial(missing_capabilities, semantic_map.ontology, robot=robot))
        if stated is not None:
            able = able.also(stated(robot))
        found.extend(able.notes(options.plan))
        options.announce(found)
        if able.missing and not options.force:
            return RunResult(
                MISSING_CAPABILITY,
                "\n".join(f"MissingCapability: {what}" for what in able.missing),
                diagnostics=tuple(found),
                failure=("MissingCapability",),
            )
        past: Past | None = None
        if options.resume is not None:
            past, notes = past_of(options.resume)
            options.announce(notes)
            found.extend(notes)
        believed = world_at_start(scene, robot, options.start, stack)
        scene = believed.scene
        real = real_scene(scene, options.seed, believed)
        truth = PyBulletWorld(real, robot.body(), gui=options.gui, seed=options.seed)
        stack.callback(truth.close)
        executive = RobotExecutive(platform_of(robot, semantic_map, truth, believed, options.seed, options.progress))
        executive.platform.scene.collisions.prepare()
        if options.resume is not None and not options.bindings:
            bound = told_parameters(options.resume, bound)
        header = _header(path, semantic_map, robot, options, scene.start, bound)
        header["versions"] = {**_versions(), "kinematics": executive.platform.scene.kinematics()}
        if able.infeasible:
            header["infeasible"] = [alternative.name for alternative, _ in able.infeasible]
        if past is not None:
            known = run_header(_budgeted(plan, bound, executive), SimulationHost(truth), options.seed, options.schedule)
            notes = refuse_other(past.recorded, {**header, **known})
            options.announce(notes)
            found.extend(notes)
            bring_back(executive, past, world_as_left=options.world_as_left)
        return replace(_execute(plan, bound, executive, truth, header, options, past), diagnostics=tuple(found))


def _execute(
    plan: Plan[Any, Any],
    bound: Mapping[str, Object],
    executive: RobotExecutive,
    truth: PyBulletWorld,
    header: Mapping[str, object],
    options: RunOptions,
    past: Past | None,
) -> RunResult:
    listeners = [progress_lines(truth.rate, options.progress)]
    recording = None
    world: PyBulletWorld | _Filmed = truth
    if options.record is not None:
        from executive.pictures.recording import Recording
        from executive.pictures.shapes import drawn_in

        recording = Recording(truth.rate, drawn_in(truth, executive.platform.robot.urdf), title=plan.name)
        listeners.append(recording.listen)
        world = _Filmed(truth, recording)
    trace = ToldTrace.to(options.trace, header, tuple(listeners), past)
    code, outcome = DONE, "done"
    chain: tuple[str, ...] = ()
    try:
        run(
            _budgeted(plan, bound, executive),
            host=SimulationHost(world),
            executive=executive,
            seed=options.seed,
            schedule=options.schedule,
            trace=trace,
            max_steps=int(2 * BUDGET * truth.rate),
            resumable=True,
            resume=past,
        )
    except PlanFailure as failure:
        code, outcome = FAILED, explain(failure)
        chain = tuple(type(link).__name__ for link in failure.chain())
    except KeyboardInterrupt:
        code, outcome = INTERRUPTED, "interrupted"
    except Different as difference:
        name = "" if past is None else past.recorded.name
        raise BadInput([error("X027", str(difference), Span(name, difference.line or 1))]) from None
    except RunError as problem:
        code, outcome, chain = FAILED, f"{type(problem).__name__}: {problem}", (type(problem).__name__,)
    except Exception as problem:
        path = Path(str(inspect.getsourcefile(plan.function)))
        line = line_in(problem, path)
        if line is None or _is_own(problem, path):
            raise
        outcome = f"{type(problem).__name__}: {problem}\n  in the plan, {path.name}:{line}"
        code, chain = FAILED, (type(problem).__name__,)
    finally:
        trace.close()
        if options.picture is not None:
            write_complete(options.picture, truth.save_picture)
        if recording is not None and options.record is not None:
            recording.save(options.record)
    state = tuple(_state_lines(truth, bound, executive.platform.belief))
    return RunResult(code, outcome, state, (), truth.steps / truth.rate, chain)


def _is_own(problem: BaseException, plan: Path) -> bool:
    """Whether an exception arose in the executive or the simulator, or in what they call, rather than in the plan."""
    files = [Path(frame.filename) for frame in traceback.extract_tb(problem.__traceback__)]
    below = files[len(files) - files[::-1].index(plan) :] if plan in files else files
    folders = [Path(inspect.getfile(kind)).parent for kind in (RobotExecutive, PyBulletWorld)]
    return any(file.is_relative_to(folder) for file in below for folder in folders)


def _compiled(options: RunOptions, stack: ExitStack, found: list[Diagnostic]) -> tuple[Path, Requirements]:
    """The plan of a recipe, and what the recipe itself requires of a robot, beyond what the plan's actions do."""
    assert options.recipe is not None
    read = load(options.recipe, folders=options.ontologies)
    path, recipes = compiled_plan(read, stack, found, task=options.task, allow_abstract=options.allow_abstract)
    return path, required(read, recipes)


class _Filmed:
    """A world that is recorded after every step."""

    def __init__(self, world: PyBulletWorld, recording: Recording) -> None:
        self.world, self.recording, self.rate = world, recording, world.rate
        recording.frame(0)

    def step(self) -> None:
        self.world.step()
        self.recording.frame(self.world.steps)


def _budgeted(
    plan: Plan[Any, Any], bound: Mapping[str, Object], executive: RobotExecutive
) -> Callable[[], Awaitable[Any]]:
    async def body() -> Any:
        for what in bound.values():  # what is not there is told before anything moves
            executive.platform.scene.bodies.bind(what)
        return await budget(partial(plan, **bound), seconds=BUDGET)

    body.__name__ = plan.name
    vars(body)["iri"] = plan.iri
    return body


def _state_lines(truth: PyBulletWorld, bound: Mapping[str, Object], belief: Belief) -> Iterator[str]:
    """For each graspable object of the plan where the truth has it."""
    for what in bound.values():
        try:
            name = belief.bind(what, truth.configuration().base)
        except PlanFailure:
            continue
        if name not in truth.names() or not truth.scene.body(name).graspable:
            continue
        holder, support = held_by(truth, name), at_rest_on(truth, name)
        if holder is not None:
            yield f"{name}: held by {holder}"
        else:
            yield f"{name}: at rest on {support}" if support is not None else f"{name}: not at rest"


def _header(
    plan: Path,
    semantic_map: SemanticMap,
    robot: Robot,
    options: RunOptions,
    start: tuple[float, float, float],
    bound: Mapping[str, Object],
) -> dict[str, object]:
    """What a trace must have in common with another to be equal to it, beside seed and schedule."""
    return {
        "plan_sha256": sha256(plan),
        "parameters": {name: dump(what) for name, what in bound.items()},
        "start": [float(number) for number in start],
        "robot": robot.name,
        "robot_sha256": None if options.robot is None else sha256(options.robot),
        "urdf_sha256": sha256(robot.urdf),
        "map": semantic_map.iri,
        "map_sha256": [document.sha256 for document in semantic_map.ontology.documents],
    }


def _versions() -> dict[str, str]:
    versions = {}
    for package in ("planlang", "pybullet", "casadi", "ruckig", "numpy"):
        try:
            versions[package] = version(package)
        except PackageNotFoundError:
            versions[package] = "unknown"
    return versions
