// The room from above at the current time: bodies, the robot and its path, its belief, candidates for base poses.

// Colour and mark of each reason for rejecting candidates, the same in cards, map and scene.
const reasons = new Map();
function findReasons() {
  for (const question of model.questions ?? []) for (const { text, colour: shade } of [...question.bases.reasons, ...question.hands.reasons]) {
    if (!reasons.has(text)) reasons.set(text, { colour: shade, shape: text ? MARKERS[1 + (reasons.size % (MARKERS.length - 1))] : MARKERS[0] });
  }
}
const MARKERS = ["circle", "square", "triangle", "diamond", "cross", "plus"];
function marker(shape, x, y, r, attributes) {
  const points = {
    square: [[-1, -1], [1, -1], [1, 1], [-1, 1]], triangle: [[0, -1.2], [1.1, 0.9], [-1.1, 0.9]],
    diamond: [[0, -1.3], [1.3, 0], [0, 1.3], [-1.3, 0]],
  }[shape];
  if (points) return svg("polygon", { points: points.map(([a, b]) => `${x + a * r},${y + b * r}`).join(" "), ...attributes });
  if (shape === "circle") return svg("circle", { cx: x, cy: y, r, ...attributes });
  const d = shape === "cross" ? `M${x - r},${y - r}L${x + r},${y + r}M${x + r},${y - r}L${x - r},${y + r}` : `M${x - r},${y}H${x + r}M${x},${y - r}V${y + r}`;
  return svg("path", { d, stroke: attributes.fill, "stroke-width": 1.8, fill: "none" });
}

function markOf(text, x, y, r) {
  const { shape, colour: shade } = reasons.get(text);
  return marker(shape, x, y, r, { fill: shade });
}
const reasonKey = (text) => svg("svg", { class: "reason", width: 14, height: 14, "aria-hidden": "true" }, markOf(text, 7, 7, 4));
findReasons();

