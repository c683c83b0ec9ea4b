"""One run of a plan: its parts are put together, it is executed or resumed in worlds, or replayed from a trace."""

from __future__ import annotations

import inspect
import traceback
from collections.abc import Awaitable, Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, Any

from executive.maps import SemanticMap, read_map, scene_of
from executive.maps.recognition_models import GivenPart, read_given_parts, with_given_parts
from executive.modules.bundled import bundled_registry
from executive.modules.platform import Platform
from executive.robots import FindingKind, Missing, Robot, bind_robot, missing_capabilities, trusting_map
from executive.robots.arms import with_carrying
from executive.runs.assembly import RobotExecutive, platform_of, real_scene, world_at_start
from executive.runs.ended_run import EndedRun
from executive.runs.failure import Failure
from executive.runs.final_state import state_lines
from executive.runs.importing import import_plan, line_in
from executive.runs.in_hands import InHand, in_hands, take
from executive.runs.inputs import Inputs
from executive.runs.options import Outcome, RunOptions, RunResult
from executive.runs.parameters import (
    Bound,
    bound_parameters,
    not_in_map,
    plan_parameters,
    stated_bindings,
    things_of,
    unknown_things,
)
from executive.runs.plan_files import (
    Assessment,
    Needs,
    Requirements,
    assess,
    compiled,
    count_of_steps,
    fixed_recipe,
    located,
    main_plan,
    needs_of,
    outputs_of,
    plan_file,
    read_names,
    required,
    required_of_plan,
    stated_waiting,
    without_module,
)
from executive.runs.remedies import able_robots, absent_things, command_of
from executive.runs.settings import stated
from executive.runs.traces import check_same_run, different, earlier_of, recorded_parameters, sha256
from executive.runs.written import WatchedWorld, Written, bodies_of
from planlang import PlanFailure, RunError, SimulationHost, Trace, budget, explain, run
from planlang.designators import Action, local_name
from planlang.diagnostics import BadInput, Diagnostic, Span, error, note, warning
from planlang.failures import ActionUnresolvable, AmbiguousPerception, MissingCapability, ObjectUnresolvable
from planlang.language.performing import module_for
from planlang.language.plans import Plan
from planlang.language.replaying import Replay, replay
from planlang.language.running import known as run_header
from planlang.ontology import load
from planlang.records import dataclass
from planlang.runs import Different, Past, RecordedRun, Repetition, restore
from planlang.runs.codec import dump
from planlang.runs.repeating import RepeatedTrace
from planlang.runs.trace import Earlier
from sim import PyBulletWorld, Scene

if TYPE_CHECKING:
    from planlang.compiler.compile import CompiledPlan
    from planlang.report import Context

BUDGET, PER_STEP = 600.0, 60.0
"""Plan time beside waiting after which a run is given up, and more for each step that the plan states [s]."""


@dataclass(frozen=True, slots=True)
class _Asked:
    """The subject of a plan: the map, its bodies, the parameters, what actions make, and the actions that it needs."""

    map: SemanticMap
    scene: Scene
    bound: Mapping[str, Bound]
    made: frozenset[str]
    needs: Needs


