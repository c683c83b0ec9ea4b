// Cards of failures: a sentence with advice, and inside it causes, attempts and lines of source; other cards below them.

function card(one, isFirst) {
  const failure = model.failures[one.failure];
  let node = nodes.get(one.node);
  while (node?.minor && node.above) node = node.above;
  const inside = el("div", { class: "inside" });
  const whole = el("details", { class: `card${one.recovered ? " recovered" : ""}`, open: isFirst },
    el("summary", {}, el("h2", { class: "advice" }, sentence(failure.headline)),
      el("span", { class: "said" }, `${one.recovered ? "recovered · " : ""}${node?.label ?? node?.name ?? ""} · ${seconds(one.time ?? 0)}`)),
    inside);
  const fill = () => {
    if (inside.childElementCount) return;
    inside.append(
      el("div", {}, el("h3", {}, "Why"), chainOf(failure), ...countsOf(failure),
        ...(one.tried.length ? [el("h3", {}, "What was tried"), el("ul", { class: "events" },
          ...one.tried.map(([time, id, text]) => el("li", {}, moment(time, id), el("span", {}, text))))] : [])),
      el("div", {}, el("p", {}, el("button", { type: "button", class: "show", onclick: (event) => show(one, event.target) },
        "Show the moment"), one.recovered || !model.facts.why ? "" : el("button", { type: "button", class: "show",
        title: model.facts.why, onclick: (event) => copyWhy(event.target) }, "Copy the command that finds what helps")),
      ...excerptsOf(node, failure)));
  };
  whole.addEventListener("toggle", fill);
  if (isFirst) fill();
  return whole;
}

// Goes to the moment of a card, and flashes what shows it, because the clock may be there already.
function show(one, button) {
  clock.goTo(one.time ?? 0, one.node);
  tree.flash(one.node);
  aim.at(clock.time);
  flash(byId("now"));
  button.textContent = `Shown: ${seconds(clock.time)}`;
  setTimeout(() => { button.textContent = "Show the moment"; }, 1500);
  document.querySelector(".panels").scrollIntoView({ block: "nearest" });
}

async function copyWhy(button) {
  const label = button.textContent;
  try { await navigator.clipboard.writeText(model.facts.why); button.textContent = "Copied"; }
  catch { button.textContent = model.facts.why; return; }  // some browsers forbid it for local files
  setTimeout(() => { button.textContent = label; }, 1500);
}

const sentence = (text) => `${text[0]?.toUpperCase() ?? ""}${text.slice(1)}${/[.!?]$/.test(text) ? "" : "."}`;

const cards = byId("cards"), whole = byId("whole");
fading(cards, (is) => { whole.hidden = cards.hidden || (!is && !cards.classList.contains("whole") && cards.scrollTop === 0); });
whole.addEventListener("click", () => {
  const is = cards.classList.toggle("whole");
  whole.setAttribute("aria-expanded", String(is));
  whole.textContent = is ? "▴ less of it" : "▾ all of it";
});

// Further cards, below those of failures: functions that return an id, a headline and the elements inside, or null if
// the model has nothing for them.
const sections = [];

function showCards() {
  const fatal = model.cards.filter((one) => !one.recovered), others = model.cards.filter((one) => one.recovered);
  const more = others.length === 0 ? [] : [el("details", { class: "card recovered", id: "recovered" },
    el("summary", {}, el("h2", { class: "advice" },
      `${others.length} failure${others.length > 1 ? "s" : ""} from which the plan recovered${fatal.length ? " before" : ""}`)),
    el("div", { class: "cards nested" }))];
  const below = sections.map((made) => made()).filter(Boolean).map(({ id, headline, inside }) =>
    el("details", { class: "card noted", id },
      el("summary", {}, el("h2", { class: "advice" }, headline)), el("div", { class: "inside" }, ...inside)));
  cards.hidden = fatal.length + others.length + below.length === 0;
  cards.replaceChildren(...fatal.map((one, k) => card(one, k === 0)), ...more, ...below);
  more[0]?.addEventListener("toggle", () => {
    const nested = more[0].querySelector(".nested");
    if (!nested.childElementCount) nested.append(...others.slice(0, 200).map((one) => card(one, false)));
  });
}
