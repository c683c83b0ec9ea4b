// Help with typing: completes names, remembers the key until the tab is closed, loads files into the text.
// Every page works without it.
"use strict";

const KEY = "planlang.key";
const DELAY = 120; // time without a keystroke before names are requested [ms]
const LARGEST_TEXT = 1e6; // largest file that is loaded into the text [bytes]

function rememberKeys() {
  for (const field of document.querySelectorAll("input[name=key]")) {
    field.value = sessionStorage.getItem(KEY) || "";
    field.form.addEventListener("submit", () => sessionStorage.setItem(KEY, field.value));
  }
}

/** The name before the caret: its start and its text. */
function wordBefore(field) {
  const before = field.value.slice(0, field.selectionStart);
  const word = before.match(/[\p{L}\p{N}_-]*$/u)[0];
  return { start: before.length - word.length, text: word };
}

/** Complete names in a field: an editable combobox with a listbox, by the ARIA Authoring Practices. */
function complete(field) {
  const list = document.createElement("ul");
  list.id = field.id + "-names";
  list.className = "completions";
  list.hidden = true;
  list.setAttribute("role", "listbox");
  list.setAttribute("aria-label", "Names");
  field.after(list);
  for (const [name, value] of Object.entries({
    role: "combobox", "aria-autocomplete": "list", "aria-expanded": "false", "aria-controls": list.id,
  })) field.setAttribute(name, value);

  let chosen = -1, waiting = 0, asked = 0;

  function close() {
    list.hidden = true;
    list.replaceChildren();
    chosen = -1;
    field.setAttribute("aria-expanded", "false");
    field.removeAttribute("aria-activedescendant");
  }

  function mark(number) {
    chosen = (number + list.children.length) % list.children.length;
    [...list.children].forEach((one, at) => one.setAttribute("aria-selected", String(at === chosen)));
    field.setAttribute("aria-activedescendant", list.children[chosen].id);
    list.children[chosen].scrollIntoView({ block: "nearest" });
  }

  function take(name) {
    const word = wordBefore(field);
    const after = field.value.slice(word.start + word.text.length);
    field.value = field.value.slice(0, word.start) + name + after;
    field.setSelectionRange(word.start + name.length, word.start + name.length);
    close();
    field.focus();
  }

  function show(names) {
    close();
    list.replaceChildren(...names.map((name, number) => {
      const one = document.createElement("li");
      one.id = `${list.id}-${number}`;
      one.setAttribute("role", "option");
      one.setAttribute("aria-selected", "false");
      one.textContent = name;
      one.addEventListener("mousedown", (event) => { event.preventDefault(); take(name); });
      return one;
    }));
    list.hidden = names.length === 0;
    field.setAttribute("aria-expanded", String(!list.hidden));
  }

  async function ask() {
    const word = wordBefore(field).text;
    const number = ++asked;
    if (word.length < 2) return close();
    const answer = await fetch(`${field.dataset.complete}?start=${encodeURIComponent(word)}`).catch(() => null);
    if (!answer || !answer.ok || number !== asked || document.activeElement !== field) return;
    const names = (await answer.json()).names;
    if (number === asked) show(names.length === 1 && names[0] === word ? [] : names);
  }

  field.addEventListener("input", () => { clearTimeout(waiting); waiting = setTimeout(ask, DELAY); });
  field.addEventListener("blur", () => { asked++; close(); });
  field.addEventListener("keydown", (event) => {
    if (list.hidden) return;
    if (event.key === "ArrowDown") mark(chosen + 1);
    else if (event.key === "ArrowUp") mark(chosen < 0 ? -1 : chosen - 1);
    else if (event.key === "Escape") close();
    else if ((event.key === "Enter" || event.key === "Tab") && chosen >= 0) take(list.children[chosen].textContent);
    else return;
    event.preventDefault();
  });
}

/** Load a chosen file into the text for editing; large files and files that are not UTF-8 are sent unchanged. */
async function readInto(field) {
  const file = field.files[0];
  if (!file || file.size > LARGEST_TEXT) return;
  const text = document.getElementById(field.dataset.into);
  try {
    text.value = new TextDecoder("utf-8", { fatal: true }).decode(await file.arrayBuffer());
  } catch { return; }
  const name = document.getElementById("name");
  if (name && !name.value) name.value = file.name.replace(/\..*/, "").replace(/[^A-Za-z0-9_-]/g, "-").toLowerCase();
  text.rows = 24;
  field.value = "";
}

/** Move the caret to a line of the text. */
function goTo(event) {
  event.preventDefault();
  const text = document.getElementById("text");
  const lines = text.value.split("\n");
  const line = Number(event.currentTarget.dataset.line);
  const start = lines.slice(0, line - 1).join("\n").length + (line > 1 ? 1 : 0);
  text.focus();
  text.setSelectionRange(start, start + (lines[line - 1] || "").length);
  text.scrollTop = (line - 4) * parseFloat(getComputedStyle(text).lineHeight);
}

rememberKeys();
document.querySelectorAll("[data-complete]").forEach(complete);
document.querySelectorAll("[data-into]").forEach((field) => field.addEventListener("change", () => readInto(field)));
document.querySelectorAll("[data-line]").forEach((link) => link.addEventListener("click", goTo));

// Commands to copy name this server, as the browser knows it.
for (const server of document.querySelectorAll(".server")) server.textContent = location.origin;
