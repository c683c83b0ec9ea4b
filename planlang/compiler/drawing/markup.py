"""Write the graph for other layout programs: DOT for Graphviz, a flowchart for Mermaid."""

from __future__ import annotations

from collections.abc import Iterator

from planlang.compiler.drawing.task_graph import LONGEST_LINE, Arrow, Box, Group, Order, TaskGraph, shown
from planlang.visible import for_dot, for_mermaid

_ATTRIBUTES = """\
    compound=true; rankdir=TB; newrank=true; nodesep=0.35; ranksep=0.45;
    fontname="Helvetica"; fontsize=14; labeljust=l; tooltip=" ";
    node [shape=box, style="rounded,filled", fillcolor="#f5f8fb", color="#7d93a6", fontname="Helvetica", fontsize=11];
    edge [color="#44546a", arrowsize=0.7];
"""


def dot(graph: TaskGraph) -> str:
    """Write the graph in DOT: steps are nodes, nested recipes are clusters, implied orders are left out."""
    lines = [f'digraph "{for_dot(graph.title)}" {{', _ATTRIBUTES.rstrip("\n")]
    lines.append(f'    label="{for_dot(graph.title)}\\l{for_dot(graph.subtitle)}\\l"; labelloc=t;')
    lines += _group(graph.group, "    ")
    return "\n".join([*lines, "}", ""])


def _group(group: Group, indent: str) -> Iterator[str]:
    for box in group.boxes:
        yield from _box(box, indent)
    boxes = {box.key: box for box in group.boxes}
    for arrow in group.of(Order.STATED, Order.ADDED, Order.TRANSITION, Order.OVERLAP):
        yield _arrow(arrow, boxes, indent)


def _box(box: Box, indent: str) -> Iterator[str]:
    hover = "\\n".join(map(for_dot, box.hover))
    label = "".join(f"{for_dot(line)}\\l" for line in box.text())
    if not box.groups:
        style = ', style="rounded,dashed"' if box.is_abstract else ""
        yield f'{indent}{box.key} [label="{label}", tooltip="{hover}"{style}];'
        return
    yield f"{indent}subgraph cluster_{box.key} {{"
    yield f'{indent}    label="{label}"; tooltip="{hover}"; labelloc=t; fontsize=11;'
    yield f'{indent}    style="rounded,filled"; fillcolor="#fbf9f3"; color="#c7b98f";'
    if len(box.groups) == 1:
        yield from _inside(box.groups[0], indent + "    ")
    else:
        for group in box.groups:
            yield f"{indent}    subgraph cluster_{group.key} {{"
            yield f'{indent}        label="one way: {for_dot(group.name)}"; style="rounded,dashed";'
            yield from _inside(group, indent + "        ")
            yield f"{indent}    }}"
    yield f"{indent}}}"


def _inside(group: Group, indent: str) -> Iterator[str]:
    if not group.boxes:
        yield f'{indent}{group.key} [shape=point, style=invis, label=""];'
    yield from _group(group, indent)


def _arrow(arrow: Arrow, boxes: dict[str, Box], indent: str) -> str:
    tail, head = boxes[arrow.before], boxes[arrow.after]
    attributes = [f'tooltip="{for_dot(arrow.hover)}"']
    if tail.groups:
        attributes.append(f"ltail=cluster_{tail.key}")
    if head.groups:
        attributes.append(f"lhead=cluster_{head.key}")
    if arrow.label:
        attributes.append(f'label="{for_dot(arrow.label)}", fontsize=9, fontname="Helvetica"')
    if arrow.order is Order.TRANSITION:
        attributes.append('color="#3f6b4f"')
    if arrow.order is Order.OVERLAP:
        attributes.append('dir=none, style=dotted, constraint=false, color="#8a4f8f"')
    if arrow.order is Order.ADDED:
        attributes.append('style=dashed, color="#b0741a"')
    return f"{indent}{_end(tail, -1)} -> {_end(head, 0)} [{', '.join(attributes)}];"


def _end(box: Box, index: int) -> str:
    """Node where an arrow from or to a box ends: in a cluster, a last step (-1) or a first one (0)."""
    while box.groups:
        group = box.groups[index]
        if not group.boxes:
            return group.key
        linked = {arrow.before if index else arrow.after for arrow in group.of(Order.STATED, Order.ADDED)}
        free = [inner for inner in group.boxes if inner.key not in linked] or list(group.boxes)
        box = free[index]
    return box.key


_LINKS = {Order.STATED: "-->", Order.ADDED: "-.->", Order.TRANSITION: "-->", Order.OVERLAP: "-.-"}


def mermaid(graph: TaskGraph) -> str:
    """Write the graph as a flowchart: nested recipes are subgraphs, implied orders are left out, labels give lines.

    There are no tooltips, because Mermaid needs a script for them.
    """
    title = f"{for_mermaid(graph.title)}<br/>{for_mermaid(graph.subtitle)}"
    lines = ["flowchart TD", f'    subgraph {graph.group.key}["{title}"]']
    lines += _flowchart_group(graph.group, "        ")
    lines += ["    end", "    classDef abstract stroke-dasharray: 4 3"]
    unperformed = [box.key for group in graph.groups() for box in group.boxes if box.is_abstract]
    if unperformed:
        lines.append(f"    class {','.join(unperformed)} abstract")
    return "\n".join([*lines, ""])


def _flowchart_group(group: Group, indent: str) -> Iterator[str]:
    for box in group.boxes:
        yield from _flowchart_box(box, indent)
    for arrow in group.of(*_LINKS):
        label = f'|"{for_mermaid(arrow.label)}"|' if arrow.label else ""
        yield f"{indent}{arrow.before} {_LINKS[arrow.order]}{label} {arrow.after}"


def _flowchart_box(box: Box, indent: str) -> Iterator[str]:
    lines = [*box.text(), *([f"line {box.line}"] if box.line is not None else [])]
    label = "<br/>".join(map(for_mermaid, lines))
    if not box.groups:
        yield f'{indent}{box.key}["{label}"]'
        return
    yield f'{indent}subgraph {box.key}["{label}"]'
    if len(box.groups) == 1:
        yield from _flowchart_group(box.groups[0], indent + "    ")
    else:
        for group in box.groups:
            yield f'{indent}    subgraph {group.key}["one way: {for_mermaid(shown(group.name, LONGEST_LINE))}"]'
            yield from _flowchart_group(group, indent + "        ")
            yield f"{indent}    end"
    yield f"{indent}end"
