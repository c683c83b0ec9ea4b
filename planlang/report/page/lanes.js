// Lanes over time: nested steps, resources, and events, on one canvas.

const lanes = {
  box: byId("lanes"), canvas: el("canvas", { role: "img", "aria-label": "Lanes over time; the plan tree has the same steps" }),
  left: 116, height: 17, from: 0, to: clock.end, rows: [], hits: [],
  build() {
    this.rows = [];
    const depths = [];
    const add = (depth, span) => { (depths[depth] ??= []).push(span); };
    const depthOf = new Map();
    for (const node of nodes.values()) {
      let above = node.above;
      while (above?.minor) above = above.above;
      const depth = node.minor ? -1 : above ? (depthOf.get(above.id) ?? -1) + 1 : 0;
      depthOf.set(node.id, depth < 0 ? depthOf.get(above?.id) ?? -1 : depth);
      if (depth >= 0 && node.start !== null) add(Math.min(depth, 11), { from: node.start, to: node.end, node, text: node.name, status: node.status });
    }
    depths.forEach((spans, depth) => this.rows.push({ name: depth === 0 ? "steps" : "", spans, isStep: true }));
    const kinds = [["failures", ["failure"]], ["attempts", ["attempt", "recovery"]], ["belief", ["belief"]]];
    for (const [name, wanted] of kinds) {
      const marks = model.marks.filter((mark) => wanted.includes(mark[2]));
      if (marks.length) this.rows.push({ name, marks: marks.map(([time, id, kind, text]) => ({ time, id, kind, text })) });
    }
    for (const lane of model.lanes) {
      const deepest = Math.max(0, ...lane.spans.map((span) => span[3]));
      this.rows.push({ name: lane.name, deepest, spans: lane.spans.map(([from, to, id, depth]) => {
        const node = nodes.get(id);
        return { from, to, node, depth, text: node?.name ?? "", status: node?.status ?? "running" };
      }) });
    }
    for (const row of this.rows) row.spans?.sort((a, b) => a.from - b.from);
    this.resize();
  },
  resize() {
    if (this.wide === this.box.clientWidth && this.high === this.rows.length * this.height + 22) return;
    const wide = Math.max(200, this.box.clientWidth), high = this.rows.length * this.height + 22;
    const ratio = devicePixelRatio || 1;
    this.wide = wide;
    this.high = high;
    this.canvas.width = wide * ratio;
    this.canvas.height = high * ratio;
    this.canvas.style.width = `${wide}px`;
    this.canvas.style.height = `${high}px`;
    this.pen = this.canvas.getContext("2d");
    this.pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    this.paint();
  },
  x(time) { return this.left + ((time - this.from) / (this.to - this.from)) * (this.wide - this.left - 8); },
  time(x) { return this.from + ((x - this.left) / (this.wide - this.left - 8)) * (this.to - this.from); },
  paint() {
    if (!this.pen) return;
    const { pen, wide, high } = this, ink = {};
    for (const name of ["paper", "raised", "line", "ink", "faint", "done", "failed", "running", "ended", "waiting", "ghost", "accent",
      "done-soft", "failed-soft", "running-soft", "ended-soft"]) ink[name] = colour(name);
    this.hits = [];
    pen.fillStyle = ink.paper;
    pen.fillRect(0, 0, wide, high);
    this.axis(ink);
    pen.font = "12px system-ui, sans-serif";
    pen.textBaseline = "middle";
    this.rows.forEach((row, k) => {
      const y = 20 + k * this.height;
      if (row.name) {
        pen.fillStyle = ink.line;
        pen.fillRect(0, y - 0.5, wide, 0.6);
        pen.fillStyle = ink.faint;
        pen.fillText(row.name, 8, y + this.height / 2, this.left - 14);
      }
      if (row.spans) this.spans(row, y, ink); else this.marks(row, y, ink);
    });
    const x = this.x(clock.time);
    if (x >= this.left - 1) {
      pen.fillStyle = ink.accent;
      pen.fillRect(x - 0.75, 0, 1.5, high);
      pen.beginPath();
      pen.moveTo(x - 5, 0); pen.lineTo(x + 5, 0); pen.lineTo(x, 7);
      pen.fill();
    }
    this.canvas.dataset.time = clock.time.toFixed(2);
  },
  axis(ink) {
    const { pen } = this, span = this.to - this.from;
    const step = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 30, 60, 120, 300, 600, 1800, 3600, 7200].find((one) => span / one <= 12) ?? span / 8;
    pen.font = "11px system-ui, sans-serif";
    pen.textBaseline = "top";
    for (let time = Math.ceil(this.from / step) * step; time <= this.to + 1e-9; time += step) {
      const x = this.x(time);
      pen.fillStyle = ink.line;
      pen.fillRect(x, 16, 0.7, this.high);
      pen.fillStyle = ink.faint;
      const text = `${Number(time.toFixed(1))} s`, width = pen.measureText(text).width;
      pen.fillText(text, Math.min(x - width / 2, this.wide - width - 2), 3);
    }
  },
  spans(row, y, ink) {
    const { pen } = this, deep = (row.deepest ?? 0) + 1, each = (this.height - 3) / deep;
    const tint = { succeeded: "done", failed: "failed", running: "running", evaporated: "ended" };
    let past = -1;
    for (const span of row.spans) {
      const to = span.to ?? clock.end;
      if (to < this.from || span.from > this.to) continue;
      const left = Math.max(this.left, this.x(span.from)), right = Math.max(left + 1.5, Math.min(this.wide - 4, this.x(to)));
      if (right <= past && deep === 1) continue;
      past = right - 0.5;
      const top = y + 1 + (span.depth ?? 0) * each, name = tint[span.status] ?? "waiting";
      const now = row.isStep && to > clock.time ? statusAt(span.node, clock.time) : "running";
      const state = span.from > clock.time ? "waiting" : to > clock.time ? (now === "queued" ? "ended" : "running") : name;
      const base = state === "waiting" ? "raised" : `${state}-soft`;
      pen.fillStyle = ink[base] ?? ink.raised;
      pen.fillRect(left, top, right - left, each - 1);
      pen.strokeStyle = ink[state];
      pen.lineWidth = span.node?.id === clock.node ? 2 : 0.8;
      pen.strokeRect(left + 0.4, top + 0.4, Math.max(1, right - left - 0.8), each - 1.8);
      this.hits.push([left, right, top, top + each, span]);
      if (right - left > 34 && each > 11) {
        pen.save();
        pen.beginPath();
        pen.rect(left + 3, top, right - left - 6, each);
        pen.clip();
        pen.fillStyle = state === "waiting" ? ink.faint : ink.ink;
        pen.font = "11px system-ui, sans-serif";
        pen.textBaseline = "middle";
        pen.fillText(span.text, left + 4, top + each / 2);
        pen.restore();
        pen.font = "12px system-ui, sans-serif";
      }
    }
  },
  marks(row, y, ink) {
    const { pen } = this, middle = y + this.height / 2;
    const tint = { failure: "failed", attempt: "accent", recovery: "ended", belief: "ghost" };
    let past = -9;
    for (const mark of row.marks) {
      if (mark.time < this.from || mark.time > this.to) continue;
      const x = this.x(mark.time);
      this.hits.push([x - 5, x + 5, y, y + this.height, mark]);
      if (x - past < 1) continue;
      past = x;
      pen.fillStyle = ink[tint[mark.kind]];
      pen.globalAlpha = mark.time > clock.time ? 0.45 : 1;
      pen.beginPath();
      if (mark.kind === "failure") {
        pen.lineWidth = 2.2; pen.strokeStyle = pen.fillStyle;
        pen.moveTo(x - 4, middle - 4); pen.lineTo(x + 4, middle + 4);
        pen.moveTo(x + 4, middle - 4); pen.lineTo(x - 4, middle + 4);
        pen.stroke();
      } else if (mark.kind === "belief") { pen.arc(x, middle, 3.6, 0, 7); pen.fill(); }
      else { pen.moveTo(x, middle - 5); pen.lineTo(x + 5, middle); pen.lineTo(x, middle + 5); pen.lineTo(x - 5, middle); pen.fill(); }
      pen.globalAlpha = 1;
    }
  },
  hit(x, y) { return this.hits.findLast((one) => x >= one[0] && x <= one[1] && y >= one[2] && y < one[3])?.[4]; },
  zoom(factor, around = clock.time) {
    const span = Math.max(0.2, Math.min(clock.end, (this.to - this.from) * factor));
    const share = (around - this.from) / (this.to - this.from);
    this.from = Math.max(0, Math.min(clock.end - span, around - share * span));
    this.to = this.from + span;
    this.paint();
  },
  // Keeps the current time in view when the lanes are zoomed in.
  keep() {
    const span = this.to - this.from;
    if (span < clock.end && (clock.time < this.from || clock.time > this.to)) {
      this.from = Math.max(0, Math.min(clock.end - span, clock.time - span * 0.1));
      this.to = this.from + span;
    }
  },
};
lanes.box.append(lanes.canvas);
new ResizeObserver(() => lanes.resize()).observe(lanes.box);
clock.onTime(() => { lanes.keep(); lanes.paint(); });
clock.onSelect(() => lanes.paint());
const atPointer = (event) => { const box = lanes.canvas.getBoundingClientRect(); return [event.clientX - box.left, event.clientY - box.top]; };
lanes.canvas.addEventListener("pointerdown", (event) => {
  const [x, y] = atPointer(event), found = lanes.hit(x, y);
  clock.pause();
  if (x < lanes.left) return;
  clock.seek(lanes.time(x));
  if (found?.node) clock.select(found.node.id, { keep: true });
  else if (found?.id) clock.goTo(found.time, found.id);
  lanes.canvas.setPointerCapture(event.pointerId);
});
lanes.canvas.addEventListener("pointermove", (event) => {
  const [x, y] = atPointer(event);
  if (event.buttons & 1 && lanes.canvas.hasPointerCapture(event.pointerId)) { clock.seek(lanes.time(x)); return; }
  const found = lanes.hit(x, y);
  const text = found && (found.node ? `${found.text}${found.node.label ? `: ${found.node.label}` : ""}, ${CALLED[found.status] ?? found.status}, ${seconds(found.from)} to ${found.to === null ? "the end" : seconds(found.to)}` : `${seconds(found.time)} ${found.text}`);
  showTip(text, event.clientX, event.clientY);
});
lanes.canvas.addEventListener("pointerleave", () => showTip(""));
lanes.canvas.addEventListener("wheel", (event) => {
  if (!event.ctrlKey && !event.metaKey) return;
  event.preventDefault();
  lanes.zoom(event.deltaY > 0 ? 1.25 : 0.8, lanes.time(atPointer(event)[0]));
}, { passive: false });
byId("closer").addEventListener("click", () => lanes.zoom(0.6));
byId("wider").addEventListener("click", () => lanes.zoom(1 / 0.6));
