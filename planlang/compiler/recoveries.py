"""Choose the recoveries of steps from the rules in ontologies, and check these rules."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from collections.abc import Set as AbstractSet

import planlang.failures as failures
from planlang.compiler.tree import Recover
from planlang.diagnostics import Diagnostic, error, warning
from planlang.failures import (
    LookingFailure,
    ManipulationFailure,
    ManipulationGoalInCollision,
    ObjectUndeliverable,
    ObjectUnreachable,
    PlanFailure,
)
from planlang.language.location import CURABLE
from planlang.language.recovery import retry
from planlang.recipe.actions import Actions, RecoveryRule, gone_to, recoveries_of
from planlang.recipe.checks import check
from planlang.recipe.model import Kind, Place, Step, Thing
from planlang.recoveries import Strategy, find_strategy, look_and_repeat, registered_strategies
from planlang.spelling import similar

NEXT_SOLUTION = "NextSolution"
"""Strategy that a location scope performs, and that is therefore not registered: try the next base pose."""

CURED = frozenset(failure.__name__ for failure in CURABLE)
"""Failures for which a location scope tries the next base pose; rules cannot change this list."""

RAISED = (ObjectUnreachable.__name__, ObjectUndeliverable.__name__)
"""Failures that a location scope raises after its last base pose: with nothing in the hand, and with something."""

UNRESOLVED = frozenset(
    name
    for name, kind in vars(failures).items()
    if isinstance(kind, type) and issubclass(kind, failures.LocationUnresolvable)
)
"""Failures of a base motion instead of which a location scope raises those."""

FROM_HERE = frozenset(kind.__name__ for kind in CURABLE if issubclass(kind, (ManipulationFailure, LookingFailure)))
"""Those that are retried from the same base pose outside a scope: what was seen or felt changes the motion."""
FELT = frozenset({ManipulationGoalInCollision.__name__})
"""Those of them that a contact has shown, so that the belief has changed; before the others, the robot looks."""
ATTEMPTS_FROM_HERE = 2
REPEAT, LOOK = Strategy("Repeat", retry), Strategy("LookAndRepeat", look_and_repeat, about_object=True)


@check("R043", "R044")
def check_recoveries(rules: tuple[RecoveryRule, ...]) -> Iterator[Diagnostic]:
    """Report unknown names and malformed numbers in recovery rules (errors), and rules without effect (warnings)."""
    classes = {
        name for name, value in vars(failures).items() if isinstance(value, type) and issubclass(value, PlanFailure)
    }
    for rule in rules:
        yield from rule.problems
        named = [*rule.failures, *([rule.escalates_to] if rule.escalates_to else [])]
        for name in (name for name in named if name not in classes):
            yield _unknown(rule, "failure", name, classes)
        if rule.strategy == NEXT_SOLUTION:
            yield from _other_than_a_scope(rule)
        else:
            yield from _unregistered(rule)


def _unregistered(rule: RecoveryRule) -> Iterator[Diagnostic]:
    """Report a rule whose strategy is not registered."""
    try:
        is_registered = find_strategy(rule.strategy) is not None
    except Exception as failed:  # the user's package may raise anything
        message = f"the strategy {rule.strategy} of the recovery `{rule.name}` cannot be loaded"
        yield error("R043", message, rule.span, "; ".join([f"{type(failed).__name__}: {failed}", *failed.__notes__]))
        return
    if not is_registered:
        names = {one.name for one in registered_strategies()}
        yield _unknown(rule, "strategy", rule.strategy, names | {NEXT_SOLUTION})


def _other_than_a_scope(rule: RecoveryRule) -> Iterator[Diagnostic]:
    """Report a rule for the next base pose that a location scope cannot follow."""
    if set(rule.failures) != CURED:
        message = f"the recovery `{rule.name}` cannot change the failures for which the next base pose is tried"
        yield warning("R044", message, rule.span, f"name exactly {', '.join(sorted(CURED))}")
    if rule.escalates_to is not None and rule.escalates_to not in RAISED:
        message = f"the recovery `{rule.name}` cannot escalate to {rule.escalates_to}"
        advice = f"leave it out: after the last base pose {RAISED[0]} is raised, or {RAISED[1]} if something is held"
        yield warning("R044", message, rule.span, advice)


def _unknown(rule: RecoveryRule, what: str, name: str, known: AbstractSet[str]) -> Diagnostic:
    similar_names = similar(name, sorted(known))
    advice = f"did you mean {similar_names[0]}?" if similar_names else f"known: {', '.join(sorted(known))}"
    return error("R043", f"the recovery `{rule.name}` names an unknown {what} {name}", rule.span, advice)


class Recoveries:
    """Chooses recoveries for the steps of recipes."""

    def __init__(self, actions: Actions) -> None:
        self._ontology = actions.ontology
        self._rules = actions.recoveries
        self._acted_on = frozenset(action for rule in self._rules for action in rule.actions)
        self._known: dict[tuple[str, ...], list[tuple[str, RecoveryRule]]] = {}
        """Ancestors with rules -> rules that apply to their common subclasses."""
        self._actions = actions

    def _of(self, cls: str) -> list[tuple[str, RecoveryRule]]:
        """Cached :func:`recoveries_of` of a class; many classes share them."""
        ancestors = tuple(name for name in self._ontology.ancestors(cls) if name in self._acted_on)
        rules = self._known.get(ancestors)
        if rules is None:
            rules = self._known[ancestors] = recoveries_of(self._ontology, self._rules, cls)
        return rules

    def attempts_at_places(self, step: Step) -> int:
        """Number of base poses that the scope of a base motion tries; one if no rule is about the next pose."""
        attempts = [rule.attempts for _, rule in self._of(step.iri) if rule.strategy == NEXT_SOLUTION]
        return max(attempts, default=1)

    def around_step(self, cls: str, about: Thing | None, written: frozenset[str]) -> tuple[Recover, ...]:
        """Recoveries of a class that keep the base in place; ``written`` names rules that surround the step already."""
        return _first_of_each(
            _recover(failure, rule, strategy, about)
            for failure, rule in self._of(cls)
            if (strategy := find_strategy(rule.strategy)) is not None
            and not strategy.moves_base
            and not strategy.goes_back
            and rule.name not in written
            and (about is not None or not strategy.about_object)
        )

    def names(self, cls: str) -> frozenset[str]:
        """Names of the rules that apply to a class."""
        return frozenset(rule.name for _, rule in self._of(cls))

    def around_scope(self, step: Step, *, in_scope: bool = True, alone: bool = False) -> tuple[Recover, ...]:
        """Recoveries that move the base: those of the step's class, and of the actions that its primitive implies.

        Outside a scope, which could try the next base pose, failures that this might cure are retried from here.
        ``alone``: a base motion that begins no scope, and itself fails where a scope would raise a failure of its own.
        """
        about, classes = self.looked_at(step) or self._driven_to(step), [step.iri]
        if (primitive := self._actions.primitive(step)) is not None:
            classes += primitive.implies
        chosen: dict[str, Recover] = {}
        for failure, rule in (pair for cls in classes for pair in self._of(cls)):
            if rule.strategy == NEXT_SOLUTION:
                if not in_scope and failure in FROM_HERE and (about is not None or failure in FELT):
                    again = REPEAT if failure in FELT else LOOK
                    looked = about if again.about_object else None
                    chosen.setdefault(failure, Recover(failure, again, looked, ATTEMPTS_FROM_HERE, rule.escalates_to))
                continue
            if failure in UNRESOLVED and not alone and self._actions.is_base_motion(step):
                continue
            strategy = find_strategy(rule.strategy)
            if about is not None and strategy is not None and strategy.moves_base and not strategy.goes_back:
                chosen.setdefault(failure, _recover(failure, rule, strategy, about))
        return tuple(chosen.values())

    def going_back(self, cls: str, about: Thing | None) -> tuple[Recover, ...]:
        """Recoveries of an action that run it again when a later step fails."""
        return _first_of_each(
            _recover(failure, rule, strategy, about)
            for failure, rule in self._of(cls)
            if about is not None and (strategy := find_strategy(rule.strategy)) is not None and strategy.goes_back
        )

    def looked_at(self, step: Step) -> Thing | None:
        """Thing that has to be seen before a step acts: the object that it handles, or the recipient."""
        if step.primitive is not None and self._actions.releases(step):
            return next((filler for filler in step.fillers("recipient") if isinstance(filler, Thing)), None)
        for filler in step.fillers("objectActedOn"):
            if isinstance(filler, Thing) and filler.kind is Kind.OBJECT:
                return filler
        candidates = (thing for filler in step.fillers("toLocation") for thing in gone_to(filler))
        return next((thing for thing in candidates if thing.kind is Kind.OBJECT), None)

    def _driven_to(self, step: Step) -> Thing | None:
        """Object to which a base motion has its goal in a relation, such as near it."""
        places = (place for place in step.fillers("toLocation") if isinstance(place, Place))
        things = (one for place in places for _, references in place.relations for one in references)
        objects = (one for one in things if isinstance(one, Thing) and one.kind is Kind.OBJECT)
        return next(objects, None) if self._actions.is_base_motion(step) else None


def _recover(failure: str, rule: RecoveryRule, strategy: Strategy, about: Thing | None) -> Recover:
    return Recover(
        failure,
        strategy,
        about if strategy.about_object else None,
        rule.attempts,
        rule.escalates_to,
        within=rule.within,
    )


def _first_of_each(recoveries: Iterable[Recover]) -> tuple[Recover, ...]:
    """Keep the first recovery for each failure: a second one in the same place would never be asked."""
    chosen: dict[str, Recover] = {}
    for one in recoveries:
        chosen.setdefault(one.failure, one)
    return tuple(chosen.values())
