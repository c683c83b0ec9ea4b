// The plan tree: its rows show the state at the current time; arrow keys work as in any tree.

const tree = {
  box: byId("tree"), closed: new Set(), rows: [], place: new Map(),
  build() {
    this.all = byId("minor").checked;
    this.rows = [];
    const open = roots.toReversed().map((node) => [node, 0]);
    while (open.length) {
      const [node, depth] = open.pop();
      const isShown = this.all || !node.minor;
      const deeper = isShown ? depth + 1 : depth;
      if (isShown) this.rows.push({ node, depth, hasChildren: this.shownBelow(node) });
      if (!isShown || !this.closed.has(node.id)) {
        for (let k = node.children.length - 1; k >= 0; k--) open.push([node.children[k], deeper]);
      }
    }
    this.place = new Map(this.rows.map((row, place) => [row.node.id, place]));
    this.list.show(this.rows);
  },
  shownBelow(node) {
    if (this.all) return node.children.length > 0;
    const open = [...node.children];
    while (open.length) {
      const one = open.pop();
      if (!one.minor) return true;
      open.push(...one.children);
    }
    return false;
  },
  make({ node, depth, hasChildren }) {
    const status = statusAt(node, clock.time), isClosed = tree.closed.has(node.id);
    const fold = el("span", { class: "fold", "aria-hidden": "true" }, hasChildren ? (isClosed ? "▸" : "▾") : "");
    if (hasChildren) fold.addEventListener("click", (event) => { event.stopPropagation(); tree.fold(node, !isClosed); });
    const row = el("div", {
      class: `row-line is-${status}${node.id === clock.node ? " selected" : ""}${status === "running" ? " now" : ""}${node.id === tree.flashed ? " flash" : ""}`,
      role: "treeitem", id: `row-${node.id}`, "aria-level": depth + 1,
      "aria-expanded": hasChildren ? String(!isClosed) : undefined, "aria-selected": String(node.id === clock.node),
      "aria-label": `${node.name}, ${CALLED[status]}${node.label ? `, ${node.label}` : ""}`, "data-status": status,
      onclick: () => { clock.pause(); clock.select(node.id); },
      ondblclick: () => clock.goTo(node.start ?? 0, node.id),
    },
    fold, el("span", { class: "mark", "aria-hidden": "true" }, MARKS[status]),
    el("span", { class: "name" }, node.name), el("span", { class: "more" }, status === "queued" ? `waits for ${waitAt(node, clock.time)[1]}` : titleOf(node) || node.text),
    el("span", { class: "when" }, spanOf(node)));
    row.style.paddingLeft = `${6 + depth * 15}px`;
    return row;
  },
  // Flashes the row of a node to draw attention to it.
  flash(id) {
    planTabs.choose("tree-view");
    let shown = nodes.get(id);
    while (shown && !this.place.has(shown.id)) shown = shown.above;
    this.flashed = shown?.id;
    this.list.draw(true);
    setTimeout(() => { this.flashed = null; }, 1200);
  },
  fold(node, isClosed) {
    if (isClosed) this.closed.add(node.id); else this.closed.delete(node.id);
    this.build();
  },
  // Opens the ancestors of a node, and scrolls to its row, or to that of the nearest shown ancestor.
  reveal(node) {
    let changed = false;
    for (let above = node.above; above; above = above.above) changed = this.closed.delete(above.id) || changed;
    if (changed) this.build();
    let shown = node;
    while (shown && !this.place.has(shown.id)) shown = shown.above;
    if (shown) this.list.reveal(this.place.get(shown.id));
  },
  // Innermost shown step that is running: the last one that started.
  running() {
    let found = null;
    for (const { node } of this.rows) {
      if (!node.minor && statusAt(node, clock.time) === "running" && (!found || node.start >= found.start)) found = node;
    }
    return found;
  },
  keys(event) {
    const place = this.place.get(clock.node) ?? -1, row = this.rows[place];
    const to = (next) => {
      const found = this.rows[Math.max(0, Math.min(this.rows.length - 1, next))];
      if (found) { clock.pause(); clock.select(found.node.id); }
    };
    switch (event.key) {
      case "ArrowDown": to(place + 1); break;
      case "ArrowUp": to(place - 1); break;
      case "PageDown": to(place + 12); break;
      case "PageUp": to(place - 12); break;
      case "Home": to(0); break;
      case "End": to(this.rows.length - 1); break;
      case "ArrowRight":
        if (row?.hasChildren && this.closed.has(row.node.id)) this.fold(row.node, false); else to(place + 1);
        break;
      case "ArrowLeft":
        if (row?.hasChildren && !this.closed.has(row.node.id)) this.fold(row.node, true);
        else {
          let above = row?.node.above;
          while (above && !this.place.has(above.id)) above = above.above;
          if (above) clock.select(above.id);
        }
        break;
      case "Enter": if (row) clock.goTo(row.node.start ?? 0, row.node.id); break;
      default: return;
    }
    event.preventDefault();
    event.stopPropagation();
  },
};
tree.list = new VirtualList(tree.box, 26, tree.make);
tree.box.addEventListener("keydown", (event) => tree.keys(event));
byId("minor").addEventListener("change", () => { tree.build(); const node = nodes.get(clock.node); if (node) tree.reveal(node); });
clock.onTime(() => {
  if (byId("follow").checked && !tree.box.matches(":hover")) {
    const running = tree.running();
    if (running) tree.list.reveal(tree.place.get(running.id));
  }
  tree.list.draw(true);
});
clock.onSelect((node) => {
  if (node) { tree.reveal(node); tree.box.setAttribute("aria-activedescendant", `row-${node.id}`); }
  tree.list.draw(true);
});
