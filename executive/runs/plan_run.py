"""One run of a plan: assembled, then executed or resumed in a world, or replayed from a trace."""

from __future__ import annotations

import inspect
from collections.abc import Awaitable, Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from executive.goals import Judge, Verdict
from executive.maps import scene_of
from executive.maps.in_hand import in_hands
from executive.maps.recognition_models import GivenPart, read_given_parts, with_given_parts
from executive.modules.bundled import bundled_registry
from executive.modules.platform import Platform
from executive.options.headers import header_entries, settings_from_header
from executive.options.running import RunSettings
from executive.robots import Missing, Robot, bind_robot, missing_capabilities, with_options
from executive.robots.arms import with_carrying
from executive.runs.allowance import Allowance
from executive.runs.assembly import RobotExecutive, platform_of
from executive.runs.failure import Failure, line_of_user
from executive.runs.files import RecipeFile
from executive.runs.identity import TrueEffects
from executive.runs.judging import contradicted, goals_of, in_a_line, phrases_of
from executive.runs.options import EndedRun, Outcome, RunOptions, RunResult, Tilts, state_lines
from executive.runs.parameters import (
    Bound,
    bound_parameters,
    not_in_map,
    plan_parameters,
    stated_bindings,
    things_of,
    unknown_things,
)
from executive.runs.plan_body import ActionBefore, Subject, body_of, told_of_steps
from executive.runs.plan_files import (
    Assessment,
    Requirements,
    assess,
    compiled,
    fixed_recipe,
    main_plan,
    recipe_of_plan,
    required,
    required_of_plan,
    without_module,
)
from executive.runs.prepared import Inputs, RunFiles, prepared, read_environment
from executive.runs.remedies import (
    able_robots,
    absent_things,
    call_to_ask_why,
    call_to_pass_on,
    refused,
    trust_advised,
)
from executive.runs.simulating import simulated_world
from executive.runs.traces import check_same_run, different, earlier_of, recorded_parameters, sha256, versions
from executive.runs.true_world import TrueWorld, take_in_hands, worlds_at_start
from executive.runs.written import WatchedWorld, Written, bodies_of, still_held
from planlang.designators import Action, local_name
from planlang.diagnostics import BadInput, Diagnostic, Span, error, has_errors, warning
from planlang.failures import AmbiguousPerception, ObjectUnresolvable, PlanFailure
from planlang.kernel import RunError, SimulationHost
from planlang.language.loading import load_plan
from planlang.language.performing import module_for
from planlang.language.plans import Plan
from planlang.language.recovery import explain
from planlang.language.replaying import Replay, replay
from planlang.language.running import known as run_header
from planlang.language.running import run
from planlang.language.source import PlanSource
from planlang.ontology import Ontology, load
from planlang.runs import Different, Past, RecordedRun, Repetition, Trace, restore
from planlang.runs.codec import dump
from planlang.runs.repeating import RepeatedTrace
from planlang.runs.trace import Earlier
from planlang.state import Hold
from planlang.words import Option, Text
from sim import PyBulletWorld

if TYPE_CHECKING:
    from planlang.compiler.compile import CompiledPlan
    from planlang.report import Context


