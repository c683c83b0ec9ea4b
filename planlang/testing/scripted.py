"""The executive of scripted runs, with process modules that follow a script."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any

from planlang.action_classes import ancestors_of
from planlang.designators import Action, Condition, Location, Object, action, local_name
from planlang.failures import LocationUnresolvable, PlanFailure
from planlang.faults.steps import make_failure
from planlang.kernel import now, sleep
from planlang.kernel.core import here
from planlang.kernel.tree import Node
from planlang.language.performing import actions_around
from planlang.language.process_module import ProcessModule
from planlang.misuse import WrongValue
from planlang.protocols import Solution
from planlang.records import dataclass
from planlang.roles import meant_role
from planlang.runs.codec import dump, load
from planlang.testing.script import Belief, Rule, Script
from planlang.testing.vocabulary import ActionVocabulary, bundled_vocabulary


@dataclass(eq=False)
class ScriptedModule:
    """A process module that follows the script of its executive."""

    name: str
    actions: Sequence[str]
    executive: ScriptedExecutive
    failures: Sequence[type[Exception]] = (PlanFailure,)
    once = False
    performs = ProcessModule.performs

    def resources(self, action: Action) -> tuple[str, ...]:
        """Parts of the robot as stated in the vocabulary, with the action's device in place of arm and gripper."""
        device = action.get("device_used")
        hand = "arm" if device is None else str(device)
        roles = self.executive.vocabulary.roles(self.executive.ancestors(action.type))
        return tuple(dict.fromkeys(hand if role in ("arm", "gripper") else role for role in roles))

    async def execute(self, action: Action) -> Any:
        """Wait, change the belief, and return the result or raise the failure of the script."""
        executive = self.executive
        executive.begin(action)
        rule = executive.rule_for(action, _step_name())
        seconds = rule.after if rule is not None and rule.after is not None else executive.script.takes
        await sleep(seconds)
        result = None
        if rule is None or rule.fails is None:
            executive.done(action)
        if rule is not None and rule.does is not None:
            result = rule.does(executive.belief, action)
            if inspect.isawaitable(result):
                result = await result
        executive.changed()
        if rule is None:
            return None
        if rule.fails is not None:
            raise make_failure(rule.fails)
        return rule.returns if result is None else result