const floorPlan = {
  box: byId("map"), parts: new Map(), zoom: 1, middle: null,
  build() {
    this.view = svg("svg", { class: "map-view", role: "img", tabindex: "0", "aria-label": "The room from above" });
    this.legend = el("div", { class: "map-legend", tabindex: "0", role: "region", "aria-label": "Candidates for base poses" });
    this.box.append(this.view, this.legend);
    new ResizeObserver(() => this.draw()).observe(this.view);
    this.view.addEventListener("wheel", (event) => { if (mayZoom(event, this.view)) { event.preventDefault(); this.closer(event); } }, { passive: false });
    this.view.addEventListener("pointermove", (event) => { if (event.buttons & 1) this.shift(-event.movementX, event.movementY); });
    this.view.addEventListener("dblclick", () => { Object.assign(this, { zoom: 1, middle: null }); this.draw(); });
    this.question = undefined;
    this.ready = true;
    this.draw();
  },
  // Scales the room to the view; texts and marks keep their size.
  draw() {
    const { bounds: [x0, y0, x1, y1], outlines } = model.map, border = 14;
    const wide = this.view.clientWidth, high = this.view.clientHeight;
    if (!wide || !high) return;
    const s = this.zoom * Math.max(5, Math.min((wide - 2 * border) / (x1 - x0), (high - 2 * border) / (y1 - y0)));
    const [middle, centre] = this.middle ?? [(x0 + x1) / 2, (y0 + y1) / 2];
    const left = wide / 2 - s * (middle - x0), top = high / 2 - s * (y1 - centre);
    this.scale = s;
    this.at = (x, y) => [left + (x - x0) * s, top + (y1 - y) * s];
    this.view.replaceChildren();
    this.question = undefined;
    this.view.append(svg("rect", { class: "floor", x: left, y: top, width: (x1 - x0) * s, height: (y1 - y0) * s }));
    for (let x = Math.ceil(x0); x <= x1; x++) this.view.append(this.line(x, y0, x, y1));
    for (let y = Math.ceil(y0); y <= y1; y++) this.view.append(this.line(x0, y, x1, y));
    for (const one of outlines) {
      const shape = svg("polygon", { class: `body ${one.kind}` }), hover = svg("title");
      hover.textContent = one.name;
      shape.append(hover);
      this.parts.set(one.name, { ...one, shape });
      this.view.append(shape);
    }
    this.ghosts = svg("g");
    this.way = svg("polyline", { class: "path" });
    this.chosen = svg("g");
    this.robot = svg("g");
    this.names = svg("g");
    this.places = svg("g", { class: "places" });
    this.tips = svg("g");  // above names, because grasp candidates are at the thing that is named
    this.view.append(this.places, this.way, this.ghosts, this.chosen, this.robot, this.names, this.tips);
    this.move(clock.time);
  },
  closer(event) {
    const box = this.view.getBoundingClientRect(), away = [event.clientX - box.left - box.width / 2, box.height / 2 - event.clientY + box.top];
    const zoom = Math.max(1, Math.min(20, this.zoom * (event.deltaY > 0 ? 1 / 1.2 : 1.2))), share = 1 - this.zoom / zoom;
    this.zoom = zoom;
    this.shift(away[0] * share, away[1] * share);
    if (zoom === 1) { this.middle = null; this.draw(); }
  },
  shift(right, up) {
    const { bounds: [x0, y0, x1, y1] } = model.map, [x, y] = this.middle ?? [(x0 + x1) / 2, (y0 + y1) / 2];
    this.middle = [x + right / this.scale, y + up / this.scale];
    this.draw();
  },
  line(x, y, to, up) {
    const [x1, y1] = this.at(x, y), [x2, y2] = this.at(to, up);
    return svg("line", { class: "grid", x1, y1, x2, y2 });
  },
  corners(part, pose) {
    const yaw = yawOf(pose), c = Math.cos(yaw), s = Math.sin(yaw);
    return part.polygon.map(([x, y]) => this.at(pose[0] + c * x - s * y, pose[1] + s * x + c * y).map((n) => n.toFixed(1)).join()).join(" ");
  },
  poseOf(part, time) {
    const entity = world.byName.get(part.name);
    return entity ? poseAt(entity, time) : part.pose;
  },
  move(time) {
    if (!this.ready || !this.at) return;
    const labels = [], about = aboutAt(time);
    for (const part of this.parts.values()) {
      const pose = this.poseOf(part, time);
      part.shape.classList.toggle("about", about.has(part.name));
      part.shape.setAttribute("points", pose ? this.corners(part, pose) : "");
      if (pose) labels.push([part.name, ...this.at(pose[0], pose[1])]);
    }
    const ghosts = [];
    for (const belief of byId("ghosts").checked ? world.entities.filter((one) => one.kind === "belief") : []) {
      const pose = ghostAt(belief, time), part = this.parts.get(belief.name);
      if (pose && part) {
        const hover = svg("title");
        hover.textContent = `believed: ${belief.name}`;
        ghosts.push(svg("polygon", { class: "ghost", points: this.corners(part, pose) }, hover));
      }
      const doubt = doubtAt(belief, time), about = doubt && poseAt(belief, time);
      if (about) {
        const [cx, cy] = this.at(about[0], about[1]), r = 2 * doubt * this.scale, hover = svg("title");
        hover.textContent = `${belief.name} is within ${(2000 * doubt).toFixed(0)} mm, by what was seen of it`;
        ghosts.push(svg("ellipse", { class: "doubt", cx, cy, rx: r, ry: r }, hover));
      }
    }
    this.ghosts.replaceChildren(...ghosts);
    this.base(time);
    this.name(labels);
    this.show(byId("candidates").checked ? questionAt(time) : null);
    this.box.dataset.time = time.toFixed(2);
  },
  base(time) {
    const base = world.entities.find((one) => one.kind === "link" && one.frame < 0);
    const pose = base ? poseAt(base, time) : model.map.start;
    if (!pose) return;
    const [x, y] = this.at(pose[0], pose[1]), yaw = base ? yawOf(pose) : pose[2], r = model.map.radius * this.scale;
    this.robot.replaceChildren(svg("circle", { class: "robot", cx: x, cy: y, r }),
      svg("line", { class: "heading", x1: x, y1: y, x2: x + r * Math.cos(yaw), y2: y - r * Math.sin(yaw) }));
    const way = [];
    if (base) {
      for (let k = 0; k < base.times.length && base.times[k] <= time; k++) way.push(this.at(base.poses[k * 7], base.poses[k * 7 + 1]));
      way.push([x, y]);
    }
    this.way.setAttribute("points", way.map(([a, b]) => `${a.toFixed(1)},${b.toFixed(1)}`).join(" "));
  },
  // Names of bodies, without overlaps.
  name(labels) {
    const taken = [], made = [];
    for (const [name, x, y] of labels) {
      const half = name.length * 3.3 + 2;
      let up = y;
      for (const offset of [0, 14, -14, 28, -28, 42]) {
        up = y + offset;
        if (!taken.some(([a, b, w]) => Math.abs(a - x) < w + half && Math.abs(b - up) < 13)) break;
      }
      taken.push([x, up, half]);
      const text = svg("text", { x, y: up + 4, "text-anchor": "middle" });
      text.textContent = name;
      made.push(text);
    }
    this.names.replaceChildren(...made);
  },
  show(question) {
    if (question === this.question) return;
    this.question = question;
    const bases = [], tips = [], chosen = [];
    for (const [cloud, size, points] of question ? [[question.bases, 2.6, bases], [question.hands, 4, tips]] : []) {
      for (const [number, x, y] of cloud.points) {
        const [a, b] = this.at(x, y);
        const { text } = cloud.reasons[number];  // accepted ones are smaller, so that others at the same pose stay visible
        points.push(markOf(text, a, b, text ? size : size * 0.6));
      }
    }
    if (question?.chosen) {
      const [x, y] = this.at(question.chosen[0], question.chosen[1]), yaw = question.chosen[2], r = model.map.radius * this.scale;
      chosen.push(svg("circle", { class: "chosen", cx: x, cy: y, r }),
        svg("line", { class: "chosen", x1: x, y1: y, x2: x + r * Math.cos(yaw), y2: y - r * Math.sin(yaw) }));
    }
    this.places.replaceChildren(...bases);
    this.tips.replaceChildren(...tips);
    this.chosen.replaceChildren(...chosen);
    this.explain(question);
  },
  explain(question) {
    this.legend.hidden = !question;
    if (!question) return;
    const number = model.questions.indexOf(question);
    const other = (step) => model.questions[number + step];
    const go = (step, text, called) => el("button", { type: "button", "aria-label": called, disabled: !other(step),
      onclick: () => clock.goTo(other(step).time, other(step).node) }, text);
    const isDrawn = (cloud, k) => cloud.points.some(([number]) => number === k);
    const kinds = (cloud, none) => cloud.reasons.map((reason, k) => el("li", {}, reasonKey(reason.text),
      `${reason.text || none}: ${reason.count}${isDrawn(cloud, k) ? "" : ", before poses were sampled"}`));
    this.legend.replaceChildren(
      el("h2", {}, go(-1, "‹", "Previous search"), go(1, "›", "Next search"),
        `Where to stand, search ${number + 1} of ${model.questions.length}`, moment(question.time, question.node)),
      el("p", { class: "said" }, question.location),
      el("ul", {}, ...(question.chosen ? [el("li", {}, `○ chosen: x ${question.chosen[0].toFixed(2)}, y ${question.chosen[1].toFixed(2)}`)] : [el("li", {}, "no place was found")]),
        ...kinds(question.bases, "accepted")),
      ...(question.hands.reasons.length ? [el("h3", {}, "Grasp candidates (large marks)"), el("ul", {}, ...kinds(question.hands, "free"))] : []),
      question.blocking.length ? el("p", { class: "said" }, `In the way: ${question.blocking.map(([name, count]) => `${name} ${count}`).join(", ")}`) : "");
  },
};
clock.onTime((time) => { if (!floorPlan.box.hidden) floorPlan.move(time); });
for (const id of ["ghosts", "candidates"]) {
  byId(id).addEventListener("change", () => { scene.move(clock.time); floorPlan.move(clock.time); });
}
