"""Texts of small recipes in Manchester syntax, and pieces of the plans that are made of them."""

from planlang.compiler import CompiledPlan

HEAD = """
Prefix: : <http://planlang.org/test#>
Prefix: room: <http://planlang.org/room#>
Prefix: k: <http://knowrob.org/kb/knowrob.owl#>
Prefix: rdfs: <http://www.w3.org/2000/01/rdf-schema#>
Ontology: <http://planlang.org/test>
Import: <http://knowrob.org/kb/knowrob.owl>

Individual: room:bottle1
    Types: k:DrinkingBottle
Individual: room:cup1
    Types: k:Cup
Individual: room:patient1
    Types: k:Patient
Individual: gripper
    Types: k:HolderGripper
Individual: there
    Types: k:Point2D
    Facts: k:inReachOf room:bottle1
Individual: graspPose
    Types: k:Point3D
    Facts: k:inCenterOf room:bottle1
"""


def orderings(*pairs: str) -> str:
    """Individuals O1, O2, ... for pairs written ``A<B``."""
    lines = []
    for number, pair in enumerate(pairs, 1):
        a, b = pair.split("<")
        lines.append(f"Individual: O{number}\n    Types: k:PartialOrdering-Strict")
        lines.append(f"    Facts: k:occursBeforeInOrdering {a}, k:occursAfterInOrdering {b}")
    return "\n".join(lines)


def task(name: str, steps: str, *more: str, above: str = "k:PurposefulAction", constraints: int = 0) -> str:
    parts = [above, *(f"k:subAction some {step}" for step in steps.split()), *more]
    parts += [f"k:orderingConstraints value O{number}" for number in range(1, constraints + 1)]
    return f"Class: {name}\n    SubClassOf: {', '.join(parts)}\n"


def step(name: str, above: str, *parts: str) -> str:
    return f"Class: {name}\n    SubClassOf: {', '.join((above, *parts))}\n"


def body(plan: CompiledPlan, function: str) -> str:
    """The source of one plan function, from its ``async def``."""
    return plan.source.split(f"async def {function}(")[1].split("\n\n\n")[0]
