// What happened in plain sentences, each a link to its moment.

const story = {
  box: byId("story"), items: [],
  build() {
    this.items = [];
    this.box.replaceChildren(this.list(this.items));
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
    const item = this.items[current], { scrollTop, clientHeight } = this.box;
    if (this.box.hidden || !item || !byId("follow").checked) return;
    const top = item.offsetTop - this.box.offsetTop;
    if (top < scrollTop || top + item.offsetHeight > scrollTop + clientHeight) this.box.scrollTop = top - clientHeight / 3;
  },
};
clock.onTime((time) => { if (story.items.length) story.move(time); });
