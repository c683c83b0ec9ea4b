"""A room with a can and a box on a table, and a cabinet with a door, as a map."""

ROOM = """
Prefix: : <http://example.org/room.owl#>
Prefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>
Ontology: <http://example.org/room.owl>
    Import: <http://knowrob.org/kb/knowrob.owl>

Individual: table1
    Types: knowrob:KitchenTable
    Facts: knowrob:translation "2 0 0.37", knowrob:boundingBoxSize "0.6 1.2 0.74"
Individual: can1
    Types: knowrob:DrinkingCan
    Facts: knowrob:translation "1.85 0 0.805", knowrob:boundingBoxSize "0.066 0.066 0.13"
Individual: box1
    Types: knowrob:Box-Container
    Facts: knowrob:translation "1.85 0.3 0.79", knowrob:boundingBoxSize "0.1 0.1 0.1"
Individual: cabinet1
    Types: knowrob:Cabinet-PieceOfFurniture
    Facts: knowrob:translation "0 3 0.5", knowrob:boundingBoxSize "0.5 0.6 1.0", knowrob:properPhysicalParts door1
Individual: door1
    Types: knowrob:Door
    Facts: knowrob:translation "0.26 3 0.5", knowrob:boundingBoxSize "0.02 0.6 1.0", knowrob:hingedTo cabinet1
"""
