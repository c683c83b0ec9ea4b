"""One run of a plan: its parts are put together, it is executed or resumed in worlds, or replayed from a trace."""

from __future__ import annotations

import inspect
import traceback
from collections.abc import Awaitable, Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from enum import Enum
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, Any

from executive.belief import Belief, read_map, scene_of
from executive.modules.bundled import bundled_registry
from executive.robots import FindingKind, Missing, bind_robot, missing_capabilities, trusting_map
from executive.robots.arms import with_carrying
from executive.runs.assembly import RobotExecutive, platform_of, real_scene, world_at_start
from executive.runs.final_state import state_lines
from executive.runs.in_hands import in_hands, take
from executive.runs.parameters import Bound, bound_parameters, not_in_map, plan_parameters, things_of, unknown_things
from executive.runs.plan_files import (
    Requirements,
    assess,
    compiled_plan,
    count_of_steps,
    fixed_recipe,
    import_plan,
    line_in,
    located,
    main_plan,
    needs_of,
    outputs_of,
    read_names,
    required,
    required_of_plan,
    stated_waiting,
    without_module,
)
from executive.runs.tilts import Tilts
from executive.runs.traces import ListenedTrace, check_same_run, lines_of, past_of, recorded_parameters, sha256
from planlang import PlanFailure, RunError, SimulationHost, budget, explain, run
from planlang.designators import Action
from planlang.diagnostics import BadInput, Diagnostic, Span, error, note, warning
from planlang.failures import ActionUnresolvable, MissingCapability, ObjectUnresolvable
from planlang.language.performing import module_for
from planlang.language.plans import Plan
from planlang.language.running import known as run_header
from planlang.ontology import load
from planlang.outputs import replace as write_complete
from planlang.runs import Different, Past, RecordedRun, restore
from planlang.runs.codec import dump
from sim import PyBulletWorld

if TYPE_CHECKING:
    from executive.belief.recognition_models import GivenPart
    from planlang.language.replaying import Replay

BUDGET, PER_STEP = 600.0, 60.0
"""Plan time beside waiting after which a run is given up, and more for each step that the plan states [s]."""


class Outcome(Enum):
    """Outcome of a run."""

    DONE = "done"
    FAILED = "failed"
    LACKS_CAPABILITY = "lacks a capability"
    INTERRUPTED = "interrupted"


@dataclass(frozen=True, slots=True)
class RunOptions:
    """Options of a run: its inputs and the files to write."""

    plan: Path | None = None
    recipe: Path | None = None
    task: str | None = None
    accepted: tuple[str, ...] = ()
    """Codes of fixes that the recipe gets before it is compiled, though they may be guesses."""
    ontologies: tuple[Path, ...] = ()
    recipes: tuple[Path, ...] = ()
    """Files with recipes of steps that the recipe leaves to others."""
    modules: tuple[Path, ...] = ()
    """The user's files of process modules."""
    robot: Path | None = None
    urdf: Path | None = None
    environment: Path | None = None
    additions: tuple[Path, ...] = ()
    """Maps of further things in the environment."""
    start: tuple[float, float, float] | None = None
    models: tuple[Path, ...] | None = None
    """Folders with the recognition models, programs and maps that the robot has; None: it recognises all classes."""
    trust_map: bool = False
    """The poses of the map count as seen: a robot without camera works from them."""
    unknown: tuple[str, ...] = ()
    """Things and classes of things of which the robot does not know where they are."""
    bindings: Mapping[str, str] | None = None
    seed: int = 0
    schedule: int | None = None
    gui: bool = False
    trace: Path | None = None
    picture: Path | None = None
    record: Path | None = None
    poses: Path | None = None
    """The file for a log of where things and links are."""
    upload: Path | None = None
    """The file for maps that the plan uploads."""
    update_map: Path | None = None
    """The file for the map as the robot knows it at the end."""
    force: bool = False
    """Run although the robot lacks a capability, or the program a process module."""
    resume: RecordedRun | None = None
    """The trace of the run to resume."""
    world_as_left: bool = False
    """The user states that the world is as that trace left it; else it is restored."""
    notes: tuple[Diagnostic, ...] = ()
    """Diagnostics of before."""
    progress: Callable[[str], None] = lambda line: None
    announce: Callable[[Sequence[Diagnostic]], None] = lambda found: None
    """Given the diagnostics once, before the plan runs."""
    watchers: tuple[Callable[[PyBulletWorld], None], ...] = ()
    """Called with the true world before the plan runs and after every step of the world."""


