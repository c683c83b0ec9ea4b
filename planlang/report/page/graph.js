// The recipe's graph: each step shows the state of its latest run at the current time, and the number of its runs.

const graph = {
  box: byId("graph"), boxes: [],
  build() {
    const { size: [wide, high], boxes, frames, arrows } = model.graph, border = 8;
    const view = svg("svg", { class: "graph-view", width: wide + 2 * border, height: high + 2 * border, role: "group",
      "aria-label": `Steps of ${model.graph.title}`, viewBox: `${-border} ${-border} ${wide + 2 * border} ${high + 2 * border}` });
    view.append(svg("defs", {}, svg("marker", { id: "head", viewBox: "0 0 10 10", refX: 9, refY: 5, markerWidth: 8, markerHeight: 8,
      markerUnits: "userSpaceOnUse", orient: "auto" }, svg("path", { class: "head", d: "M 0 1 L 10 5 L 0 9 z" }))));
    this.boxes = boxes.map((one) => {
      const [x, y] = one.corner, hover = svg("title"), tally = svg("text", { class: "tally", "text-anchor": "end", x: x + one.size[0] - 8, y: y + 18 });
      hover.textContent = one.hover.join("\n");
      const group = svg("g", { class: "box" }, hover, svg("rect", { x, y, width: one.size[0], height: one.size[1], rx: 6 }));
      one.lines.forEach((line, k) => {
        const text = svg("text", { class: k ? "line" : "name", x: x + 10, y: y + 20 + 16 * k });
        text.textContent = line;
        group.append(text);
      });
      group.append(tally);
      const runs = [...nodes.values()].filter((node) => node.class === one.name && node.kind === "perform");
      group.addEventListener("click", () => { const run = this.last(runs) ?? runs[0]; if (run) { clock.pause(); clock.select(run.id); } });
      view.append(group);
      return { ...one, group, runs, tally };
    });
    for (const one of frames) view.append(svg("rect", { class: "frame", x: one.corner[0], y: one.corner[1], width: one.size[0], height: one.size[1], rx: 6 }));
    for (const one of arrows) {
      const hover = svg("title");
      hover.textContent = one.hover;
      view.append(svg("path", { class: `arrow ${one.order}`, d: one.path, "marker-end": "url(#head)" }, hover));
      if (one.label) {
        const text = svg("text", { x: one.at[0], y: one.at[1], "text-anchor": "middle" });
        text.textContent = one.label;
        view.append(text);
      }
    }
    this.box.replaceChildren(view);
    this.ready = true;
    this.move(clock.time);
  },
  last(runs, time = clock.time) { return runs.findLast((node) => node.start !== null && node.start <= time); },
  move(time) {
    if (!this.ready) return;
    for (const one of this.boxes) {
      const run = this.last(one.runs, time), status = run ? statusAt(run, time) : "waiting";
      const begun = one.runs.filter((node) => node.start !== null && node.start <= time).length;
      one.group.setAttribute("class", `box is-${status}${one.abstract ? " abstract" : ""}${one.inner ? " inner" : ""}`);
      one.group.dataset.status = status;
      one.tally.textContent = run ? `${MARKS[status]}${begun > 1 ? ` ${begun}×` : ""}` : "";
    }
  },
};
clock.onTime((time) => { if (!graph.box.hidden) graph.move(time); });
