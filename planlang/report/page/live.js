// A running plan: updates arrive as server-sent events; buttons pause, step and stop the run.

const live = {
  box: byId("live"), following: true, state: { held: false, ended: false },
  begin() {
    this.box.hidden = false;
    byId("share").hidden = true;
    byId("aim").checked = true;  // who watches a run wants to see where it is
    for (const name of ["pause", "step", "stop"]) byId(`live-${name}`).addEventListener("click", () => this.press(name));
    byId("live-now").addEventListener("click", () => this.follow(true));
    byId("live-pace").addEventListener("change", (event) => this.send({ command: "pace", speed: Number(event.target.value) || null }));
    clock.onTime((time) => { if (time < clock.end - 0.05) this.follow(false, { go: false }); });
    this.show();
    this.follow(true);
    this.source = new EventSource("news");
    this.source.onmessage = (event) => { this.newest = event.data; this.read(); };
    this.source.onerror = () => { if (this.source.readyState === EventSource.CLOSED) this.lost(); };
  },
  press(name) {
    this.send({ command: name === "pause" && this.state.held ? "resume" : name });
    if (name !== "stop") this.follow(true);
  },
  follow(is, { go = true } = {}) {
    this.following = is;
    byId("live-now").setAttribute("aria-pressed", String(is));
    if (is && go) { clock.pause(); clock.seek(clock.end, { quiet: true }); }
  },
  async send(command) {
    try {
      const answer = await fetch("command", { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(command) });
      if (!answer.ok) tellMissing(await answer.text());
    } catch { this.lost(); }
  },
  // Shows only the newest update, because each contains the whole run and drawing it may take a while.
  async read() {
    if (this.reading) return;
    this.reading = true;
    while (this.newest) {
      const news = this.newest;
      this.newest = null;
      await this.take(JSON.parse(news));
    }
    this.reading = false;
  },
  async take(news) {
    if (news.state) { this.state = news.state; this.show(); }
    if (!news.model) return;
    if (news.meshes !== model.scene?.meshes.length) { location.reload(); return; }
    const { following } = this;
    const { scene: update, ...rest } = news.model;
    if (update && model.scene) {
      const previous = world.entities.length;
      Object.assign(model.scene, update);
      await readTracks(await inflated(news.poses, "deflate"));
      if (scene.ready && previous !== world.entities.length) await scene.again();
    }
    grow(rest);
    floorPlan.question = scene.question = undefined;
    this.follow(following);
    if (this.state.ended) this.source.close();
  },
  show() {
    const { held, ended } = this.state, button = byId("live-pause");
    button.textContent = held ? "resume" : "pause";
    button.title = held ? "continue the run" : "pause the run: plan time stops";
    byId("live-state").textContent = ended ? "the run has ended" : held ? "held" : "running";
    for (const name of ["pause", "step", "stop"]) byId(`live-${name}`).disabled = ended;
    byId("live-pace").disabled = ended;
  },
  lost() {
    if (this.state.ended) return;
    this.state = { held: false, ended: true };
    this.show();
    byId("live-state").textContent = "lost the connection to the program that runs the plan";
  },
};
