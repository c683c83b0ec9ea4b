// Builds the page: tabs, colours, notes on missing parts, print; and adds updates of a running plan.

class Tabs {
  constructor(ids, chosen) {
    this.tabs = ids.map((id) => byId(`tab-${id}`));
    this.ids = ids;
    this.chosen = chosen;
    this.tabs.forEach((tab, k) => {
      tab.addEventListener("click", () => this.choose(ids[k]));
      tab.addEventListener("keydown", (event) => {
        const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
        if (!step) return;
        event.preventDefault();
        event.stopPropagation();
        const open = this.ids.filter((id) => !byId(`tab-${id}`).disabled && !byId(`tab-${id}`).hidden);
        const next = open[(open.indexOf(ids[k]) + step + open.length) % open.length];
        this.choose(next);
        byId(`tab-${next}`).focus();
      });
    });
  }
  choose(id) {
    const tab = byId(`tab-${id}`);
    if (tab.disabled || tab.hidden) return;
    this.ids.forEach((one, k) => {
      byId(one).hidden = one !== id;
      this.tabs[k].setAttribute("aria-selected", String(one === id));
      this.tabs[k].tabIndex = one === id ? 0 : -1;
    });
    this.chosen(id);
  }
}

const worldTabs = new Tabs(["scene", "map", "graph"], (id) => {
  if (id === "scene" && scene.ready) { scene.resize(); scene.move(clock.time); }
  if (id === "map" && model.map) { if (floorPlan.ready) floorPlan.move(clock.time); else floorPlan.build(); }
  if (id === "graph" && model.graph) { if (graph.ready) graph.move(clock.time); else graph.build(); }
  for (const label of ["ghosts-label", "candidates-label"]) byId(label).hidden = id === "graph";
  for (const label of ["room", "aim-label", "names-label"]) byId(label).hidden = id !== "scene";
});
const planTabs = new Tabs(["tree-view", "story"], (id) => {
  if (id !== "story") return;
  if (!story.items.length) story.build();
  story.reveal();
});

function head() {
  document.title = `${model.title}: ${model.outcome.text}`;
  byId("title").textContent = model.title;
  byId("outcome").textContent = model.outcome.text;
  byId("outcome").className = `badge ${model.outcome.status}`;
  const facts = Object.entries(model.facts).filter(([key]) => key !== "why");  // a button of the failure has it
  byId("facts").replaceChildren(...facts.map(([key, value]) => el("div", { class: key === "command" ? key : false }, el("dt", {}, key), el("dd", {}, String(value)))));
}

function tellMissing(...more) {
  const notes = [...model.missing, ...more];
  byId("missing").hidden = notes.length === 0;
  byId("missing").replaceChildren(...notes.map((one) => el("p", {}, one)));
}

const paintTheme = followTheme(() => {
  scene.recolour();
  lanes.paint();
});

function print() {
  for (const whole of cards.querySelectorAll(":scope > details:not(#recovered)")) whole.open = true;
  byId("printed").replaceChildren(el("h2", {}, "What happened"), story.list());
  lanes.paint();
}
addEventListener("beforeprint", print);
addEventListener("afterprint", () => byId("printed").replaceChildren());

// Adds an update of a run: new and changed nodes, and other changed parts; all views show it at once.
function grow(more) {
  index(more.nodes ?? []);
  const { nodes: ignored, end = model.end, ...rest } = more;
  Object.assign(model, rest, { end });
  findReasons();
  clock.end = Math.max(end, 0.01);
  slider.max = clock.end;
  lanes.to = clock.end;
  findMoments();
  head();
  showCards();
  tree.build();
  lanes.build();
  story.items = [];
  if (!story.box.hidden) story.build();
  clock.seek(clock.time);
}

async function begin() {
  const started = performance.now();
  head();
  tellMissing();
  document.documentElement.classList.toggle("calm", model.cards.every((one) => one.recovered));
  showCards();
  tree.build();
  lanes.build();
  showDetails(null);
  planTabs.choose("tree-view");
  for (const [id, is] of [["scene", model.scene], ["map", model.map], ["graph", model.graph]]) byId(`tab-${id}`).hidden = !is;
  const first = ["scene", "map", "graph"].find((id) => !byId(`tab-${id}`).hidden);
  if (first) worldTabs.choose(first);
  else {
    document.querySelector(".stage").hidden = true;
    document.querySelector(".panels").classList.add("alone");
  }
  paintTheme();
  if (!clock.recall()) {
    const fatal = model.cards.find((one) => !one.recovered);
    clock.seek(fatal?.time ?? (model.outcome.status === "succeeded" ? 0 : clock.end), { quiet: true });
    if (fatal) clock.select(fatal.node, { keep: true });
  }
  document.documentElement.dataset.ready = "page";
  document.documentElement.dataset.took = (performance.now() - started).toFixed(0);
  if (model.scene) {
    try { readTracks(await unpacked("poses", "deflate")); } catch { tellMissing("This browser cannot read the poses, because it lacks DecompressionStream; use a newer one."); }
    try {
      if (world.ready) await scene.build();
    } catch (problem) {
      tellMissing(`The scene is not shown in three dimensions: ${problem.message || "WebGL is missing"}. The map shows the room from above, without heights.`);
      byId("tab-scene").disabled = true;
      if (!byId("scene").hidden) worldTabs.choose("map");
    }
    floorPlan.move(clock.time);
  }
  if (model.live) live.begin();
  document.documentElement.dataset.ready = "all";
  document.documentElement.dataset.scene = performance.now().toFixed(0);
}
globalThis.planlang = { model, clock, scene, grow };
begin();
