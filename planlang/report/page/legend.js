// Names in the scene, and a legend of the colours and marks that are visible at the moment.

const legend = {
  pinned: new Set(), named: new Set(), tags: el("div", { class: "tags", "aria-hidden": "true" }), list: el("ul"),
  build() {
    this.box = el("details", { class: "legend" }, el("summary", {}, "what marks mean"), this.list);
    scene.box.append(this.tags, this.box);
  },
  explain(ghosts, question, frames) {
    const swatch = (name) => el("span", { class: `swatch ${name}`, "aria-hidden": "true" });
    const items = [
      ...(question?.bases.reasons ?? []).filter((_, k) => question.bases.points.some(([number]) => number === k))
        .map(({ text }) => el("li", {}, reasonKey(text), text ? `place to stand, rejected: ${text}` : "place to stand, accepted")),
      question?.chosen && el("li", {}, swatch("ring"), "place to stand, chosen"),
      ghosts > 0 && el("li", {}, swatch("ghost"), "believed to be there, but is not"),
      frames > 0 && el("li", {}, swatch("frame"), "involved in the failure or the search"),
    ].filter(Boolean);
    this.box.hidden = items.length === 0;
    this.list.replaceChildren(...items);
  },
  // Display name of an entity: the person of a limb, the robot of a link.
  nameOf(entity) {
    if (entity.kind === "limb") return entity.name.split("/")[0];
    if (entity.kind === "link") return model.facts.robot ?? "robot";
    return entity.name;
  },
  pin(name) {
    if (!this.pinned.delete(name)) this.pinned.add(name);
    scene.ask();
  },
  // Puts names above the robot, persons, things of interest, and clicked things, without overlaps.
  place() {
    const { three, canvas, camera } = scene, wanted = new Map(), robot = model.facts.robot ?? "robot";
    if (byId("names").checked) {
      for (const { name, kind } of model.map?.outlines ?? []) if (kind === "person") wanted.set(name, name);
      for (const name of this.named) wanted.set(name, name);
      wanted.set(robot, "");
    }
    for (const name of this.pinned) wanted.set(name, name === robot ? "" : name);
    const taken = [], made = [];
    for (const [text, name] of wanted) {
      const box = aim.box(name);
      if (!box) continue;
      const middle = box.getCenter(new three.Vector3()).setZ(box.max.z + 0.05).project(camera);
      if (Math.abs(middle.x) > 1 || Math.abs(middle.y) > 1 || middle.z > 1) continue;
      const x = ((middle.x + 1) / 2) * canvas.clientWidth, half = text.length * 3.6 + 6;
      let y = ((1 - middle.y) / 2) * canvas.clientHeight;
      while (taken.some(([a, b, w]) => Math.abs(a - x) < w + half && Math.abs(b - y) < 17)) y -= 6;
      taken.push([x, y, half]);
      const tag = el("span", {}, text);
      tag.style.left = `${x.toFixed(0)}px`;
      tag.style.top = `${Math.max(9, y).toFixed(0)}px`;
      made.push(tag);
    }
    this.tags.replaceChildren(...made);
  },
};
byId("names").addEventListener("change", () => { legend.pinned.clear(); scene.ask(); });
