"""How designators are made, for the messages about wrong arguments."""

from planlang.misuse import Usage

OBJECT = Usage(
    "an_object",
    {"type": '"DrinkingBottle"'},
    {"iri": '"http://example.org/room.owl#bottle1"', "where": "a_location(on=table)"},
)
RELATION = Usage("Relation", {"name": '"near"', "references": "(table,)"}, {"within": "0.5", "beyond": "0.1"})
LOCATION = Usage(
    "a_location",
    {"in_reach_of=": "bottle"},
    {
        "name": '"pose1"',
        "using": "RIGHT_GRIPPER",
        "grasp": '"side"',
        "not_": "a_location(near=door)",
        "relations": "()",
    },
)
ACTION = Usage("action", {"type": '"Reaching"'}, {"name": '"reach"', "object_acted_on": "bottle"})
ACTION_CLASS = Usage("action_class", {"iri": '"http://example.org/soup#StirSoup"'}, {"below": '"Stirring"'})
SITUATION = Usage("a_situation", {"type": '"DoorOpen"'}, {"object_acted_on": "door"})
CONDITION = Usage("Condition", {"predicate": '"holding"', "arguments": "(bottle,)"})
HOLDING = Usage("holding", {"what": "bottle"})
LOCATED = Usage("located", {"where": "a_location(near=table)"}, {"what": "bottle"})
POSE = Usage("a_pose", {"x": "1.0", "y": "0.0"}, {"name": '"origin"', "z": "0.0", "yaw": "0.0"})
POSTURE = Usage("a_posture", {"name": '"carrying"'})
