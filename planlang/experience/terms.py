"""Names of DUL, SOMA and planlang's own vocabulary of experience (ontologies/experience.omn) in a narrative."""

from __future__ import annotations

from planlang.experience.model import About, State
from planlang.ontology.terms import Namespace

DUL = Namespace(
    "http://www.ontologydesignpatterns.org/ont/dul/DUL.owl#",
    """Action Agent InformationObject Role Task TimeInterval classifies definesTask executesTask hasConstituent
    hasParticipant hasTimeInterval includesAction includesAgent includesObject includesTime isExecutedIn isTaskOf""",
)
SOMA = Namespace(
    "http://www.ease-crc.org/ont/SOMA.owl#",
    """Episode ExecutionState_Active ExecutionState_Cancelled ExecutionState_Failed ExecutionState_Succeeded hasFilePath
    hasExecutionState hasIntervalBegin hasIntervalEnd includesRecord isPerformedBy""",
)
EXPERIENCE = Namespace(
    "http://planlang.org/kb/experience.owl#",
    """ActionDesignator GoalDesignator LocationDesignator ObjectDesignator Occurrence Resolution atStep base beginStep
    details describedBy endStep environment event failedWith filler hasCause hasOccurrence hasResolution
    includesFailure includesRecoveredFailure isWhole json kind message nodeName number other
    parameters planName property rate recoveredFrom recipe resolvedAs resolvedTo resolves result robot schedule seed
    text thingIri thingKind thingType typeName value where began""",
)
PREFIXES = {"dul": str(DUL), "soma": str(SOMA), "experience": str(EXPERIENCE)}

STATES = {
    State.SUCCEEDED: SOMA.ExecutionState_Succeeded,
    State.FAILED: SOMA.ExecutionState_Failed,
    State.EVAPORATED: SOMA.ExecutionState_Cancelled,
    State.RUNNING: SOMA.ExecutionState_Active,
}
DESIGNATORS = {
    About.ACTION: EXPERIENCE.ActionDesignator,
    About.LOCATION: EXPERIENCE.LocationDesignator,
    About.GOAL: EXPERIENCE.GoalDesignator,
    About.OBJECT: EXPERIENCE.ObjectDesignator,
}
