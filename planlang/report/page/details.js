// Details of the selected step: its time, events, cause of failure, and lines in plan and recipe.

const AROUND = 3;  // lines of context before and after the marked ones

function moment(time, id, text = seconds(time)) {
  return el("button", { class: "moment", type: "button", onclick: () => clock.goTo(time, id) }, text);
}

function excerpt(source, line, end, isBad = false) {
  const lines = source.text.split("\n"), first = Math.max(0, line - 1 - AROUND);
  const rows = lines.slice(first, end + AROUND).map((text, k) => el("div",
    { class: `row${first + k + 1 >= line && first + k + 1 <= end ? ` at${isBad ? " bad" : ""}` : ""}` },
    el("span", { class: "number" }, String(first + k + 1)), el("span", { class: "text", title: text }, text || " ")));
  const called = `${source.name}, line${end > line ? "s" : ""} ${line}${end > line ? ` to ${end}` : ""}`;
  const box = el("div", { class: "excerpt mono", tabindex: "0", role: "group", "aria-label": called }, ...rows);
  fading(box);
  return el("figure", { class: "source" }, el("figcaption", { class: "said" }, ...broken(called)), box);
}

function excerptsOf(node, failure) {
  const found = new Map((node?.lines ?? []).map(([number, ...lines]) => [number, [...lines, false]]));
  for (const link of failure?.chain ?? []) {
    const number = model.sources.findIndex((source) => source.name === link.file);
    if (number >= 0) found.set(number, [link.line, link.line, true]);
  }
  for (let above = node?.above; above; above = above.above) {
    for (const [number, ...lines] of above.lines ?? []) if (!found.has(number)) found.set(number, [...lines, false]);
  }
  return [...found].sort((a, b) => a[0] - b[0])
    .map(([number, [line, end, isBad]]) => excerpt(model.sources[number], line, end, isBad || failure !== undefined));
}

function chainOf(failure) {
  return el("ol", { class: "chain" }, ...failure.chain.map((link, k) => el("li", {},
    k ? "because of " : "", el("span", { class: "type" }, link.type), `: ${link.message}`,
    link.where ? el("div", { class: "where" }, ...broken(`in ${link.where}${link.file ? ` (${link.file}:${link.line})` : ""}`)) : null,
    ...(link.others ?? []).map(([relation, name, text]) => el("div", { class: "where" }, `${relation} ${name}: ${text}`)))));
}

function countsOf(failure) {
  const link = failure.chain.find((one) => one.counts);
  if (!link) return [];
  const table = (title, counts) => {
    const most = Math.max(...Object.values(counts));
    return [el("h3", {}, title), el("div", { class: "counts" }, ...Object.entries(counts).flatMap(([name, number]) => {
      const bar = el("span", { class: "bar", "aria-hidden": "true" }), reason = reasons.get(name);
      bar.style.width = `${(100 * number) / most}%`;
      if (reason) bar.style.background = reason.colour;
      return [el("span", {}, reason ? reasonKey(name) : "", `${name}: ${number}`), bar];
    }))];
  };
  return [...table("Candidates, by why they were rejected", link.counts),
    ...(link.blocking ? table("In the way", link.blocking) : [])];
}

const details = byId("details");
let detailed = null;
function showDetails(node) {
  detailed = node ? statusAt(node, clock.time) : null;
  if (!node) {
    details.replaceChildren(el("p", { class: "said" }, "Select a step to see its details, and its lines in plan and recipe."));
    return;
  }
  const failure = failureOf(node), at = statusAt(node, clock.time);
  const when = node.start === null ? "never began" : node.end === null ? `from ${seconds(node.start)} on`
    : `${seconds(node.start)} to ${seconds(node.end)}`;
  details.replaceChildren(
    el("h2", {}, node.name, el("span", { class: `badge ${at}` }, CALLED[at])),
    at === "queued" ? el("p", {}, `waits for ${waitAt(node, clock.time)[1] || "a resource"}`) : "",
    el("p", { class: "said" }, moment(momentOf(node), node.id, when), ` · ${node.kind}${node.label ? ` · ${node.label}` : ""}`),
    node.text ? el("p", { class: "mono" }, node.text) : "",
    ...(failure && at !== "failed" ? [el("p", {}, "fails at ", moment(node.end, node.id))] : []),
    ...(failure && at === "failed" ? [el("h3", {}, "Why it failed"), el("p", { class: "headline" }, sentence(headlineOf(node))),
      chainOf(failure), ...countsOf(failure)] : []),
    ...(node.events ? [el("h3", {}, "What happened"), el("ul", { class: "events" },
      ...node.events.map(([time, , text]) => el("li", {}, moment(time, node.id), el("span", {}, text))))] : []),
    ...excerptsOf(node, at === "failed" ? failure : undefined));
}
fading(details);
clock.onSelect(showDetails);
clock.onTime((time) => {
  const node = nodes.get(clock.node);
  if (node && statusAt(node, time) !== detailed) showDetails(node);
});