class Run:
    """Plan that is ready to execute or replay. Use it in a ``with`` statement: it holds files and worlds."""

    def __init__(self, files: RunFiles, inputs: Inputs | None = None) -> None:
        """Compile and import the plan and the process modules; ``inputs`` caches input files. Raises BadInput."""
        self.files, self.options = files, files.options
        options = files.options
        self._inputs = Inputs() if inputs is None or options.accept else inputs  # a fixed recipe is a new file
        self.found: list[Diagnostic] = list(files.notes)
        self._verdicts: tuple[Verdict, ...] = ()
        with ExitStack() as stack:  # closed here if something raises
            self._recipe: tuple[Ontology, ...] = ()
            self._requirements: Requirements | None = None
            self._compiled: CompiledPlan | None = None
            self.registry = bundled_registry()
            self.registry.add_installed()
            for file in options.modules or ():
                self.registry.add_file(file)
            self._modules = self.registry.resolve(self.found)
            if isinstance(files.file, PlanSource):
                self.source = files.file
            else:
                file, folders, content = files.file.path, options.folders, files.file.content
                if options.accept:
                    content = fixed_recipe(files.file, self.found, options.task, folders, options.accept)
                    folders = (*files.file.folder, *folders)
                recipe = self._inputs.once(load, file, folders=folders, also=options.recipes, content=content)
                plan = self._compiled = self._inputs.once(compiled, recipe, options.task, self.registry.actions)
                self.source = plan.plan_source
                self.found += plan.diagnostics
                self._recipe, self._requirements = (recipe,), required(recipe, plan.recipes)
            self._module = load_plan(self.source)
            self.plan: Plan[Any, Any] = main_plan(self._module, options.task if self._is_by_hand else None)
            self._stack = stack.pop_all()

    @property
    def _is_by_hand(self) -> bool:
        """True for a plan that is not compiled for this run."""
        return isinstance(self.files.file, PlanSource)

    @property
    def task(self) -> str | None:
        """The task as a call of the run states it; None if the file has only one."""
        several = self._compiled is not None and len(self._compiled.recipes.recipes) > 1
        return self.options.task if self._is_by_hand else local_name(self.plan.iri or "") if several else None

    def __enter__(self) -> Run:
        return self

    def __exit__(self, *failure: object) -> None:
        self._stack.close()

    # Replaying

    def replay(self, recorded: RecordedRun) -> Replay:
        """Replay a recorded run, without robot or world. Raises BadInput for a trace that cannot be replayed."""
        modules = recorded.header.get("modules")
        absent = [name for name in modules if name not in self.registry.identity] if isinstance(modules, dict) else []
        if absent:
            advice = Text("add ", Option("modules", absent))
            message = "the trace was written with further process modules"
            raise BadInput([error("X022", message, Span(recorded.name), advice)])
        if self.source.sha256 != recorded.header.get("plan_sha256"):
            self.found.append(warning("X022", "the plan differs from that of the trace", Span(recorded.name)))
        bound = recorded_parameters(recorded, plan_parameters(self.plan))
        try:
            first = ActionBefore.recorded(recorded.header)
            settings = RunSettings(**settings_from_header(recorded.header))
            within = Allowance.of(self.source, bound, len(first), settings)
            return replay(body_of(self.plan, bound, within, first, settings), recorded)
        except ValueError as problem:
            raise BadInput([error("X020", str(problem), Span(recorded.name, 1))]) from None

    # Executing

    def beginning(self) -> tuple[Subject, Robot]:
        """What the run begins with. Raises BadInput if that is not what its trace began with."""
        subject, (robot, given) = self._subject(), self._bind_robot(self.found)
        if self.files.recorded is not None:
            first = ActionBefore.read(self.options.before or (), subject.map, self.plan.name)
            self.found += check_same_run(self.files.recorded, self._header(subject, robot, (), given, first))
        return subject, robot

    def execute(self) -> RunResult:
        """Run the plan, or resume it. Failures of the plan are in the result; invalid input raises BadInput.

        The trace is written line by line, picture and recording at the end, also after a failure.
        """
        options, found = self.options, self.found
        subject = self._subject()
        # Cheap checks first: process modules, before the robot is bound, which can take a minute.
        program = self._assessment(subject)
        # R062: parameters are bound now; R021: registered process modules perform what the vocabulary has no module for
        settled = ("R062",) if program.missing else ("R021", "R062")
        found[:] = [one for one in found if one.code not in settled]
        stated, declared = goals_of(options, subject, self._compiled, self._recipe, self.plan)
        if self._lacks(program):
            options.announce(found)
            return refused(program.missing, found, self.files.seed, by_hand=self._is_by_hand)
        robot, given = self._bind_robot(found)
        assessment = self._assessment(subject, robot)
        earlier, notes = earlier_of(
            self.files.recorded, world_as_left=options.world_as_left, looks_on=options.repeated is not None
        )
        held = in_hands(robot, subject.map, subject.scene)
        if not assessment.missing or options.force:
            robot = with_carrying(robot, held, subject.scene, options.long_work)
        advice = trust_advised(self.files, robot, assessment.missing)
        found += (*robot.diagnostics, *assessment.notes(self.files.plan), *advice)
        self._context = partial(self._page_context, subject, tuple(found), advice, assessment.missing)
        found += notes
        if self._lacks(assessment):
            found += able_robots(self.files, lambda one: not self._assessment(subject, one).missing)
        options.announce(found)
        platform, truth = self._assemble(subject, robot, given, held)
        executive = RobotExecutive(platform, self._modules, TrueEffects(truth, platform.scene))
        if not isinstance(earlier, Past):  # skipped steps may have destroyed the thing of a parameter
            self._check_things(subject, executive)
        if self._lacks(assessment):  # after the map: another robot would not help
            return refused(assessment.missing, found, self.files.seed, by_hand=self._is_by_hand)
        options.around(executive)
        take_in_hands(platform, truth, held, subject.there, self._stack)
        self._judge = Judge(stated, truth, subject.in_truth[0], robot.base.radius, declared)
        platform.scene.collisions.prepare()
        first = ActionBefore.read(options.before or (), subject.map, self.plan.name)
        within = Allowance.of(self.source, subject.bound, len(first), options)
        platform.resolver.count.most = within.searches
        header = self._header(subject, robot, assessment.infeasible, given, first, platform.scene.world.scene.start)
        body = body_of(self.plan, subject.bound, within, first, options)
        if earlier is not None:
            known = run_header(body, SimulationHost(truth), self.files.seed, options.schedule)
            notes = check_same_run(earlier.recorded, {**header, **known})
            options.announce(notes)
            found += notes
        if isinstance(earlier, Past):
            self._restore(executive, earlier)
        result = self._execute(body, subject.bound, executive, truth, header, earlier, within)
        return told_of_steps(result, first, options.announce)

    def _subject(self) -> Subject:
        """Read the map and bind the parameters. Raises BadInput for an invalid map or parameter."""
        options, files, found = self.options, self.files, self.found
        if self._is_by_hand:
            recipe = recipe_of_plan(self.source, found, folders=options.folders)
            if recipe is not None:
                self._recipe, self._requirements = (recipe,), required_of_plan(recipe, self.source, self.plan)
        semantic_map = replace(read_environment(files, self._inputs, found), recipes=self._recipe)
        scene = scene_of(semantic_map, found)
        if files.recorded is not None and not options.set:
            bound = recorded_parameters(files.recorded, plan_parameters(self.plan))
        else:
            bound = bound_parameters(self.plan, options.set or {}, semantic_map, found)
        missing = list(not_in_map(bound, semantic_map, self.source.outputs))
        if has_errors(missing):
            raise BadInput(missing)
        found += missing
        needs = self.source.needs(self._module, self.plan)
        there = TrueWorld.read(files, self._recipe, self._inputs, found)
        return Subject(semantic_map, scene, bound, needs, there)

    def _assessment(self, subject: Subject, robot: Robot | None = None) -> Assessment:
        """Assess what the process modules lack for the plan, and the robot if given."""
        # a resumed run has the modules of its trace, which are compared later
        performed = self.registry.actions if self.files.recorded is None else None
        unperformed = partial(without_module, subject.map.ontology, performed)
        if robot is None:
            return assess(subject.needs, lambda actions: (), unperformed)
        missing = partial(missing_capabilities, subject.map.ontology, robot=robot)
        assessment = assess(subject.needs, missing, unperformed)
        return assessment if self._requirements is None else assessment.also(self._requirements(robot))

    def _lacks(self, assessment: Assessment) -> bool:
        return bool(assessment.missing) and not self.options.force

    def _bind_robot(self, diagnostics: list[Diagnostic]) -> tuple[Robot, tuple[GivenPart, ...] | None]:
        """Bind the robot, with the models and programs that it is given, if any. Appends warnings."""
        options = self.options
        assert self.files.robot is not None
        bound = self._inputs.once(bind_robot, self.files.robot, urdf=options.urdf, folders=options.folders)
        robot = with_options(bound, trusts_map=options.trust_map, camera_noise=options.camera_noise)
        if options.models is None:
            return robot, None
        given = read_given_parts(options.models, options.folders, diagnostics)
        return with_given_parts(robot, given), given

    def _assemble(
        self, subject: Subject, robot: Robot, given: tuple[GivenPart, ...] | None, held: Mapping[str, Hold]
    ) -> tuple[Platform, PyBulletWorld]:
        """Make the platform of the robot, with its belief, and the true world, which closes with the run."""
        options, seed = self.options, self.files.seed
        believed, real = worlds_at_start(subject.scene, subject.there, robot, options.start, seed, held, self._stack)
        world = self._world = self._stack.enter_context(simulated_world(self.files, real, robot))
        platform = platform_of(
            robot,
            subject.map,
            options.interface(world.interface),
            believed,
            seed,
            options.long_work,
            trusts_map=options.trust_map,
            unknown=unknown_things(subject.map, options.unknown or ()),
            models=None if given is None else [cls for one in given for cls in one.recognises],
            arm=options.arm,
            grasp=options.grasp,
        )
        platform.upload = options.upload
        world.told_by(platform.belief)
        return platform, world.truth

    def _header(
        self,
        subject: Subject,
        robot: Robot,
        alternatives: Sequence[tuple[Any, object]],
        given: tuple[GivenPart, ...] | None,
        first: Sequence[ActionBefore],
        start: Sequence[float] = (),
    ) -> dict[str, Any]:
        """Header of the trace, beside seed and schedule: all that equal traces have in common."""
        options = self.options
        assert self.files.robot is not None
        header: dict[str, Any] = {
            "plan_sha256": self.source.sha256,
            "parameters": {name: dump(what) for name, what in subject.bound.items()},
            **({"start": [float(number) for number in start]} if start else {}),
            "robot": robot.name,
            "robot_sha256": sha256(self.files.robot),
            "urdf_sha256": sha256(robot.urdf),
            "map": subject.map.iri,
            "map_sha256": [document.sha256 for document in subject.map.ontology.documents],
            "versions": versions(),
        }
        models = None if given is None else [one.iri for one in given]
        there = None if subject.there is None else subject.there.as_json()
        instead = {"modules": self.registry.identity or None, "world": there, "goal": phrases_of(options)}
        settings = header_entries(options, models=models, **instead)
        infeasible = [alternative.name for alternative, _ in alternatives]
        # a resumed run makes the changes by itself
        applied = [one.as_json() for one in self.files.changes]
        acts = dump([one.action for one in first]) if first else None
        also = {"infeasible": infeasible, "applied": applied, "actions_before": acts}
        return header | settings | {key: value for key, value in also.items() if value}

    def _check_things(self, subject: Subject, executive: RobotExecutive) -> None:
        """Raise BadInput for parameters without a thing, now or later, and for ambiguous ones.

        Parameters that only replaced recipes read need no thing.
        """
        actions, failures = subject.needs.actions, dict[str, PlanFailure]()
        for name, value in subject.bound.items():
            for what in things_of(value):
                try:
                    executive.platform.scene.bodies.bind(what)
                except ObjectUnresolvable as failure:
                    appears = executive.may_create(what, actions) or executive.may_find(what, actions)
                    if name not in self.source.outputs and not appears and name in self._read_parameters(executive):
                        failures.setdefault(name, failure)
                except AmbiguousPerception as failure:
                    failures.setdefault(name, failure)
        if failures:
            parameters = plan_parameters(self.plan)
            raise BadInput([*absent_things(failures, subject.bound, parameters, subject.map, self.files)])

    def _read_parameters(self, executive: RobotExecutive) -> frozenset[str]:
        """Parameters that the plan reads, given the process modules of this run."""
        return self.source.read_names(
            self._module, self.plan, lambda cls, plan: module_for(executive, Action(cls), plan) is not None
        )

    def _restore(self, executive: RobotExecutive, past: Past) -> None:
        """Restore the belief of a run whose world is as the trace left it."""
        try:
            restore(executive, past)
        except ValueError as problem:
            span = Span(past.recorded.name, past.last.line if past.last is not None else 1)
            raise BadInput([error("X020", f"the recorded state does not fit: {problem}", span)]) from None

    def _execute(
        self,
        body: Callable[[], Awaitable[Any]],
        bound: Mapping[str, Bound],
        executive: RobotExecutive,
        truth: PyBulletWorld,
        header: Mapping[str, object],
        earlier: Past | Repetition | None,
        within: Allowance,
    ) -> RunResult:
        options = self.options
        tilts = Tilts(executive.platform.leaning)
        written = self._written(executive.platform, tilts, truth, bound, header)

        def trace_after(earlier: Earlier | None) -> Trace:
            written.begin()
            return Trace(None, header) if options.trace is None else Trace.at(options.trace, header, earlier=earlier)

        trace = RepeatedTrace(earlier, trace_after) if isinstance(earlier, Repetition) else trace_after(earlier)
        trace.listeners = tuple(written.listeners)
        outcome, message, failure = Outcome.FAILED, "aborted", None
        failed: PlanFailure | None = None
        try:
            run(
                body,
                host=SimulationHost(WatchedWorld(truth, written.watchers)),
                executive=executive,
                seed=self.files.seed,
                schedule=options.schedule,
                trace=trace,
                on_start=self._world.begins,
                max_steps=within.most_steps(truth.rate, options.repeated),
                resumable=True,
                resume=earlier if isinstance(earlier, Past) else None,
            )
            outcome, message = Outcome.DONE, "done"
        except PlanFailure as problem:
            named = partial(executive.platform.belief.with_names, within=str(problem.where))
            message, failure = named(explain(problem)), Failure.of(problem).reworded(named)
            outcome, failed = Outcome.FAILED, problem
        except KeyboardInterrupt:
            outcome, message = Outcome.INTERRUPTED, written.interrupted
        except Different as difference:
            assert earlier is not None
            raise BadInput([different(earlier.recorded, difference, header)]) from None
        except RunError as problem:
            outcome, message = Outcome.FAILED, f"{type(problem).__name__}: {problem}"
            failure = Failure.of(problem)
        except Exception as problem:
            where = line_of_user(problem, Path(str(inspect.getsourcefile(self.plan.function))), options.modules or ())
            if where is None:
                raise
            outcome, message = Outcome.FAILED, f"{type(problem).__name__}: {problem}\n  {where}"
            failure = Failure.of(problem, where)
        finally:
            trace.close()
            ended = truth.steps / truth.rate
            if outcome is Outcome.DONE or failed is not None:
                self._verdicts = self._judge.verdicts()
            if outcome is Outcome.DONE:
                message = contradicted(self._verdicts) or message
            written.save(outcome.value, message, failed, ended)
        platform = executive.platform
        held = still_held(platform, truth) if outcome is not Outcome.DONE else {}
        unfulfilled = self._world.ended(outcome.value, () if failure is None else failure.types)
        options.announce(at_last := [*unfulfilled, *within.told(failed, options)])
        self.found += at_last
        state = tuple(state_lines(truth, bodies_of(bound, platform, truth), held))
        return RunResult(
            outcome,
            message,
            state,
            tuple(self.found),
            ended,
            failure,
            tilts,
            self.files.seed,
            self._verdicts,
            EndedRun(options, trace.events, run_plan_file),
            self._world.report(),
        )

    def _written(
        self,
        platform: Platform,
        tilts: Tilts,
        truth: PyBulletWorld,
        bound: Mapping[str, Bound],
        header: Mapping[str, object],
    ) -> Written:
        """What follows the run, with the output files and displays that its options ask for."""
        if not self.options.has_outputs:
            return Written(self.files, tilts, truth)
        from executive.runs import outputs, reporting  # Pillow, rich, pages: slow to import, and most runs have none

        written = outputs.Outputs(self.files, platform, tilts, truth)
        context = partial(self._context, header, reporting.context_of)
        written.ask(self.plan.name, bound, header, self.found, context)
        return written

    def _page_context(
        self,
        subject: Subject,
        notes: Sequence[Diagnostic],
        advice: Sequence[Diagnostic],
        missing: Sequence[Missing],
        header: Mapping[str, Any],
        context_of: Callable[..., Context],
    ) -> Context:
        """Context of a page; ``notes`` are those that a repeated run has, too."""
        options, file = self.options, self.files.file
        bindings = stated_bindings(self.plan, subject.bound, subject.map)
        start = tuple(header["start"])
        command = Text(call_to_pass_on(self.files, task=self.task, start=start, set=bindings, force=bool(missing)))
        why = Text(call_to_ask_why(self.files))
        recipe = file if isinstance(file, RecipeFile) else None
        facts = {"world": "repeated"} if options.repeated is not None else {}
        facts |= {"goals": in_a_line(self._verdicts)} if self._verdicts else {}
        return replace(
            context_of(self.source, self._compiled, recipe, self.registry.actions, options.folders),
            facts={**facts, "command": command, "why": why},
            notes=[one for one in notes if one not in self.files.notes],
            remedies={"Camera": Text(advice[0].message, "; ", advice[0].help or "")} if advice else {},
        )


def run_plan_file(options: RunSettings, inputs: Inputs | None = None) -> RunResult:
    """Run a plan or a recipe in a simulated world; a failed plan is a result, too. Raises BadInput for invalid input.

    :class:`~executive.runs.options.RunOptions` has observers besides; ``inputs`` caches input files.
    """
    with Run(prepared(options if isinstance(options, RunOptions) else RunOptions.of(options)), inputs) as run_:
        return run_.execute()
