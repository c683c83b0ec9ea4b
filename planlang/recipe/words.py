"""The words of the recipe vocabulary: properties that are told by their local names, and what outcomes consist of."""

from __future__ import annotations

import re

from planlang.designators import local_name
from planlang.recipe.model import Ending

WORDS = (
    "subAction",
    "subEvents",
    "orderingConstraints",
    "occursBeforeInOrdering",
    "occursAfterInOrdering",
    "inputOutputConstraints",
    "createsOutput",
    "requiresInput",
    "resourceType",
    "outputsCreated",
    "stateTransition",
    "fromState",
    "toState",
    "causedBy",
    "taskStartState",
    "taskEndState",
    "conditionEvaluated",
    "nextAction",
    "previousAction",
    "adtMainObject",
    "adtPrimaryObject",
    "adtSecondaryObject",
    "taskContext",
    "instruction",
    "hasStep",
    "isStepOf",
    "stepOf",
    "definesTask",
    "isPlanFor",
    "isTaskDefinedIn",
    "isDefinedIn",
    "hasPlan",
    "isTaskOf",
    "hasTask",
    "classifies",
    "isClassifiedBy",
    "hasBindingRole",
    "hasBindingFiller",
)
"""Local names of the properties that readers of dialects take up, whatever namespace they stand in."""

NAMING = (
    "subAction", "subEvents", "orderingConstraints", "occursBeforeInOrdering", "occursAfterInOrdering",
    "inputOutputConstraints", "createsOutput", "requiresInput", "stateTransition", "fromState", "toState", "causedBy",
    "taskStartState", "taskEndState", "nextAction", "previousAction", "hasStep", "definesTask",
)  # fmt: skip
"""Those whose values are names of actions, constraints, states or outcomes, never texts."""

MEANINGS: dict[Ending, tuple[str, ...]] = {
    Ending.FAILED: (
        "failed", "fail", "fails", "failure", "failures", "failing", "error", "errors", "aborted", "abort", "aborts",
        "timeout", "unsuccessful", "preempted", "cancelled", "canceled", "notok", "nok",
    ),
    Ending.DONE: (
        "ok", "okay", "completed", "complete", "completes", "completion", "successful", "successfully", "succeeded",
        "succeed", "succeeds", "success", "done", "finished", "finish", "finishes",
    ),
    Ending.TRUE: ("true", "yes", "obtain", "obtains", "hold", "holds"),
    Ending.FALSE: ("false", "no", "not"),
}  # fmt: skip
"""What the words in the names of outcomes mean; of those that are alike the usual one first."""

_IN_NAMES = re.compile(r"[A-Z]?[a-z]+|[A-Z]+|\d+")


def words_of(outcome: str) -> tuple[str, ...]:
    """The words in the local name of an outcome, as written."""
    return tuple(_IN_NAMES.findall(local_name(outcome)))


def ending_of(outcome: str) -> Ending:
    """What an outcome means, told by the words in its local name, such as COMPLETED_OK or CONDITION_FALSE."""
    words = {word.lower() for word in words_of(outcome)}
    said = {ending for ending, meaning in MEANINGS.items() if not words.isdisjoint(meaning)}
    if Ending.FAILED in said:
        return Ending.FAILED
    if Ending.FALSE in said:
        return Ending.FAILED if Ending.DONE in said else Ending.FALSE
    return Ending.TRUE if Ending.TRUE in said else Ending.DONE if Ending.DONE in said else Ending.OTHER