class ScriptedExecutive:
    """Implements :class:`planlang.language.executive.Executive` with a script, for one run.

    The robot can perform the primitives of the ontology, and the further classes in the script.
    """

    def __init__(self, script: Script, vocabulary: ActionVocabulary | None = None) -> None:
        self.script = script
        self.vocabulary = vocabulary or bundled_vocabulary()
        self.belief: Belief = script.belief()
        self._left = [rule.times for rule in script.rules]
        """Remaining applications of each rule."""
        self._used = [rule.times == 0 for rule in script.rules]
        self._matched = list(self._used)
        self.performed: dict[str, None] = {}
        """Names and classes of the actions that were performed."""
        self._write: Callable[[str, Mapping[str, Any]], None] | None = None
        self._reported = self.belief.revision
        primitive = self.vocabulary.modules()
        primitive_classes = {cls for classes in primitive.values() for cls in classes}
        added = [cls for cls in dict.fromkeys(script.classes) if cls not in primitive_classes]
        of_rules = dict.fromkeys(rule.step for rule in script.rules if rule.step not in script.classes)
        self.modules: Sequence[ScriptedModule] = [
            *(ScriptedModule(name, classes, self) for name, classes in primitive.items()),
            *(ScriptedModule(cls, (cls,), self) for cls in added),
            *(ScriptedModule(f"rule of {cls}", (cls,), self) for cls in of_rules if cls not in primitive_classes),
        ]

    @property
    def unused(self) -> tuple[Rule, ...]:
        """Rules that were never applied."""
        return tuple(rule for rule, used in zip(self.script.rules, self._used, strict=True) if not used)

    @property
    def unmatched(self) -> tuple[Rule, ...]:
        """Rules for steps that were not performed at any time."""
        return tuple(rule for rule, matched in zip(self.script.rules, self._matched, strict=True) if not matched)

    def rule_for(self, action: Action, step: str | None) -> Rule | None:
        """Find the rule for a step that begins now, and count its application."""
        names = {name: None for name in (step, action.name, *self.ancestors(action.type)) if name is not None}
        self.performed |= names
        rules = self.script.rules
        self._matched = [matched or rule.step in names for matched, rule in zip(self._matched, rules, strict=True)]
        for number, rule in enumerate(self.script.rules):
            left = self._left[number]
            if rule.step in names and rule.since <= now() < rule.until and left != 0:
                self._used[number] = True
                if left is not None:
                    self._left[number] = left - 1
                return rule
        return None

    def begin(self, action: Action) -> None:
        """Check the roles of an action; WrongValue if one is misspelt, as a real module would miss its filler."""
        for role, _ in action.properties:
            meant = meant_role(role)
            if meant is not None:
                raise WrongValue(f"{action.type} has no role {role}: did you mean {meant}?")

    def done(self, action: Action) -> None:
        """Apply the effects of an action that has succeeded to the belief."""
        fillers = (one.get("object_acted_on") for one in actions_around())
        about = next((filler.name for filler in fillers if isinstance(filler, Object)), None)
        self.vocabulary.change(self.belief, action, self.ancestors(action.type), about)

    def changed(self) -> None:
        """Write a change of the belief, if there is one, to the trace."""
        if self.belief.revision != self._reported and self._write is not None:
            self._reported = self.belief.revision
            belief = self.belief
            self._write("belief", {"revision": self._reported, "holding": belief.holding, "at": belief.at})

    def ancestors(self, action_type: str) -> tuple[str, ...]:
        """The class, its local name, and its superclasses in the plan, in the script and in the vocabulary."""
        return ancestors_of(action_type, self._superclasses)

    def _superclasses(self, cls: str) -> Sequence[str]:
        short = local_name(cls)
        stated = (short, *self.script.ancestors.get(short, ()))
        inherited = (ancestor for name in (cls, *stated[1:]) for ancestor in self.vocabulary.ancestors(name))
        return tuple(dict.fromkeys((cls, *stated, *inherited)))

    def revision(self) -> int:
        """Number of changes of the belief."""
        return self.belief.revision

    def solutions(self, location: Location) -> Iterator[Solution]:
        """Yield the base poses in the script, or generated ones; then raise LocationUnresolvable."""
        places = self.belief.places_of(location)
        for base in places:
            yield Solution(base, self.belief.revision, {})
        raise LocationUnresolvable(designator=str(location), counts={"tried": len(places)} if places else {})

    def move_to(self, solution: Solution) -> Action:
        """Action that drives the base to a solution."""
        x, y, yaw = solution.base
        return action("Translation-LocationChange", x=float(x), y=float(y), yaw=float(yaw))

    def is_at(self, solution: Solution) -> bool:
        """Check whether the base is at the pose of a solution."""
        return self.belief.base == solution.base

    def holds(self, condition: Condition) -> bool:
        """Check whether a condition holds in the belief."""
        return self.belief.holds(condition)

    def before_retry(self) -> Iterable[Action]:
        """No actions, as a scripted robot can drive in any posture."""
        return ()

    def held(self) -> Sequence[str]:
        """Names of the objects that the robot holds."""
        return tuple(self.belief.holding)

    def releases(self, action: Action) -> bool:
        """Check whether an action opens a hand."""
        return self.vocabulary.releases(self.ancestors(action.type))

    def record(self, write: Callable[[str, Mapping[str, Any]], None]) -> None:
        """Set the function that writes changes of the belief to the trace."""
        self._write = write

    def snapshot(self) -> dict[str, Any]:
        """The belief and the remaining applications of rules, as JSON; raises Lost if they cannot be stored."""
        state = {**self.belief.tables(), "revision": self.revision(), "left": self._left, "used": self._used}
        return {key: dump(value) for key, value in state.items()}

    def restore(self, left: Mapping[str, Any]) -> None:
        """Restore a snapshot."""
        state = {key: load(value) for key, value in left.items()}
        self._left, self._used, self._reported = state["left"], state["used"], state["revision"]
        self.belief.restore(state, self._reported)


def _step_name() -> str | None:
    """Name of the node of the action that the calling module performs."""
    node: Node | None = here()[1].node
    while node is not None and node.kind != "perform":
        node = node.parent
    return None if node is None else node.base_name
