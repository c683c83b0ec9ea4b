"""The map of a kitchen: a table with a pancake maker, a bowl, ingredients, and a cup of mix."""

PREFIXES = """
Prefix: : <http://example.org/kitchen.owl#>
Prefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>
Ontology: <http://example.org/kitchen.owl>
"""
THINGS = {
    "table1": ("KitchenTable", (2.0, 0.0, 0.375), (0.8, 2.4, 0.75)),
    "maker1": ("PancakeMaker", (2.0, 0.0, 0.8), (0.3, 0.3, 0.1)),
    "bowl1": ("Bowl-Mixing", (2.0, 0.6, 0.8), (0.2, 0.2, 0.1)),
    "egg1": ("Egg-Chickens", (2.0, 0.9, 0.78), (0.045, 0.045, 0.06)),
    "milk1": ("CowsMilk-Product", (2.0, -0.5, 0.87), (0.07, 0.07, 0.24)),
    "flour1": ("WheatFlour", (2.0, -0.7, 0.83), (0.1, 0.06, 0.16)),
    "cup1": ("Cup", (2.0, -0.9, 0.8), (0.08, 0.08, 0.1)),
}
MIX = "Individual: mix1\n    Types: knowrob:PancakeMix\n    Facts: knowrob:in-ContGeneric cup1, knowrob:amount 200.0\n"


def _frame(name: str, *more: str) -> str:
    cls, place, size = THINGS[name]
    extents = zip(("depthOfObject", "widthOfObject", "heightOfObject"), size, strict=True)
    facts = ", ".join((*more, *(f"knowrob:{prop} {value}" for prop, value in extents)))
    pose = ", ".join(f"knowrob:m{i}{j} {float(i == j)}" for i in range(3) for j in range(3))
    pose += "".join(f", knowrob:m{i}3 {place[i]}" for i in range(3))
    return (
        f"Individual: {name}\n    Types: knowrob:{cls}\n    Facts: {facts}\n"
        f"Individual: seen_{name}\n    Types: knowrob:SemanticMapPerception\n"
        f"    Facts: knowrob:objectActedOn {name}, knowrob:eventOccursAt pose_{name}\n"
        f"Individual: pose_{name}\n    Types: knowrob:RotationMatrix3D\n    Facts: {pose}\n"
    )


def kitchen_map(*, on: bool = False) -> str:
    """Return the map in Manchester syntax; the pancake maker may be on."""
    more = {"maker1": ("knowrob:stateOfObject knowrob:DeviceStateOn",) if on else ()}
    return PREFIXES + "".join(_frame(name, *more.get(name, ())) for name in THINGS) + MIX
