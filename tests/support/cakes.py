"""A kitchen with frosting on a table, and what makes an iced cake of that: classes, an effect and a process module."""

ROOM = """
Prefix: : <http://example.org/cakes.owl#>
Prefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>
Ontology: <http://example.org/cakes.owl>
    Import: <http://knowrob.org/kb/knowrob.owl>

Individual: cakes
    Types: knowrob:SemanticEnvironmentMap
Individual: table1
    Types: knowrob:KitchenTable
    Facts: knowrob:describedInMap cakes, knowrob:pose place_of_table,
        knowrob:depthOfObject 0.7, knowrob:widthOfObject 1.2, knowrob:heightOfObject 0.74
Individual: place_of_table
    Types: knowrob:RotationMatrix3D
    Facts: knowrob:translation "1.6 0 0.37", knowrob:quaternion "0 0 0 1"
Individual: frosting1
    Types: Frosting
    Facts: knowrob:describedInMap cakes, knowrob:pose place_of_frosting,
        knowrob:depthOfObject 0.06, knowrob:widthOfObject 0.06, knowrob:heightOfObject 0.08
Individual: place_of_frosting
    Types: knowrob:RotationMatrix3D
    Facts: knowrob:translation "1.5 0 0.78", knowrob:quaternion "0 0 0 1"
"""
ICING = """
Class: Frosting
    SubClassOf: knowrob:FoodOrDrink
Class: IcedCake
    SubClassOf: knowrob:FoodOrDrink
Class: Icing
    SubClassOf: knowrob:ActionOnObject
Individual: icing_change
    Types: knowrob:ObjectChange
    Facts: knowrob:byAction Icing, knowrob:inputsDestroyed Frosting, knowrob:outputsCreated IcedCake
"""
"""Classes of cakes, and the effect of icing."""
ICER = """
from planlang import process_module, sleep


@process_module
class Icer:
    name, actions, failures = "icer", ("Icing",), ()

    def __init__(self, platform):
        self.platform = platform

    def resources(self, action):
        return ()

    async def execute(self, action):
        await sleep(1.0)
"""
"""A process module that ices, and moves nothing."""
