// The card of notes and warnings from before the run.

sections.push(() => model.notes.length === 0 ? null : {
  id: "notes",
  headline: `${model.notes.length} note${model.notes.length > 1 ? "s" : ""} from before the run`,
  inside: [el("ul", { class: "chain" }, ...model.notes.map((one) => el("li", {},
    el("span", { class: "type" }, `${one.severity} ${one.code}`), ` ${one.message}`,
    one.help ? el("div", { class: "where" }, `help: ${one.help}`) : null)))],
});
