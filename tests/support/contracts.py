"""Types of import contracts that see imports by string, too, and one that forbids circles of modules everywhere.

``[tool.importlinter]`` in pyproject.toml names them in the place of import-linter's own, whose graph has the statements
alone. Which strings import is defined where they are counted, in tests/counts.py.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

import networkx
from grimp import ImportGraph
from importlinter import Contract, ContractCheck, output
from importlinter.contracts.acyclic_siblings import AcyclicSiblingsContract
from importlinter.contracts.forbidden import ForbiddenContract
from importlinter.contracts.layers import LayersContract

from tests.counts import Checkout


@cache
def _imports(folder: Path) -> list[tuple[str, str, int, str]]:
    """Return the imports by string of a checkout: importer, imported module, line and its text."""
    checkout = Checkout(folder)
    return [
        (importer, imported, line, source.text.splitlines()[line - 1].strip())
        for importer, source in checkout.modules.items()
        for imported, line in checkout.by_string(source)
        if imported != importer
    ]


class _ByString(Contract):
    """Adds imports by string to the graph that a contract gets."""

    def check(self, graph: ImportGraph, verbose: bool) -> ContractCheck:
        for importer, imported, line, text in _imports(Path.cwd()):
            if {importer, imported} <= graph.modules:
                graph.add_import(importer=importer, imported=imported, line_number=line, line_contents=text)
        return super().check(graph, verbose)  # type: ignore[safe-super]


class Forbidden(_ByString, ForbiddenContract):
    """Modules must not import others."""


class Layers(_ByString, LayersContract):
    """Modules import those of lower layers alone."""


class AcyclicSiblings(_ByString, AcyclicSiblingsContract):
    """Parts of a package import each other one way."""


class _Circles(Contract):
    def check(self, graph: ImportGraph, verbose: bool) -> ContractCheck:
        edges = ((one, other) for one in graph.modules for other in graph.find_modules_directly_imported_by(one))
        knots = networkx.strongly_connected_components(networkx.DiGraph(edges))
        circles = sorted(sorted(knot) for knot in knots if len(knot) > 1)
        return ContractCheck(kept=not circles, metadata={"circles": circles})

    def render_broken_contract(self, check: ContractCheck) -> None:
        for circle in check.metadata["circles"]:
            output.print_error(f"These modules import each other: {', '.join(circle)}.")


class Acyclic(_ByString, _Circles):
    """No module imports one that imports it, by whatever way."""
