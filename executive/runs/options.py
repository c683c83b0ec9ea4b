"""Options of a run, and its result."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, MutableSet, Sequence
from contextlib import suppress
from dataclasses import field, replace
from enum import Enum
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from executive.options.declaring import declared, values_of
from executive.options.declaring import view as checked_view
from executive.options.running import RunSettings
from executive.runs.failure import Failure
from executive.runs.traces import read_trace
from planlang.advice import Change
from planlang.designators import local_name
from planlang.diagnostics import BadInput, Diagnostic, error, has_errors
from planlang.notebooks import framed
from planlang.object_changes import state_word
from planlang.outputs import PNG, check_outputs
from planlang.progress import Report, Waiting, unreported, unwatched
from planlang.protocols import RobotInterface
from planlang.records import dataclass
from planlang.runs import RecordedRun
from planlang.runs.trace import Listener
from planlang.temporary import temporary_folder
from planlang.words import joined
from sim.joints import Articulation, JointKind
from sim.left_behind import left_in_the_way, left_on
from sim.truth import ROBOT, Truth, at_rest_on, held_by, is_inside, tilt

if TYPE_CHECKING:
    from executive.goals.deciding import Verdict
    from executive.runs.assembly import RobotExecutive
    from executive.runs.explanation import Explanation
    from executive.runs.fault_report import FaultReport


class Outcome(Enum):
    """Outcome of a run."""

    DONE = "done"
    FAILED = "failed"
    LACKS_CAPABILITY = "lacks a capability"
    INTERRUPTED = "interrupted"


@dataclass(frozen=True, kw_only=True)
class RunOptions(RunSettings):
    """Options of a run, and its observers."""

    changes: tuple[Change, ...] = ()
    """Changes of the map, and of options, as a file for ``apply`` has them; they count instead of it."""
    recipes: tuple[Path, ...] = ()
    """Files with recipes of steps that the recipe does not refine itself."""
    repeated: RecordedRun | None = None
    """A recorded run, which may have ended: it is repeated up to its last record, in order to observe it."""
    inner_actions: bool = False
    """Also report actions that process modules perform inside others."""
    progress: Callable[[str], None] = lambda line: None
    long_work: Report = unreported
    """Gets the progress of long work: building reachability maps, encoding a video."""
    waiting: Waiting = unwatched
    """Entered while the plan runs, anew after each line of ``progress``."""
    announce: Callable[[Sequence[Diagnostic]], None] = lambda found: None
    """Gets diagnostics before the plan runs."""
    watchers: tuple[Callable[[Truth], None], ...] = ()
    """Called with the true world before the plan runs and after each step of the world."""
    listeners: tuple[Listener, ...] = ()
    """Get each record of the trace as it is written."""
    interface: Callable[[RobotInterface], RobotInterface] = lambda robot: robot
    """Makes what the run senses and commands the simulated robot with; may decorate it, for example with noise."""
    around: Callable[[RobotExecutive], None] = lambda executive: None
    """Called with the executive before the plan runs; may wrap its process modules, for example to inject faults."""

    @staticmethod
    def of(settings: RunSettings, **observers: Any) -> RunOptions:
        """Add observers to the options of a face."""
        return RunOptions(**values_of(settings, RunSettings), **observers)

    @property
    def has_outputs(self) -> bool:
        """True if the run writes more than its trace, or is shown while it runs."""
        files = self.picture, self.video, self.record, self.report, self.poses, self.update_map
        return self.watch or self.watch_tree or any(file is not None for file in files)

    def unseen(self) -> RunOptions:
        """The same run, of which nothing is written or shown."""
        shown: dict[str, Any] = {
            name: one.field.default for name, one in declared(RunSettings).items() if one.declared.is_shown
        }
        unobserved = {
            name: getattr(RunOptions, name) for name in ("progress", "waiting", "announce", "watchers", "listeners")
        }
        return replace(self, **shown, **unobserved, world_as_left=False)


# The result


def state_lines(truth: Truth, names: Iterable[str], held: Mapping[str, str] | None = None) -> Iterator[str]:
    """Yield lines for each thing of the plan: where it is, whether it is open, its state (on, Clean), its contents.

    Then a line for all else that the run left: a door or drawer open, a device on, a thing in the way of a door or
    drawer. ``held`` says in which hand things still are.
    """
    scene, leaves, named = truth.scene, set[str](), tuple(dict.fromkeys(names))
    for name in named:
        if scene.body(name).graspable:
            if (holder := held_by(truth, name)) is not None:
                hand = (held or {}).get(name) if holder == ROBOT else None
                yield f"{name}: held by {holder}" if hand is None else f"{name}: still held by {holder}, {hand}"
            elif (support := at_rest_on(truth, name)) is not None:
                yield f"{name}: at rest {'in' if is_inside(truth, name, support) else 'on'} {support}"
            else:
                yield f"{name}: not at rest"
        for joint in scene.joints:
            if not joint.is_knob and name in (joint.leaf, joint.holder) and joint.leaf not in leaves:
                leaves.add(joint.leaf)
                yield f"{joint.leaf}: {_opening(truth.joint(joint.leaf), joint)}"
        if (state := truth.condition(name)) is not None:
            yield f"{name}: {state_word(state)}"
        if content := truth.contents(name):
            listed = (f"{amount:.0f} ml of {local_name(cls)}" for cls, amount in content.items())
            yield f"{name}: holds {', '.join(listed)}"
    for joint in scene.joints:
        value = truth.joint(joint.leaf)
        if not (joint.is_knob or joint.leaf in leaves or joint.is_shut(value)) and joint.is_shut(joint.first):
            yield f"{joint.leaf}: left {_opening(value, joint)}"
    yield from (f"{name}: left on" for name in left_on(truth) if name not in named)
    yield from (f"{name}: left in the way of {leaf}" for name, leaf in left_in_the_way(truth))


def _opening(value: float, joint: Articulation) -> str:
    if joint.is_shut(value):
        return "closed"
    slides = joint.kind is JointKind.PRISMATIC
    return f"open by {100 * value:.0f} cm" if slides else f"open by {math.degrees(value):.0f} degrees"


class Tilts:
    """Watcher that measures the largest tilt [rad] of held things, and of those on them, that have to stay upright.

    Only of things that stood upright when grasped; not while they are in ``leaning``, as a step tilts them on purpose.
    """

    def __init__(self, leaning: MutableSet[str] | None = None) -> None:
        self._leaning: MutableSet[str] = set() if leaning is None else leaning
        self.largest: dict[str, float] = {}
        self.limits: dict[str, float] = {}
        self._held: dict[str, bool] = {}
        """Held things -> whether they stood upright when grasped."""
        self._ways: dict[str, list[str]] = {}
        """How each thing was held: in a hand, or on what the robot carried."""
        self._tilted: set[str] = set()
        """Things that a step has tilted on purpose."""

    def __call__(self, world: Truth) -> None:
        """Measure after a step of the world."""
        before, self._held = self._held, {}
        for name in world.attached():
            limit = world.scene.body(name).largest_tilt
            if limit is not None:
                angle = tilt(world.pose(name))
                self._held[name] = before.get(name, angle <= limit)
                if name in self._leaning:
                    self._tilted.add(name)
                elif self._held[name]:
                    self.largest[name], self.limits[name] = max(angle, self.largest.get(name, 0.0)), limit
                    if name not in before or name not in self._ways:
                        carrier = world.carrier(name)
                        way = "held" if carrier is None else f"carried on {carrier}"
                        self._ways[name] = list(dict.fromkeys((*self._ways.get(name, ()), way)))

    def degrees(self) -> dict[str, float]:
        """Largest tilt of each thing [degrees], to a tenth."""
        return {name: round(math.degrees(angle), 1) for name, angle in self.largest.items()}

    def lines(self) -> Iterator[str]:
        """Yield a line for each thing."""
        for name, angle in self.degrees().items():
            limit = math.degrees(self.limits[name])
            beyond = f"; {limit:g} are allowed" if angle > limit else ""
            but = ", except when it was tilted on purpose" if name in self._tilted else ""
            when = f"while it was {' and '.join(self._ways[name])}{but}"
            yield f"{name}: leaned by at most {angle:g} degrees {when}{beyond}"


class EndedRun:
    """Repeats a run by its trace; its input files must not have changed."""

    def __init__(
        self, options: RunOptions, events: Sequence[Mapping[str, Any]], run: Callable[[RunOptions], object]
    ) -> None:
        """``events``: records of the trace, unless ``options`` wrote it to a file; ``run`` executes a run."""
        self._options, self._events, self._run = options, events, run
        self.explain: Callable[..., Any] | None = None
        """Finds out why the run failed, of its trace and options; None below the faces of planlang."""

    def why(self, **more: Any) -> Any:
        """Find the smallest change after which the run reaches its goal. Raises BadInput."""
        if self.explain is None:
            raise BadInput([error("C041", "nothing explains this run: it was not run by planlang.simulate")])
        return self.explain(self._recorded(), self._options, **more)

    def records(self) -> Sequence[Mapping[str, Any]]:
        """Records of the trace. Raises BadInput if its file cannot be read."""
        return [line.record for line in self._recorded().lines]

    def _recorded(self) -> RecordedRun:
        options = self._options
        if options.trace is not None:
            return read_trace(options.trace)[0]
        if options.repeated is not None:  # a run that was repeated for a file writes no trace
            return options.repeated
        return RecordedRun.of(self._events)

    def write(self, what: str, path: Path, *, force: bool = False, view: str | None = None) -> Path:
        """Write the "report" or "picture" of the run. Raises BadInput if that is not possible."""
        problems = check_outputs({what: path}, {}, formats={"picture": PNG}, force=force)
        if problems:
            raise BadInput(problems)
        shown: dict[str, Any] = {what: path, "view": None if view is None else checked_view(view)}
        self._run(replace(self._options.unseen(), repeated=self._recorded(), resume=None, **shown))
        return path

    @cached_property
    def page(self) -> str:
        """The page of the run, made once. Raises BadInput if the run cannot be repeated."""
        with temporary_folder() as folder:
            return self.write("report", folder / "run.html").read_text(encoding="utf-8")


@dataclass(frozen=True, slots=True)
class RunResult:
    """Result of a run; notebooks display its page. Equal inputs and seeds give equal results."""

    outcome: Outcome
    message: str
    """Text for people: ``done``, or the failure with its places and causes, in several lines."""
    final_state: tuple[str, ...] = ()
    """Where the plan's objects are at the end, in the true world: ``bottle1: held by patient1``."""
    diagnostics: tuple[Diagnostic, ...] = ()
    duration: float = 0.0
    """Plan time [s]."""
    failure: Failure | None = None
    """Why the run failed; ``str(run.failure)`` is a sentence. None if it succeeded or was interrupted."""
    tilts: Tilts = field(default_factory=Tilts, repr=False)
    """Largest tilts of carried things from upright, in the true world."""
    seed: int = 0
    goals: tuple[Verdict, ...] = ()
    """Whether each goal of the run holds in the true world; empty if none was stated or declared."""
    ended: EndedRun | None = field(default=None, repr=False, compare=False)
    """Shows the run; None if it did not begin."""
    faults: FaultReport | None = None
    """What has become of the faults of the run; None if none were stated."""

    @property
    def as_expected(self) -> bool | None:
        """True if the run ended as a file of faults expects, with all faults of the file; None without such a file."""
        if self.faults is None or not self.faults.is_strict:
            return None
        return not self.is_interrupted and not has_errors(self.diagnostics)

    @property
    def claimed(self) -> bool:
        """True if the plan ended without a failure, whatever is so in the world."""
        return self.outcome is Outcome.DONE

    @property
    def reached(self) -> bool:
        """True if every goal holds in the true world, whatever the plan says; without goals as ``claimed``."""
        return all(one.holds for one in self.goals) if self.goals else self.claimed

    @property
    def succeeded(self) -> bool:
        """True if the plan ended without a failure, and every goal holds in the true world."""
        return self.claimed and self.reached

    @property
    def is_interrupted(self) -> bool:
        """True if the run was interrupted, as by Ctrl-C."""
        return self.outcome is Outcome.INTERRUPTED

    @property
    def failures(self) -> tuple[str, ...]:
        """Class of the failure, then those of its causes; empty without a failure."""
        return () if self.failure is None else self.failure.types

    @property
    def trace(self) -> Sequence[Mapping[str, Any]]:
        """The records of the trace, for ``pandas.DataFrame`` or :class:`planlang.TaskTree`; docs/reference/trace.md.

        Raises BadInput if the file of the trace cannot be read.
        """
        return () if self.ended is None else self.ended.records()

    @property
    def goal_columns(self) -> dict[str, bool]:
        """Columns of the row of a sweep: whether the goals hold, and what the plan claims; empty without goals."""
        return {"reached": self.reached, "claimed": self.claimed} if self.goals else {}

    @property
    def row(self) -> dict[str, Any]:
        """The run as a row of a table: seed, outcome, succeeded, claimed, reached, duration [s], failure and reason."""
        return {
            "seed": self.seed,
            "outcome": self.outcome.value,
            "succeeded": self.succeeded,
            "claimed": self.claimed,
            "reached": self.reached,
            "duration": round(self.duration, 3),
            "failure": None if self.failure is None else self.failure.type,
            "reason": None if self.failure is None else str(self.failure),
        }

    def as_json(self) -> dict[str, Any]:
        """The result as JSON."""
        return {
            "outcome": self.outcome.value,
            "succeeded": self.succeeded,
            "claimed": self.claimed,
            "reached": self.reached,
            "failure": None if self.failure is None else self.failure.as_json(),
            "message": self.message,
            "goals": [one.as_json() for one in self.goals],
            "final_state": list(self.final_state),
            "largest_tilts": self.tilts.degrees(),
            "duration": self.duration,
            **({} if self.faults is None else {"faults": self.faults.as_json()}),
        }

    def report(self, path: str | PathLike[str], *, force: bool = False) -> Path:
        """Write an HTML page of the run (plan, world and causes on one time line), and return its path.

        This repeats the run, and takes about as long. ``force`` overwrites files that planlang did not write. Raises
        BadInput if the file cannot be written, or the run cannot be repeated.
        """
        return self._shown().write("report", Path(path), force=force)

    def why(self, *, budget: int | None = None, processes: int | None = None) -> Explanation:
        """Find the smallest change after which the goal is reached, by at most ``budget`` whole reruns.

        ``str()`` of the result is the answer for people; it has ``sentence``, ``changes``, ``command`` and ``tried``.
        Reruns take place in ``processes``, as many as cores by default. Raises BadInput if the run cannot be repeated.
        """
        explanation: Explanation = self._shown().why(budget=budget, processes=processes)
        return explanation

    def picture(self, path: str | PathLike[str], *, view: str | None = None, force: bool = False) -> Path:
        """Write a picture of the final scene, as PNG, and return its path; this repeats the run.

        ``view`` is as in the options of a run: ``overview``, ``top``, or points of the map [m]. Raises BadInput as
        :meth:`report` does.
        """
        return self._shown().write("picture", Path(path), force=force, view=view)

    def _shown(self) -> EndedRun:
        if self.ended is None:
            raise BadInput([error("C041", "nothing to show: the run did not begin", help=self.message)])
        return self.ended

    def __str__(self) -> str:
        goals = (str(one) for one in self.goals if not (one.declared and one.holds))  # a recipe says that again
        faults = () if self.faults is None else self.faults.lines()
        told = (self.message, *goals, *self.final_state, *self.tilts.lines(), *faults)
        return joined("\n", (line for line in told if line))

    def _repr_mimebundle_(self, include: object = None, exclude: object = None) -> dict[str, str]:
        """Page of the run, for notebooks; text only if it cannot be repeated."""
        bundle = {"text/plain": str(self)}
        if self.ended is not None:
            with suppress(BadInput):
                bundle["text/html"] = framed(self.ended.page, "a run of planlang")
        return bundle