@dataclass(frozen=True, slots=True)
class RunResult:
    """Result of a run. ``final_state`` has the objects of the plan as they are in the simulator's truth."""

    outcome: Outcome
    message: str
    final_state: tuple[str, ...] = ()
    diagnostics: tuple[Diagnostic, ...] = ()
    seconds: float = 0.0
    """Plan time [s]."""
    failure: tuple[str, ...] = ()
    """Classes of the failure that ended the plan and of its causes, the failure itself first."""
    tilts: Tilts = field(default_factory=Tilts)
    """The angles by which what was carried leaned from upright, in the simulator's truth."""


class Run:
    """A plan that is ready to be executed or replayed. Create it in a ``with`` statement: it holds files and worlds."""

    def __init__(self, options: RunOptions) -> None:
        """Compile and import the plan and the process modules; raises BadInput."""
        self.options = options
        self.found: list[Diagnostic] = list(options.notes)
        with ExitStack() as stack:  # closed at once if something is refused
            self._requirements: Requirements | None = None
            self.registry = bundled_registry()
            self.registry.add_installed()
            for file in options.modules:
                self.registry.add_file(file)
            self._modules = self.registry.resolve(self.found)
            if options.plan is not None:
                self.path = options.plan
            else:
                assert options.recipe is not None
                file, folders = options.recipe, options.ontologies
                if options.accepted:
                    file = fixed_recipe(file, stack, self.found, options.task, folders, options.accepted)
                    folders = (options.recipe.parent, *folders)
                recipe = load(file, folders=folders, also=options.recipes)
                self.path, recipes = compiled_plan(recipe, stack, self.found, task=options.task)
                self.found = [located(one, file, options.recipe) for one in self.found]
                self._requirements = required(recipe, recipes)
            self.source = import_plan(self.path)
            self.plan: Plan[Any, Any] = main_plan(self.source, options.task if options.plan is not None else None)
            self._stack = stack.pop_all()

    def __enter__(self) -> Run:
        return self

    def __exit__(self, *failure: object) -> None:
        self._stack.close()

    # Replaying

    def replay(self, recorded: RecordedRun) -> Replay:
        """Replay the run of a trace, without robot or world; raises BadInput for a trace that cannot be replayed."""
        from planlang.language.replaying import replay

        modules = recorded.header.get("modules")
        absent = [name for name in modules if name not in self.registry.identity] if isinstance(modules, dict) else []
        if absent:
            advice = " ".join(f"--modules {name}" for name in absent)
            message = "the trace was written with process modules that are not here"
            raise BadInput([error("X022", message, Span(recorded.name), f"add {advice}")])
        if sha256(self.path) != recorded.header.get("plan_sha256"):
            self.found.append(warning("X022", "the plan differs from that of the trace", Span(recorded.name)))
        bound = recorded_parameters(recorded, plan_parameters(self.plan))
        try:
            return replay(self._body(bound, lambda: None), recorded)
        except ValueError as problem:
            raise BadInput([error("X020", str(problem), Span(recorded.name, 1))]) from None

    # Executing

    def execute(self) -> RunResult:
        """Run the plan, or resume it; failures of the plan end in the result, bad input raises BadInput.

        The trace is written line by line; picture and recording are written at the end, also after a failure.
        """
        options, found = self.options, self.found
        assert options.environment is not None
        assert options.robot is not None
        if options.plan is not None:
            self._requirements = required_of_plan(self.path, self.plan, found, folders=options.ontologies)
        # Cheap questions first: a misspelt parameter is reported before the robot is bound, which can take a minute.
        ontology = load(options.environment, folders=options.ontologies, also=options.additions)
        semantic_map = read_map(ontology)
        found += (*ontology.diagnostics, *semantic_map.diagnostics)
        scene = scene_of(semantic_map, found)
        if options.resume is not None and not options.bindings:
            bound = recorded_parameters(options.resume, plan_parameters(self.plan))
        else:
            bound = bound_parameters(self.plan, options.bindings or {}, semantic_map, found)
        made = outputs_of(self.source)
        found += not_in_map(bound, semantic_map, made)
        needs = needs_of(self.source, self.plan)
        # a run is resumed with the modules of its trace, which are compared later
        performed = self.registry.actions if options.resume is None else None
        unperformed = partial(without_module, semantic_map.ontology, performed)
        assessment = assess(needs, lambda actions: (), unperformed)
        # what steps leave open is set, and the program's process modules perform what the vocabulary has nothing for
        settled = ("R062",) if assessment.missing else ("R021", "R062")
        found[:] = [one for one in found if one.code not in settled]
        if assessment.missing and not options.force:
            options.announce(found)
            return self._refused(assessment.missing)
        bare = bind_robot(options.robot, urdf=options.urdf, folders=options.ontologies)
        bare = trusting_map(bare) if options.trust_map else bare
        given: tuple[GivenPart, ...] | None = None
        if options.models is not None:
            from executive.belief.recognition_models import read_given_parts, with_given_parts

            given = read_given_parts(options.models, options.ontologies)
            bare = with_given_parts(bare, given)
        assessment = assess(needs, partial(missing_capabilities, semantic_map.ontology, robot=bare), unperformed)
        if self._requirements is not None:
            assessment = assessment.also(self._requirements(bare))
        past: Past | None = None
        notes: list[Diagnostic] = []
        if options.resume is not None:
            past, notes = past_of(options.resume)
        held = in_hands(bare, semantic_map, scene)
        carried = [(one.link, one.body, one.offset) for one in held]
        robot = bare if assessment.missing and not options.force else with_carrying(bare, carried)
        if assessment.missing and robot.camera is None and not options.trust_map:
            help = "--trust-map: things count as seen where the map has them"
            notes.append(note("X013", f"{robot.name} has no camera to look for things", help=help))
        found += (*robot.diagnostics, *assessment.notes(options.plan), *notes)
        options.announce(found)
        if assessment.missing and not options.force:
            return self._refused(assessment.missing)

        believed = world_at_start(scene, robot, options.start, self._stack, held)
        scene = believed.scene
        real = real_scene(scene, options.seed, believed)
        real = replace(real, start=scene.start) if robot.base.fixed else real
        truth = PyBulletWorld(real, robot.body(), gui=options.gui, seed=options.seed)
        self._stack.callback(truth.close)
        trusts_map, unknown = options.trust_map, unknown_things(semantic_map, options.unknown)
        platform = platform_of(
            robot,
            semantic_map,
            truth,
            believed,
            options.seed,
            options.progress,
            trusts_map=trusts_map,
            unknown=unknown,
            models=None if given is None else [cls for one in given for cls in one.recognises],
        )
        platform.upload = options.upload
        executive = RobotExecutive(platform, self._modules)
        take(platform, truth, held)
        platform.scene.collisions.prepare()
        # What a trace must have in common with another to be equal to it, beside seed and schedule.
        header: dict[str, Any] = {
            "plan_sha256": sha256(self.path),
            "parameters": {name: dump(what) for name, what in bound.items()},
            "start": [float(number) for number in scene.start],
            "robot": robot.name,
            "robot_sha256": sha256(options.robot),
            "urdf_sha256": sha256(robot.urdf),
            "map": semantic_map.iri,
            "map_sha256": [document.sha256 for document in semantic_map.ontology.documents],
            "versions": _versions(),
        }
        if options.trust_map:
            header["trusts_map"] = True
        if given is not None:
            header["given"] = [one.iri for one in given]
        if options.unknown:
            header["unknown"] = list(options.unknown)
        if self.registry.identity:
            header["modules"] = self.registry.identity
        if assessment.infeasible:
            header["infeasible"] = [alternative.name for alternative, _ in assessment.infeasible]

        def read() -> frozenset[str]:
            """Return the parameters that the plan reads with the modules of this run."""
            return read_names(
                self.source, self.plan, lambda cls, plan: module_for(executive, Action(cls), plan) is not None
            )

        def bind_all() -> None:
            """Raise ObjectUnresolvable for a parameter that means nothing here or later, before anything moves.

            A run that is resumed may have destroyed what one means. What only recipes need that modules stand in for
            need not be there.
            """
            for name, value in bound.items():
                for what in things_of(value):
                    try:
                        platform.scene.bodies.bind(what)
                    except ObjectUnresolvable:
                        appears = executive.may_create(what, needs.actions) or executive.may_find(what, needs.actions)
                        if past is None and name not in made and not appears and name in read():
                            raise

        body = self._body(bound, bind_all)
        if past is not None:
            known = run_header(body, SimulationHost(truth), options.seed, options.schedule)
            notes = check_same_run(past.recorded, {**header, **known})
            options.announce(notes)
            found += notes
            self._restore(executive, past)
        return self._executed(body, bound, executive, truth, header, past)

    def _refused(self, missing: Sequence[Missing]) -> RunResult:
        """Return the result of a run that does not begin, for what robot or program lack."""
        kinds = [ActionUnresolvable if one.kind is FindingKind.ACTION else MissingCapability for one in missing]
        message = "\n".join(f"{kind.__name__}: {what}" for kind, what in zip(kinds, missing, strict=True))
        names = tuple(dict.fromkeys(kind.__name__ for kind in kinds))
        return RunResult(Outcome.LACKS_CAPABILITY, message, (), tuple(self.found), failure=names)

    def _body(self, bound: Mapping[str, Bound], first: Callable[[], object]) -> Callable[[], Awaitable[Any]]:
        """Return the plan with its parameters and budget; executed and replayed alike."""

        async def body() -> Any:
            first()
            return await budget(partial(self.plan, **bound), seconds=self._allowance(bound))

        body.__name__ = self.plan.name
        vars(body)["iri"] = self.plan.iri
        return body

    def _allowance(self, bound: Mapping[str, Bound]) -> float:
        """Return the plan time after which the run is given up [s]: what the plan waits for is its own matter."""
        stated = sum(value for value in bound.values() if isinstance(value, float))
        return BUDGET + PER_STEP * count_of_steps(self.source) + stated_waiting(self.source) + stated

    def _restore(self, executive: RobotExecutive, past: Past) -> None:
        """Restore world and belief; raises BadInput when the trace or the world cannot, and the user does not vouch."""
        span = Span(past.recorded.name, past.last.line if past.last is not None else 1)
        executive.world_as_left = self.options.world_as_left
        try:
            if restore(executive, past) or self.options.world_as_left:
                return
        except ValueError as problem:
            raise BadInput([error("X020", f"the recorded state does not fit: {problem}", span)]) from None
        advice = "--world-as-left states that world and robot are as the trace left them"
        raise BadInput([error("X023", "the trace does not contain the state of the world", span, advice)])

    def _executed(
        self,
        body: Callable[[], Awaitable[Any]],
        bound: Mapping[str, Bound],
        executive: RobotExecutive,
        truth: PyBulletWorld,
        header: Mapping[str, object],
        past: Past | None,
    ) -> RunResult:
        options, belief = self.options, executive.platform.belief
        listeners = [lines_of(lambda step, line: options.progress(f"{step / truth.rate:7.2f} s  {line}"))]
        tilts, written = Tilts(executive.platform.leaning), list[tuple[Path, Callable[[Path], object]]]()
        watchers: list[Callable[[PyBulletWorld], None]] = [tilts, *options.watchers]
        if options.picture is not None:
            meant = partial(_bodies_of, bound, belief, truth)  # at the end
            written.append((options.picture, lambda path: truth.save_picture(path, of=tuple(meant()))))
        if options.record is not None:
            from executive.pictures.recording import Recording, drawn_in

            film = Recording(truth.rate, drawn_in(truth), title=self.plan.name)
            listeners.append(lines_of(film.event))
            watchers.append(lambda world: film.frame(world.steps))
            written.append((options.record, film.save))
        if options.poses is not None:
            from executive.runs.pose_log import PoseLog

            watchers.append(log := PoseLog(truth, {**header, "seed": options.seed, "schedule": options.schedule}))
            written.append((options.poses, log.save))
        if options.update_map is not None:
            from executive.belief.map_updating import MapUpdate

            listeners.append(update := MapUpdate(belief, {options.environment, *options.additions}, self.found))
            written.append((options.update_map, update.save))
        trace = ListenedTrace.to(options.trace, header, tuple(listeners), past)
        world = _WatchedWorld(truth, watchers)
        outcome, message, failures = Outcome.DONE, "done", tuple[str, ...]()
        try:
            run(
                body,
                host=SimulationHost(world),
                executive=executive,
                seed=options.seed,
                schedule=options.schedule,
                trace=trace,
                max_steps=int(2 * self._allowance(bound) * truth.rate),
                resumable=True,
                resume=past,
            )
        except PlanFailure as failure:
            outcome, message = Outcome.FAILED, explain(failure)
            failures = tuple(type(link).__name__ for link in failure.chain())
        except KeyboardInterrupt:
            outcome, message = Outcome.INTERRUPTED, "interrupted"
        except Different as difference:
            name = "" if past is None else past.recorded.name
            raise BadInput([error("X027", str(difference), Span(name, difference.line or 1))]) from None
        except RunError as problem:
            outcome, message = Outcome.FAILED, f"{type(problem).__name__}: {problem}"
            failures = (type(problem).__name__,)
        except Exception as problem:
            where = self._users_line(problem)
            if where is None:
                raise
            outcome, message = Outcome.FAILED, f"{type(problem).__name__}: {problem}\n  {where}"
            failures = (type(problem).__name__,)
        finally:
            trace.close()
            for path, save in written:
                write_complete(path, save)
        state = tuple(state_lines(truth, _bodies_of(bound, belief, truth)))
        return RunResult(outcome, message, state, tuple(self.found), truth.steps / truth.rate, failures, tilts)

    def _users_line(self, problem: Exception) -> str | None:
        """Return the line of the plan, or of a user's process module, that raised; None if planlang did, below it."""
        files = [Path(frame.filename) for frame in traceback.extract_tb(problem.__traceback__)]
        plan = Path(str(inspect.getsourcefile(self.plan.function)))
        for path, what in [(plan, "the plan"), *((file, "the process modules") for file in self.options.modules)]:
            line = line_in(problem, path)
            below = files[len(files) - files[::-1].index(path) :] if path in files else files
            if line is not None and not any(_is_own(file) for file in below):
                return f"in {what}, {path.name}:{line}"
        return None


