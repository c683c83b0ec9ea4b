// The run in plain sentences, each a link to its moment.

const story = {
  box: byId("story"), items: [],
  build() {
    this.items = [];
    this.box.replaceChildren(this.list(this.items));
    this.current = undefined;
    this.move(clock.time);
  },
  list(items = []) {
    return el("ol", { class: "story" }, ...model.story.map(([time, id, text, mood]) => {
      const item = el("li", { class: mood }, moment(time, id), el("span", { class: "words" }, text));
      items.push(item);
      return item;
    }));
  },
  move(time) {
    let current = -1;
    model.story.forEach((one, k) => { if (one[0] <= time + 0.004) current = k; });
    if (current === this.current && this.items.length) return;
    this.items.forEach((item, k) => {
      item.classList.toggle("future", k > current);
      item.classList.toggle("current", k === current);
    });
    this.current = current;
    if (byId("follow").checked) this.reveal();
  },
  // Scrolls to the current sentence if it is out of view.
  reveal() {
    const item = this.items[this.current], { scrollTop, clientHeight } = this.box;
    if (this.box.hidden || !item) return;
    if (item.offsetTop < scrollTop || item.offsetTop + item.offsetHeight > scrollTop + clientHeight) this.box.scrollTop = item.offsetTop - clientHeight / 3;
  },
};
clock.onTime((time) => { if (story.items.length) story.move(time); });
