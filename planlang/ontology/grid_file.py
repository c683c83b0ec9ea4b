"""Reads the YAML file of an occupancy grid, as ROS map_server writes it, as the statement that there is such a map.

What the grid holds is read by who uses it, beside the file.
"""

from __future__ import annotations

from pathlib import Path

from planlang.diagnostics import Span
from planlang.ontology.terms import OWL, RDF, Literal, expand
from planlang.ontology.triples import Parsed, Triples

OCCUPANCY_GRID = "http://www.roboearth.org/kb/roboearth.owl#OccupancyGridMap"


def read_grid_file(path: Path, base: str) -> Parsed:
    """Return the map that a file is: an individual of its name, with the link to the file."""
    span, triples = Span(str(path)), Triples(str(path))
    own = f"{base}#map"
    triples.state(base, RDF.type, OWL.Ontology, span)
    triples.state(own, RDF.type, OCCUPANCY_GRID, span)
    triples.state(own, expand("linkToMapFile"), Literal(path.name), span)
    return Parsed(triples, [])