def run_plan_file(options: RunOptions) -> RunResult:
    """Put a run together and execute it; raises BadInput for what cannot be used."""
    with Run(options) as whole:
        return whole.execute()


class _WatchedWorld:
    """A world that others look at before the first step and after every one."""

    def __init__(self, world: PyBulletWorld, watchers: Sequence[Callable[[PyBulletWorld], None]]) -> None:
        self.world, self.watchers, self.rate = world, watchers, world.rate
        self._show()

    def step(self) -> None:
        self.world.step()
        self._show()

    def _show(self) -> None:
        for watcher in self.watchers:
            watcher(self.world)


def _is_own(file: Path) -> bool:
    """Return whether a file is part of the executive or the simulator."""
    own = Path(__file__).parents[1], Path(inspect.getfile(PyBulletWorld)).parent
    return any(file.is_relative_to(folder) for folder in own)


def _bodies_of(bound: Mapping[str, Bound], belief: Belief, truth: PyBulletWorld) -> Iterator[str]:
    """Yield the bodies that the plan's parameters mean, as far as there are any."""
    for what in (one for value in bound.values() for one in things_of(value)):
        try:
            name = belief.bind(what, truth.configuration().base)
        except PlanFailure:
            continue
        if name in truth.names():
            yield name


def _versions() -> dict[str, str]:
    versions = {}
    for package in ("planlang", "pybullet", "casadi", "ruckig", "numpy"):
        try:
            versions[package] = version(package)
        except PackageNotFoundError:
            versions[package] = "unknown"
    return versions
