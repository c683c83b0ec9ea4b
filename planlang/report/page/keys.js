// The keyboard, and the list of its keys.

const KEYS = [
  ["space", "play or pause"], ["← →", "one second back or forward; with shift 0.1 s"], ["[  ]", "previous or next moment"],
  ["Home End", "start or end of the run"], ["/", "search"], ["f", "next failure"], ["1 2 3", "scene, map, recipe"],
  ["4 5", "plan, story"], ["+ −", "zoom time"], ["↑ ↓ ← →", "in the plan: move, open and close; Enter goes to the start of a step"],
  ["?", "these keys"],
];
byId("key-list").append(...KEYS.flatMap(([key, text]) => [el("dt", {}, key), el("dd", {}, text)]));
byId("help").addEventListener("click", () => byId("keys").showModal());

let lastFailure = -1;
function nextFailure() {
  if (!model.cards.length) return;
  lastFailure = (lastFailure + 1) % model.cards.length;
  const one = model.cards[lastFailure];
  clock.goTo(one.time ?? 0, one.node);
}

addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || byId("keys").open) return;
  const inside = event.target, step = event.shiftKey ? 0.1 : 1;
  if (inside.matches("input[type=search], select, textarea")) return;
  const actions = {
    " ": () => (clock.playing ? clock.pause() : clock.play()),
    ArrowLeft: () => { clock.pause(); clock.seek(clock.time - step); },
    ArrowRight: () => { clock.pause(); clock.seek(clock.time + step); },
    Home: () => clock.seek(0), End: () => clock.seek(clock.end),
    "[": () => stepMoment(-1), "]": () => stepMoment(1), "/": () => search.input.focus(), f: nextFailure,
    "+": () => lanes.zoom(0.6), "-": () => lanes.zoom(1 / 0.6), "?": () => byId("keys").showModal(),
    1: () => worldTabs.choose("scene"), 2: () => worldTabs.choose("map"), 3: () => worldTabs.choose("graph"),
    4: () => planTabs.choose("tree-view"), 5: () => planTabs.choose("story"),
  };
  if (event.key === " " && inside.matches("button, summary, a, input")) return;
  if (inside.matches("input") && /^(Arrow|Home|End)/.test(event.key)) return;
  const action = actions[event.key];
  if (!action) return;
  event.preventDefault();
  action();
});
