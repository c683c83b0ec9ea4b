"""Ask through owlready2 what a recipe's ontology says of bottles."""

from planlang.files import Bundled
from planlang.ontology import load

world = load(Bundled.RECIPE.find("serve_a_drink")).to_owlready()
knowrob = world.get_namespace("http://knowrob.org/kb/knowrob.owl#")
for cls in sorted(knowrob.Bottle.descendants(), key=str):
    print(cls.name, *(f"{one.property.name}={one.value}" for one in cls.is_a if hasattr(one, "property")))
