// The clock that drives all views, the selection, and the address of a moment: #t=41.5&node=12.

const clock = {
  time: 0, node: null, playing: false, speed: 2, end: Math.max(model.end, 0.01),
  listeners: [], choosers: [],
  onTime(listener) { this.listeners.push(listener); },
  onSelect(listener) { this.choosers.push(listener); },
  seek(time, { quiet = false } = {}) {
    this.time = Math.max(0, Math.min(this.end, time));
    for (const listener of this.listeners) listener(this.time);
    if (!quiet) this.remember();
  },
  // Selects a node; moves the clock to it if the current time is outside the node.
  select(id, { keep = false } = {}) {
    const node = nodes.get(id);
    this.node = node ? id : null;
    if (node && !keep) {
      const inside = node.start !== null && node.start <= this.time && this.time <= (node.end ?? this.end);
      if (!inside || node.status === "failed") this.seek(momentOf(node));
    }
    for (const chooser of this.choosers) chooser(node);
    this.remember();
  },
  goTo(time, id) {
    this.pause();
    this.seek(time);
    if (id !== null && id !== undefined) this.select(id, { keep: true });
  },
  play() {
    if (this.time >= this.end) this.seek(0);
    this.playing = true;
    let last = performance.now();
    const frame = (now) => {
      if (!this.playing) return;
      const time = this.time + ((now - last) / 1000) * this.speed;
      last = now;
      this.seek(time, { quiet: true });
      if (time >= this.end) this.pause();
      else requestAnimationFrame(frame);
    };
    requestAnimationFrame(frame);
    this.showState();
  },
  pause() {
    if (!this.playing) return;
    this.playing = false;
    this.showState();
    this.remember();
  },
  showState() {
    byId("play-shape").setAttribute("d", this.playing ? "M2 1h3v10H2zM7 1h3v10H7z" : "M2 1l9 5-9 5z");
    byId("play").setAttribute("aria-label", this.playing ? "Pause" : "Play");
  },
  address() {
    const node = this.node === null ? "" : `&node=${this.node}`;
    return `#t=${Number(this.time.toFixed(2))}${node}`;
  },
  remember() {
    clearTimeout(this.timer);
    this.timer = setTimeout(() => {
      try { history.replaceState(null, "", this.address()); } catch { /* some browsers forbid it for local files */ }
    }, 150);
  },
  // Goes to the moment and node in the address; false if it has none.
  recall() {
    const stated = new URLSearchParams(location.hash.slice(1));
    const time = Number.parseFloat(stated.get("t")), id = Number.parseInt(stated.get("node"), 10);
    if (nodes.has(id)) this.select(id, { keep: Number.isFinite(time) });
    if (Number.isFinite(time)) this.seek(time);
    return Number.isFinite(time) || nodes.has(id);
  },
};

const slider = byId("slider");
slider.max = clock.end;
slider.addEventListener("input", () => { clock.pause(); clock.seek(Number(slider.value)); });
clock.onTime((time) => {
  slider.value = time;
  slider.setAttribute("aria-valuetext", `${seconds(time)} of ${seconds(clock.end)}`);
  byId("now").textContent = `${time.toFixed(2)} of ${seconds(clock.end)}`;
});
clock.showState();
byId("play").addEventListener("click", () => (clock.playing ? clock.pause() : clock.play()));
byId("speed").addEventListener("change", (event) => { clock.speed = Number(event.target.value); });
addEventListener("hashchange", () => clock.recall());

// In a page of two runs on one clock (both.js): tells that page the time, and takes over the time of the other run.
if (parent !== window) {
  let isTold = false;
  addEventListener("message", (event) => {
    if (event.source !== parent || !Number.isFinite(event.data?.time)) return;
    isTold = true;
    clock.pause();
    clock.seek(event.data.time, { quiet: true });
    isTold = false;
  });
  clock.onTime((time) => { if (!isTold) parent.postMessage({ time }, "*"); });
}

// Moments to step through: begins and ends of shown steps, and events.
let moments = [];
function findMoments() {
  const times = model.marks.map((mark) => mark[0]);
  for (const node of nodes.values()) if (!node.minor) times.push(node.start, node.end);
  moments = [...new Set(times.filter((time) => time !== null))].sort((a, b) => a - b);
}
findMoments();
function stepMoment(direction) {
  const near = 0.005;
  const found = direction > 0 ? moments.find((time) => time > clock.time + near)
    : moments.findLast((time) => time < clock.time - near);
  clock.pause();
  clock.seek(found ?? (direction > 0 ? clock.end : 0));
}
byId("previous").addEventListener("click", () => stepMoment(-1));
byId("next").addEventListener("click", () => stepMoment(1));
byId("share").addEventListener("click", async () => {
  const link = location.href.split("#")[0] + clock.address();
  try { await navigator.clipboard.writeText(link); byId("share").textContent = "copied"; }
  catch { history.replaceState(null, "", clock.address()); byId("share").textContent = "in the address"; }
  setTimeout(() => { byId("share").textContent = "link"; }, 1500);
});
