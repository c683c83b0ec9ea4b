// The search box finds things by name, steps by name, label or text, and sentences of the story; each hit once.

const search = {
  input: byId("search"), box: byId("found"), found: [], at: -1,
  look(words) {
    const wanted = words.toLowerCase().split(/\s+/).filter(Boolean), most = 60;
    const fits = (text) => { const low = text.toLowerCase(); return wanted.every((word) => low.includes(word)); };
    const found = (model.map?.outlines ?? []).filter((one) => fits(one.name)).slice(0, most)
      .map(({ name }) => ({ what: `${name}, a thing`, thing: name })), known = new Set();
    for (const node of nodes.values()) {
      if (found.length >= most) break;
      if (node.minor) continue;
      const failure = failureOf(node);
      if (fits(`${node.name} ${node.label ?? ""} ${node.text} ${node.kind} ${node.status} ${failure?.headline ?? ""}`)) {
        known.add(node.id);
        found.push({ what: `${node.name}${node.label ? `, ${node.label}` : ""}`, time: momentOf(node), id: node.id, status: node.status });
      }
    }
    for (const [time, id, text] of model.story) {
      if (found.length >= most) break;
      if (fits(text) && !known.has(id)) found.push({ what: text, time, id });
    }
    return found;
  },
  show(words) {
    this.found = words.trim() ? this.look(words) : [];
    this.at = this.found.length ? 0 : -1;
    this.box.hidden = !words.trim();
    this.input.setAttribute("aria-expanded", String(!this.box.hidden));
    this.box.replaceChildren(...(this.found.length ? this.found.map((one, k) => el("li", {
      role: "option", id: `found-${k}`, "aria-selected": String(k === this.at), onmousedown: (event) => { event.preventDefault(); this.go(k); },
    }, el("span", { class: "what" }, one.what), el("span", { class: "when" }, one.thing ? "" : seconds(one.time))))
      : [el("li", { role: "option", "aria-selected": "false", "aria-disabled": "true" }, "no match")]));
    this.point();
  },
  point() {
    [...this.box.children].forEach((item, k) => item.setAttribute("aria-selected", String(k === this.at)));
    if (this.at >= 0) {
      this.input.setAttribute("aria-activedescendant", `found-${this.at}`);
      this.box.children[this.at].scrollIntoView({ block: "nearest" });
    } else this.input.removeAttribute("aria-activedescendant");
  },
  go(k) {
    const one = this.found[k];
    if (!one) return;
    this.hide();
    world.wanted = one.thing;
    if (one.thing) {
      if (byId("scene").hidden && byId("map").hidden) worldTabs.choose(byId("tab-scene").disabled ? "map" : "scene");
      clock.seek(clock.time);
    } else clock.goTo(one.time, one.id);
  },
  hide() { this.box.hidden = true; this.input.setAttribute("aria-expanded", "false"); this.input.removeAttribute("aria-activedescendant"); },
};
search.input.addEventListener("input", () => search.show(search.input.value));
search.input.addEventListener("blur", () => search.hide());
search.input.addEventListener("focus", () => { if (search.input.value) search.show(search.input.value); });
search.input.addEventListener("keydown", (event) => {
  if (event.key === "ArrowDown" || event.key === "ArrowUp") {
    event.preventDefault();
    const number = search.found.length, step = event.key === "ArrowDown" ? 1 : -1;
    if (number) { search.at = (search.at + step + number) % number; search.point(); }
  } else if (event.key === "Enter") search.go(search.at);
  else if (event.key === "Escape") { search.hide(); search.input.blur(); }
});
