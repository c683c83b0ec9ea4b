"""The graph as one HTML page that needs nothing else: pan, zoom, and implied orders on demand."""

from __future__ import annotations

import base64
import hashlib

from planlang.compiler.drawing.model import Order, TaskGraph
from planlang.compiler.drawing.svg import svg_element
from planlang.compiler.drawing.text import for_xml

_STYLE = """\
html, body { margin: 0; height: 100%; overflow: hidden; background: #ffffff; }
body { font: 13px Helvetica, Arial, sans-serif; color: #1f2d3a; }
svg { width: 100%; height: 100%; cursor: grab; touch-action: none; }
svg.all .implied, svg .implied.shown { display: inline; }
.step { cursor: pointer; }
.step.chosen > rect { stroke-width: 2.5; }
#bar { position: fixed; right: 12px; top: 12px; padding: 6px 10px; background: #f5f8fb; border: 1px solid #7d93a6;
  border-radius: 6px; }
#bar button { margin-left: 10px; }
"""

_SCRIPT = """\
const svg = document.querySelector('svg'), all = document.getElementById('all');
const whole = svg.getAttribute('viewBox').split(' ').map(Number);
let view = whole.slice(), from = null, moved = false;
const show = () => svg.setAttribute('viewBox', view.join(' '));
const point = event => new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
svg.addEventListener('wheel', event => {
  event.preventDefault();
  const at = point(event), factor = Math.exp(Math.sign(event.deltaY) * 0.15);
  if (view[2] * factor > whole[2] * 20 || view[2] * factor < whole[2] / 100) return;
  view = [at.x - (at.x - view[0]) * factor, at.y - (at.y - view[1]) * factor, view[2] * factor, view[3] * factor];
  show();
}, {passive: false});
svg.addEventListener('pointerdown', event => { from = point(event); moved = false; });
svg.addEventListener('pointermove', event => {
  if (!from || !event.buttons) return;
  const to = point(event);
  moved = moved || Math.hypot(to.x - from.x, to.y - from.y) > view[2] / 300;
  view[0] += from.x - to.x;
  view[1] += from.y - to.y;
  show();
});
svg.addEventListener('pointerup', () => { from = null; });
svg.addEventListener('click', event => {
  const step = event.target.closest('.step');
  if (moved || !step) return;
  const key = step.dataset.key, on = step.classList.toggle('chosen');
  for (const path of svg.querySelectorAll('.implied'))
    if (path.dataset.before === key || path.dataset.after === key) path.classList.toggle('shown', on);
});
all.addEventListener('change', () => svg.classList.toggle('all', all.checked));
document.getElementById('fit').addEventListener('click', () => { view = whole.slice(); show(); });
"""


def page(graph: TaskGraph) -> str:
    """The graph as an HTML page: drag to pan, wheel to zoom, click a step for what is implied about it.

    The page loads nothing, and no script runs in it but its own.
    """
    digest = base64.b64encode(hashlib.sha256(_SCRIPT.encode()).digest()).decode()
    policy = f"default-src 'none'; style-src 'unsafe-inline'; script-src 'sha256-{digest}'"
    implied = sum(len(group.of(Order.IMPLIED)) for group in graph.groups())
    hidden = "" if implied else " hidden"
    what = f"all {implied} implied orderings" if implied != 1 else "the implied ordering"
    return f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="{policy}">
<title>{for_xml(graph.title)}</title>
<style>
{_STYLE}</style>
</head>
<body>
{svg_element(graph, implied=True)}\
<div id="bar"><label{hidden}><input type="checkbox" id="all"> {what}</label>\
<button type="button" id="fit">whole graph</button></div>
<script>{_SCRIPT}</script>
</body>
</html>
"""
