"""Task tree of a run, read from its trace, with exports to text, JSON Lines, dot and Mermaid."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Iterator, Mapping
from functools import cached_property
from typing import Any

from planlang.misuse import Usage
from planlang.runs import DamagedTrace, RecordedRun, RunTree, TaskNode, Trace
from planlang.visible import for_dot, for_mermaid

_OF = Usage("TaskTree.of", {"trace": "trace"})
_READ = Usage("TaskTree.read", {"path": '"run.jsonl"'})


class TaskTree(RunTree):
    """Task tree of a run; ``roots`` contains the top-level plan."""

    @classmethod
    def of(cls, trace: Trace | Iterable[Mapping[str, Any]]) -> TaskTree:
        """Build the tree of a trace in memory, or of its records.

        Raises ValueError for a trace that was written to a file; use :meth:`read` for files.
        """
        if not isinstance(trace, Trace):
            _OF.iterable("trace", trace, "a trace in memory, or its records")
            return cls(trace)
        if not trace.events:
            raise ValueError(
                "this trace has no records in memory\n"
                '  wrong: TaskTree.of(Trace.at("run.jsonl"))\n'
                '  right: TaskTree.read("run.jsonl"), or Trace() without a file'
            )
        return cls(trace.events)

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> TaskTree:
        """Read the tree of a trace file, without a last line that was cut off by a crash.

        Raises ValueError, with file and line, if the file is not a trace.
        """
        _READ.instance("path", path, (str, os.PathLike), "the path of a trace file")
        if path == "":
            raise _READ.empty("path")
        try:
            return cls(line.record for line in RecordedRun.read(path).lines)
        except DamagedTrace as damage:
            raise ValueError(f"{path}:{damage.line}: {damage}") from None

    @cached_property
    def nodes(self) -> dict[str, TaskNode]:
        """The nodes by path, in order of their start."""
        return {node.path: node for node in self.numbered.values()}

    def __iter__(self) -> Iterator[TaskNode]:
        """Yield the nodes from the root, children in order of their start."""
        stack = list(reversed(self.roots))
        while stack:
            node = stack.pop()
            yield node
            stack.extend(reversed(node.children))

    def __str__(self) -> str:
        """Format the tree as indented text, one line per node: start, duration, status, and where a failure arose."""
        return tree_of(self.roots)

    def json_lines(self) -> str:
        """Export a JSON object per node, parents first: path, parent, kind, name, status, start, end [s], and more."""
        return "".join(json.dumps(node.record(), ensure_ascii=False) + "\n" for node in self)

    def dot(self) -> str:
        """Export a graph for Graphviz's ``dot``; colours show the status."""
        numbers = {node: number for number, node in enumerate(self)}
        lines = ["digraph plan {", '  node [shape=box, style=filled, fontname="sans-serif"];']
        for node, number in numbers.items():
            label = for_dot("\n".join(_lines(node)))
            lines.append(f'  n{number} [label="{label}", fillcolor="{_COLOURS[node.status]}"];')
        lines += [f"  n{numbers[node.parent]} -> n{number};" for node, number in numbers.items() if node.parent]
        return "\n".join([*lines, "}", ""])

    def mermaid(self) -> str:
        """Export a flowchart for Mermaid, which Markdown renderers show; colours show the status."""
        numbers = {node: number for number, node in enumerate(self)}
        lines = ["flowchart TD"]
        lines += [f"  classDef {status} fill:{colour},color:#000" for status, colour in _COLOURS.items()]
        for node, number in numbers.items():
            label = for_mermaid("\n".join(_lines(node)))
            lines.append(f'  n{number}["{label}"]:::{node.status}')
        lines += [f"  n{numbers[node.parent]} --> n{number}" for node, number in numbers.items() if node.parent]
        return "\n".join([*lines, ""])


def tree_of(nodes: Iterable[TaskNode]) -> str:
    """Format the trees of the root nodes among ``nodes`` as indented text, see :meth:`TaskTree.__str__`."""
    lines: list[str] = []
    stack = [(node, 0) for node in reversed([*nodes]) if node.parent is None]
    while stack:
        node, depth = stack.pop()
        children = node.children
        if node.kind == "perform" and len(children) == 1 and children[0].kind == "branch":
            children = children[0].children  # skip the node of the module, which adds no information
        arose_below = bool(node.reason) and any(child.reason == node.reason for child in children)
        text = node.summary().split(" with ", 1)[0] if arose_below else node.summary()
        lines.append(f"{'  ' * depth}{_title(node)}: {text}")
        stack.extend((child, depth + 1) for child in reversed(children))
    return "\n".join(lines)


def _title(node: TaskNode) -> str:
    text = node.parameters.get("action")
    if not isinstance(text, str):
        return node.name
    is_named_by_class = node.name.split("#", 1)[0] == node.action
    return node.name + text[text.index("(") :] if is_named_by_class else f"{node.name}, {text}"


_COLOURS = {"succeeded": "#c8e6c9", "failed": "#ffcdd2", "evaporated": "#e0e0e0", "running": "#fff9c4"}


def _lines(node: TaskNode) -> Iterator[str]:
    """Yield the lines of the label of a node."""
    yield node.name if node.kind in ("branch", node.name.partition("#")[0]) else f"{node.kind} {node.name}"
    if node.start is None:
        yield f"{node.status}, never begun"
    else:
        yield f"{node.status} {node.start:g}-{'' if node.end is None else format(node.end, 'g')} s"
    if node.failure is not None:
        yield node.reason
