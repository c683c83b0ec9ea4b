"""Commands that run plans: run, replay. What is heavy is imported when it is needed."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from executive.cli.console import Answer, answer, say, show
from executive.cli.headers import Told
from executive.cli.inputs import PlanFile, RecipeFile, read
from executive.cli.options import (
    AllowAbstract,
    AsJson,
    Ontologies,
    Task,
    named,
    parsed_bindings,
    planar,
    refuse,
)
from executive.cli.outputs import check_outputs
from planlang.diagnostics import Diagnostic, error

if TYPE_CHECKING:
    from executive.runs.running import RunResult


def run_command(
    file: Annotated[
        str | None,
        typer.Argument(metavar="RECIPE|PLAN", help="A recipe's or plan's file, or a bundled recipe's name."),
    ] = None,
    robot: Annotated[
        str | None,
        typer.Option(metavar="ROBOT", help="The robot's self-model: a file, or a bundled robot's name."),
    ] = None,
    urdf: Annotated[
        Path | None, typer.Option(metavar="FILE", help="The robot's geometry, if the self-model does not name it.")
    ] = None,
    environment: Annotated[
        str | None,
        typer.Option(metavar="MAP", help="The semantic map: a file, or a bundled environment's name."),
    ] = None,
    start: Annotated[
        str | None, typer.Option(metavar="X,Y,YAW", help="Where the robot starts [m, m, rad]; default: the middle.")
    ] = None,
    set_: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="NAME=OBJECT", help="Bind a parameter of the plan to an object; repeatable."),
    ] = None,
    seed: Annotated[
        int | None, typer.Option(min=0, metavar="N", help="Moves the true world away from the map; 0 leaves it.")
    ] = None,
    schedule: Annotated[
        int | None,
        typer.Option(min=0, metavar="K", help="Run concurrent tasks in another order, the same for the same number."),
    ] = None,
    gui: Annotated[bool, typer.Option("--gui", help="Show the world in a window.")] = False,
    trace: Annotated[Path | None, typer.Option(metavar="FILE", help="Write what happened, as JSON Lines.")] = None,
    picture: Annotated[Path | None, typer.Option(metavar="FILE", help="Write a picture of the end, as PNG.")] = None,
    record: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write a recording for rerun (needs planlang[record]).")
    ] = None,
    resume: Annotated[
        Path | None,
        typer.Option(
            metavar="TRACE", help="Go on with the run of this trace after the last step of the plan that completed."
        ),
    ] = None,
    world_as_left: Annotated[
        bool,
        typer.Option("--world-as-left", help="With --resume: the world is as the trace left it; do not bring it back."),
    ] = False,
    task: Task = None,
    ontologies: Ontologies = None,
    allow_abstract: AllowAbstract = False,
    force: Annotated[bool, typer.Option("--force", help="Run although the robot lacks a capability.")] = False,
    json: AsJson = False,
) -> None:
    """Run a plan or a recipe in a simulated world.

    A run that was interrupted is resumed by planlang run PLAN --resume TRACE: seed, start and parameters are those of
    the trace, as are plan, robot and environment where they are bundled ones.
    """
    if file is None and resume is None:
        raise typer.BadParameter("name a recipe or plan, or --resume TRACE")
    if world_as_left and resume is None:
        raise typer.BadParameter("--world-as-left needs --resume")
    base = planar(start)
    bindings = parsed_bindings(set_ or [])

    def work() -> Answer:
        recorded, told = None, Told()
        if resume is not None:
            from executive.runs.resuming import read_trace

            recorded, told = read_trace(resume)
        trace_file = trace or resume
        found = read(file or told.plan(str(resume)))
        outputs = {"--trace": trace_file, "--record": record}
        inputs = {"the plan": found.path, "--urdf": urdf}
        problems = check_outputs(outputs, inputs, {"--picture": picture})
        if urdf is not None and not urdf.is_file():
            problems.append(error("C001", f"no such URDF file: {urdf}"))
        if record is not None:
            from executive.pictures.recording import missing

            problems += missing()
        if gui:
            from executive.cli.display import no_display

            problems += no_display()
        is_bundled = isinstance(found, RecipeFile) and found.is_bundled
        self_model = named("robot", robot or told.robot, "robots", "amigo", is_bundled, problems)
        from executive.cli.environments import DEFAULT, default_environment

        notes: list[Diagnostic] = []
        place = environment or told.environment
        if place is None and is_bundled:
            place = default_environment(bindings.values(), notes)
        environment_map = named("environment", place, "environments", DEFAULT, is_bundled, problems)
        refuse(problems)

        from executive.runs.running import RunOptions, run_plan_file

        options = RunOptions(
            plan=found.path if isinstance(found, PlanFile) else None,
            recipe=found.path if isinstance(found, RecipeFile) else None,
            task=task or told.task,
            ontologies=tuple(ontologies or ()),
            allow_abstract=allow_abstract,
            robot=self_model,
            urdf=urdf,
            environment=environment_map,
            start=base or told.start,
            bindings=bindings,
            seed=told.seed if seed is None else seed,
            schedule=told.schedule if schedule is None else schedule,
            gui=gui,
            trace=trace_file,
            picture=picture,
            record=record,
            force=force,
            resume=recorded,
            world_as_left=world_as_left,
            notes=tuple(notes),
            progress=(lambda line: None) if json else say,
            announce=(lambda found: None) if json else show,
        )
        return _ran(run_plan_file(options), told=not json)

    answer("run", work, as_json=json)


def _ran(result: RunResult, *, told: bool) -> Answer:
    lines = [result.outcome, *result.final_state]
    data: dict[str, Any] = {
        "outcome": result.outcome,
        "failure": list(result.failure),
        "final_state": list(result.final_state),
        "plan_seconds": result.seconds,
    }
    text = "\n".join(line for line in lines if line)
    return Answer(result.exit_code, () if told else result.diagnostics, text, data)


def replay_command(
    trace: Annotated[Path, typer.Argument(metavar="TRACE", help="The trace of a run.")],
    file: Annotated[
        str | None,
        typer.Argument(metavar="[RECIPE|PLAN]", help="What was run; needed unless it is a bundled recipe."),
    ] = None,
    task: Task = None,
    ontologies: Ontologies = None,
    allow_abstract: AllowAbstract = False,
    json: AsJson = False,
) -> None:
    """Run a plan again on what is recorded of its run, without robot or world; stops at the first difference.

    The plan is told what it was told: what process modules did, where places were found, what was read and believed.
    """

    def work() -> Answer:
        from executive.runs.replaying import replay_trace
        from executive.runs.resuming import read_trace

        recorded, told = read_trace(trace)
        found = read(file or told.plan(str(trace)))
        return replay_trace(
            recorded,
            plan=found.path if isinstance(found, PlanFile) else None,
            recipe=found.path if isinstance(found, RecipeFile) else None,
            task=task or told.task,
            folders=tuple(ontologies or ()),
            allow_abstract=allow_abstract,
        )

    answer("replay", work, as_json=json)
