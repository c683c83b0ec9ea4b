// The model of the run with its index, and helpers for all views. Texts enter the page only through textContent.

const byId = (id) => document.getElementById(id);

function el(name, attributes = {}, ...inside) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (key === "class") made.className = value;
    else if (key.startsWith("on")) made.addEventListener(key.slice(2), value);
    else if (value === true) made.setAttribute(key, "");
    else if (value !== false && value !== undefined && value !== null) made.setAttribute(key, value);
  }
  made.append(...inside.filter((one) => one !== null && one !== undefined && one !== false));
  return made;
}

function svg(name, attributes = {}, ...inside) {
  const made = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) {
    if (value !== undefined && value !== null) made.setAttribute(key, value);
  }
  made.append(...inside.filter(Boolean));
  return made;
}

const model = JSON.parse(byId("model").textContent);
const nodes = new Map();
const roots = [];

// Adds nodes to the index, or updates them, because a run may still be growing.
function index(list) {
  for (const one of list) {
    const known = nodes.get(one.id);
    const node = Object.assign(known ?? { children: [] }, one);
    if (known) continue;
    nodes.set(node.id, node);
    const parent = node.parent === null ? undefined : nodes.get(node.parent);
    node.above = parent;
    node.depth = parent ? parent.depth + 1 : 0;
    (parent ? parent.children : roots).push(node);
  }
}
index(model.nodes);

const never = "never";
function statusAt(node, time) {
  if (node.start === null) return node.end !== null && time >= node.end ? never : "waiting";
  if (time < node.start) return "waiting";
  if (node.end === null || time < node.end) return waitAt(node, time) ? "queued" : "running";
  return node.status;
}
// The wait for resources that a running step is in at a moment: its own, or that of all its running children.
function waitAt(node, time) {
  if (node.wait) return node.wait[0] === null || time < node.wait[0] ? node.wait : undefined;
  let wait;
  for (const child of node.children) {
    if (child.start === null || time < child.start || (child.end !== null && time >= child.end)) continue;
    wait = waitAt(child, time);
    if (!wait) return undefined;
  }
  return wait;
}
const MARKS = { succeeded: "✓", failed: "✕", running: "▸", evaporated: "⊘", waiting: "·", never: "⊘", queued: "‖" };
const CALLED = {
  succeeded: "succeeded", failed: "failed", running: "running", evaporated: "evaporated", waiting: "not started",
  never: "evaporated before it began", interrupted: "interrupted", queued: "waiting for a resource",
};

const seconds = (time) => `${time.toFixed(2)} s`;
function spanOf(node) {
  if (node.start === null) return "";
  return node.end === null ? `from ${seconds(node.start)}` : `${(node.end - node.start).toFixed(1)} s`;
}
const titleOf = (node) => node.label ?? "";
const failureOf = (node) => (node.failure === undefined ? undefined : model.failures[node.failure]);

// Headline of a node's failure; that of its card if there is one, so that card and panel agree.
function headlineOf(node) {
  const card = model.cards.find((one) => one.node === node.id);
  return (card ? model.failures[card.failure] : failureOf(node)).headline;
}

// Text in which paths may break, but only after slashes.
const broken = (text) => text.split(/(?<=\/)/).flatMap((part) => [part, document.createElement("wbr")]);

// Most interesting moment of a node: its failure, else its start.
const momentOf = (node) => (node.status === "failed" ? node.end : node.start) ?? node.end ?? 0;

// Fades the lower edge of a scrolling box while there is more below; calls "more" with that state.
function fading(box, more = () => {}) {
  const look = () => {
    const is = box.scrollHeight - box.scrollTop - box.clientHeight > 3;
    box.classList.toggle("fading", is);
    more(is);
  };
  box.addEventListener("scroll", look, { passive: true });
  new ResizeObserver(look).observe(box);
  new MutationObserver(look).observe(box, { childList: true, subtree: true, attributeFilter: ["open"] });
}

// Colour of the page's style, for drawing on a canvas.
const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

// Flashes an element to draw attention to it.
function flash(element) {
  element.classList.remove("flash");
  void element.offsetWidth;  // forces a layout, which restarts the animation
  element.classList.add("flash");
}

const tip = byId("tip");
function showTip(text, x, y) {
  tip.hidden = !text;
  if (!text) return;
  tip.textContent = text;
  const box = tip.getBoundingClientRect();
  tip.style.left = `${Math.max(4, Math.min(x + 12, innerWidth - box.width - 8))}px`;
  tip.style.top = `${y + 18 + box.height > innerHeight ? y - box.height - 8 : y + 14}px`;
}
