"""The words of the recipe vocabulary: properties that are told by their local names, and what outcomes consist of."""

from __future__ import annotations

import re

from planlang.designators import local_name
from planlang.recipe.model import Ending

ON_ACTIONS = (
    "subAction", "subEvents", "orderingConstraints", "inputOutputConstraints", "stateTransition", "taskStartState",
    "taskEndState", "nextAction", "previousAction", "conditionEvaluated", "isTaskOf", "hasStep", "definesTask",
)  # fmt: skip
"""Properties (local names, whatever their namespace) that say of what actions consist, and in what order."""

ON_INDIVIDUALS = (
    "occursBeforeInOrdering", "occursAfterInOrdering", "isStepOf", "stepOf", "isPlanFor", "isTaskDefinedIn",
    "isDefinedIn", "hasPlan", "adtMainObject", "adtPrimaryObject", "adtSecondaryObject", "taskContext", "instruction",
)  # fmt: skip
"""Those of constraints, workflows and action data tables that describe no object and no place."""

WORDS = (
    *ON_ACTIONS, *ON_INDIVIDUALS,
    "createsOutput", "requiresInput", "resourceType", "outputsCreated", "fromState", "toState", "causedBy",
    "hasTask", "classifies", "isClassifiedBy", "hasBindingRole", "hasBindingFiller",
)  # fmt: skip
"""All that readers of dialects take up."""

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