class Run:
    """A plan that is ready to be executed or replayed. Create it in a ``with`` statement: it holds files and worlds."""

    def __init__(self, options: RunOptions, inputs: Inputs | None = None) -> None:
        """Compile and import the plan and the process modules; ``inputs`` keeps what runs read. Raises BadInput."""
        self.options = options
        # a recipe that is fixed first is another file in each run
        self._inputs = Inputs() if inputs is None or options.accepted else inputs
        self.found: list[Diagnostic] = list(options.notes)
        with ExitStack() as stack:  # closed at once if something is refused
            self._requirements: Requirements | None = None
            self._compiled: CompiledPlan | None = None
            self.registry = bundled_registry()
            self.registry.add_installed()
            for file in options.modules or ():
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
                recipe = self._inputs.once(load, file, folders=folders, also=options.recipes)
                plan = self._compiled = self._inputs.once(compiled, recipe, options.task, self.registry.actions)
                self.path = plan_file(plan, stack)
                self.found = [located(one, file, options.recipe) for one in (*self.found, *plan.diagnostics)]
                self._requirements = required(recipe, plan.recipes)
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
            return replay(self._body(bound), recorded)
        except ValueError as problem:
            raise BadInput([error("X020", str(problem), Span(recorded.name, 1))]) from None

    # Executing

    def execute(self) -> RunResult:
        """Run the plan, or resume it; failures of the plan end in the result, bad input raises BadInput.

        The trace is written line by line; picture and recording are written at the end, also after a failure.
        """
        options, found = self.options, self.found
        asked = self._asked()
        # Cheap questions first: what the program lacks is said before the robot is bound, which can take a minute.
        program = self._assessed(asked)
        # what steps leave open is set, and the program's process modules perform what the vocabulary has nothing for
        settled = ("R062",) if program.missing else ("R021", "R062")
        found[:] = [one for one in found if one.code not in settled]
        if self._lacks(program):
            options.announce(found)
            return self._refused(program.missing)
        robot, given = self._equipped(found)
        assessment = self._assessed(asked, robot)
        earlier, notes = earlier_of(options.resume, world_as_left=options.world_as_left, looks_on=options.repeats)
        held = in_hands(robot, asked.map, asked.scene)
        if not assessment.missing or options.force:
            robot = with_carrying(robot, [(one.link, one.body, one.offset) for one in held], options.long_work)
        blind = self._blind(robot, assessment)
        found += (*robot.diagnostics, *assessment.notes(options.plan), *blind)
        self._shown = partial(self._context, asked, tuple(found), blind, bool(assessment.missing))
        found += notes
        if self._lacks(assessment):
            found += able_robots(options, lambda one: not self._assessed(asked, one).missing)
        options.announce(found)
        if self._lacks(assessment):
            return self._refused(assessment.missing)
        platform, truth = self._assembled(asked, robot, given, held)
        executive = RobotExecutive(platform, self._modules)
        if not isinstance(earlier, Past):  # steps that are taken over may have destroyed what a parameter means
            self._check_things(asked, executive)
        options.around(executive)
        take(platform, truth, held)
        platform.scene.collisions.prepare()
        header = self._header(asked, platform, assessment, given)
        body = self._body(asked.bound)
        if earlier is not None:
            known = run_header(body, SimulationHost(truth), options.seed, options.schedule)
            notes = check_same_run(earlier.recorded, {**header, **known})
            options.announce(notes)
            found += notes
        if isinstance(earlier, Past):
            self._restore(executive, earlier)
        return self._executed(body, asked.bound, executive, truth, header, earlier)

    def _asked(self) -> _Asked:
        """Return what the plan is about; raises BadInput for a map or a parameter that cannot be used."""
        options, found = self.options, self.found
        assert options.environment is not None
        if options.plan is not None:
            self._requirements = required_of_plan(self.path, self.plan, found, folders=options.ontologies)
        read = self._inputs.once
        ontology = read(load, options.environment, folders=options.ontologies, also=options.additions)
        semantic_map = read(read_map, ontology)
        found += (*ontology.diagnostics, *semantic_map.diagnostics)
        scene = scene_of(semantic_map, found)
        if options.resume is not None and not options.bindings:
            bound = recorded_parameters(options.resume, plan_parameters(self.plan))
        else:
            bound = bound_parameters(self.plan, options.bindings or {}, semantic_map, found)
        made = outputs_of(self.source)
        found += not_in_map(bound, semantic_map, made)
        return _Asked(semantic_map, scene, bound, made, needs_of(self.source, self.plan))

    def _assessed(self, asked: _Asked, robot: Robot | None = None) -> Assessment:
        """Return what the program lacks for the plan, and the robot, if one is given."""
        # a run is resumed with the modules of its trace, which are compared later
        performed = self.registry.actions if self.options.resume is None else None
        unperformed = partial(without_module, asked.map.ontology, performed)
        if robot is None:
            return assess(asked.needs, lambda actions: (), unperformed)
        assessment = assess(asked.needs, partial(missing_capabilities, asked.map.ontology, robot=robot), unperformed)
        return assessment if self._requirements is None else assessment.also(self._requirements(robot))

    def _lacks(self, assessment: Assessment) -> bool:
        return bool(assessment.missing) and not self.options.force

    def _equipped(self, found: list[Diagnostic]) -> tuple[Robot, tuple[GivenPart, ...] | None]:
        """Return the robot and the models and programs that it has beside its file's, None if nobody says which.

        Appends warnings about those that are left out.
        """
        options = self.options
        assert options.robot is not None
        robot = self._inputs.once(bind_robot, options.robot, urdf=options.urdf, folders=options.ontologies)
        robot = trusting_map(robot) if options.trust_map else robot
        if options.models is None:
            return robot, None
        given = read_given_parts(options.models, options.ontologies, found)
        return with_given_parts(robot, given), given

    def _blind(self, robot: Robot, assessment: Assessment) -> list[Diagnostic]:
        """Return the advice for a robot that lacks what the plan needs and has no camera."""
        if not assessment.missing or robot.camera is not None or self.options.trust_map:
            return []
        options = self.options
        trusting = command_of(
            replace(options, trust_map=True), options.start, options.bindings or {}, forced=options.force, folders=True
        )
        advice = f"with --trust-map things count as seen where the map has them: {trusting}"
        return [note("X013", f"{robot.name} has no camera to look for things", help=advice)]

    def _assembled(
        self, asked: _Asked, robot: Robot, given: tuple[GivenPart, ...] | None, held: Sequence[InHand]
    ) -> tuple[Platform, PyBulletWorld]:
        """Return the robot among what it believes, and the world as it is, which closes with the run."""
        options = self.options
        believed = world_at_start(asked.scene, robot, options.start, self._stack, held)
        real = real_scene(believed.scene, options.seed, believed)
        real = replace(real, start=believed.scene.start) if robot.base.fixed else real
        truth = PyBulletWorld(real, robot.body(), gui=options.gui, seed=options.seed)
        self._stack.callback(truth.close)
        platform = platform_of(
            robot,
            asked.map,
            truth,
            believed,
            options.seed,
            options.long_work,
            trusts_map=options.trust_map,
            unknown=unknown_things(asked.map, options.unknown or ()),
            models=None if given is None else [cls for one in given for cls in one.recognises],
        )
        platform.upload = options.upload
        return platform, truth

    def _header(
        self, asked: _Asked, platform: Platform, assessment: Assessment, given: tuple[GivenPart, ...] | None
    ) -> dict[str, Any]:
        """Return what a trace has in common with another that equals it, beside seed and schedule."""
        options, robot = self.options, platform.robot
        assert options.robot is not None
        header: dict[str, Any] = {
            "plan_sha256": sha256(self.path),
            "parameters": {name: dump(what) for name, what in asked.bound.items()},
            "start": [float(number) for number in platform.scene.world.scene.start],
            "robot": robot.name,
            "robot_sha256": sha256(options.robot),
            "urdf_sha256": sha256(robot.urdf),
            "map": asked.map.iri,
            "map_sha256": [document.sha256 for document in asked.map.ontology.documents],
            "versions": _versions(),
        }
        settings = stated(
            options,
            models=None if given is None else [one.iri for one in given],
            modules=self.registry.identity or None,
        )
        infeasible = [alternative.name for alternative, _ in assessment.infeasible]
        return header | settings | ({"infeasible": infeasible} if infeasible else {})

    def _check_things(self, asked: _Asked, executive: RobotExecutive) -> None:
        """Raise BadInput for parameters that mean nothing here or later, or one of several things that are alike.

        What only recipes need that modules stand in for need not be there.
        """
        actions, failures = asked.needs.actions, dict[str, PlanFailure]()
        for name, value in asked.bound.items():
            for what in things_of(value):
                try:
                    executive.platform.scene.bodies.bind(what)
                except ObjectUnresolvable as failure:
                    appears = executive.may_create(what, actions) or executive.may_find(what, actions)
                    if name not in asked.made and not appears and name in self._read(executive):
                        failures.setdefault(name, failure)
                except AmbiguousPerception as failure:
                    failures.setdefault(name, failure)
        if failures:
            parameters = plan_parameters(self.plan)
            raise BadInput([*absent_things(failures, asked.bound, parameters, asked.map, self.options)])

    def _read(self, executive: RobotExecutive) -> frozenset[str]:
        """Return the parameters that the plan reads with the modules of this run."""
        return read_names(
            self.source, self.plan, lambda cls, plan: module_for(executive, Action(cls), plan) is not None
        )

    def _refused(self, missing: Sequence[Missing]) -> RunResult:
        """Return the result of a run that does not begin, for what robot or program lack."""
        kinds = [ActionUnresolvable if one.kind is FindingKind.ACTION else MissingCapability for one in missing]
        message = "\n".join(f"{kind.__name__}: {what}" for kind, what in zip(kinds, missing, strict=True))
        advice = next((f"{one.message}; {one.help}" for one in self.found if one.code == "X013"), None)
        failure = Failure(kinds[0].__name__, "\n".join(map(str, missing)), advice=advice)
        seed = self.options.seed
        return RunResult(Outcome.LACKS_CAPABILITY, message, (), tuple(self.found), failure=failure, seed=seed)

    def _body(self, bound: Mapping[str, Bound]) -> Callable[[], Awaitable[Any]]:
        """Return the plan with its parameters and budget; executed and replayed alike."""

        async def body() -> Any:
            return await budget(partial(self.plan, **bound), seconds=self._allowance(bound))

        body.__name__ = self.plan.name
        vars(body)["iri"] = self.plan.iri
        return body

    def _allowance(self, bound: Mapping[str, Bound]) -> float:
        """Return the plan time after which the run is given up [s]: what the plan waits for is its own matter."""
        stated = sum(value for value in bound.values() if isinstance(value, float))
        return BUDGET + PER_STEP * count_of_steps(self.source) + stated_waiting(self.source) + stated

    def _restore(self, executive: RobotExecutive, past: Past) -> None:
        """Restore the belief, for the user states that the world is as the trace left it."""
        try:
            restore(executive, past)
        except ValueError as problem:
            span = Span(past.recorded.name, past.last.line if past.last is not None else 1)
            raise BadInput([error("X020", f"the recorded state does not fit: {problem}", span)]) from None

    def _executed(
        self,
        body: Callable[[], Awaitable[Any]],
        bound: Mapping[str, Bound],
        executive: RobotExecutive,
        truth: PyBulletWorld,
        header: Mapping[str, object],
        earlier: Past | Repetition | None,
    ) -> RunResult:
        options = self.options
        written = Written(options, executive.platform, executive.tilts, truth)
        written.ask(self.plan.name, bound, header, self.found, partial(self._shown, header))

        def trace_after(earlier: Earlier | None) -> Trace:
            written.begin()
            return Trace(None, header) if options.trace is None else Trace.at(options.trace, header, earlier=earlier)

        trace = RepeatedTrace(earlier, trace_after) if isinstance(earlier, Repetition) else trace_after(earlier)
        trace.listeners = tuple(written.listeners)
        outcome, message, failure = Outcome.FAILED, "broken off", None
        failed: PlanFailure | None = None
        try:
            run(
                body,
                host=SimulationHost(WatchedWorld(truth, written.watchers)),
                executive=executive,
                seed=options.seed,
                schedule=options.schedule,
                trace=trace,
                max_steps=self._most_steps(bound, truth.rate),
                resumable=True,
                resume=earlier if isinstance(earlier, Past) else None,
            )
            outcome, message = Outcome.DONE, "done"
        except PlanFailure as problem:
            outcome, message, failed = Outcome.FAILED, explain(problem), problem
            failure = Failure.of(problem)
        except KeyboardInterrupt:
            outcome, message = Outcome.INTERRUPTED, "interrupted"
        except Different as difference:
            assert earlier is not None
            raise BadInput([different(earlier.recorded, difference, header)]) from None
        except RunError as problem:
            outcome, message = Outcome.FAILED, f"{type(problem).__name__}: {problem}"
            failure = Failure.of(problem)
        except Exception as problem:
            where = self._users_line(problem)
            if where is None:
                raise
            outcome, message = Outcome.FAILED, f"{type(problem).__name__}: {problem}\n  {where}"
            failure = Failure.of(problem, where)
        finally:
            trace.close()
            written.save(outcome.value, message, failed)
        state = tuple(state_lines(truth, bodies_of(bound, executive.platform.belief, truth)))
        return RunResult(
            outcome,
            message,
            state,
            tuple(self.found),
            truth.steps / truth.rate,
            failure,
            executive.tilts,
            options.seed,
            EndedRun(options, trace.events, run_plan_file),
        )

    def _most_steps(self, bound: Mapping[str, Bound], rate: int) -> int:
        """Return the world steps after which the run is ended: one that is repeated goes no further than its trace."""
        options = self.options
        if options.repeats and options.resume is not None:
            return options.resume.last + 1
        return int(2 * self._allowance(bound) * rate)

    def _context(
        self,
        asked: _Asked,
        notes: Sequence[Diagnostic],
        blind: Sequence[Diagnostic],
        forced: bool,
        header: Mapping[str, Any],
    ) -> Context:
        """Return what a page shows beside trace and world; notes are those that a repeated run has, too."""
        from executive.runs.reporting import context_of  # most runs write no page

        options = self.options
        bindings = stated_bindings(self.plan, asked.bound, asked.map)
        several = self._compiled is not None and len(self._compiled.recipes.recipes) > 1
        task = options.task if options.recipe is None else local_name(self.plan.iri or "") if several else None
        command = command_of(replace(options, task=task), header["start"], bindings, forced=forced)
        return replace(
            context_of(self.path, self._compiled, options.recipe, self.registry.actions, options.ontologies),
            facts={**({"world": "repeated"} if options.repeats else {}), "command": command},
            notes=[one for one in notes if one not in options.notes],
            remedies=dict.fromkeys(
                ("Camera",) if blind else (), "; ".join(f"{one.message}; {one.help}" for one in blind)
            ),
        )

    def _users_line(self, problem: Exception) -> str | None:
        """Return the line of the plan, or of a user's process module, that raised; None if planlang did, below it."""
        files = [Path(frame.filename) for frame in traceback.extract_tb(problem.__traceback__)]
        plan = Path(str(inspect.getsourcefile(self.plan.function)))
        for path, what in [(plan, "the plan"), *((file, "the process modules") for file in self.options.modules or ())]:
            line = line_in(problem, path)
            below = files[len(files) - files[::-1].index(path) :] if path in files else files
            if line is not None and not any(_is_own(file) for file in below):
                return f"in {what}, {path.name}:{line}"
        return None


def run_plan_file(options: RunOptions, inputs: Inputs | None = None) -> RunResult:
    """Put a run together and execute it; raises BadInput for what cannot be used."""
    with Run(options, inputs) as whole:
        return whole.execute()


def _is_own(file: Path) -> bool:
    """Return whether a file is part of the executive or the simulator."""
    own = Path(__file__).parents[1], Path(inspect.getfile(PyBulletWorld)).parent
    return any(file.is_relative_to(folder) for folder in own)


def _versions() -> dict[str, str]:
    versions = {}
    for package in ("planlang", "pybullet", "casadi", "ruckig", "numpy"):
        try:
            versions[package] = version(package)
        except PackageNotFoundError:
            versions[package] = "unknown"
    return versions
