// A list of rows of equal height. Only visible rows are in the document, so 10,000 rows cost as much as 30.

class VirtualList {
  constructor(box, height, make) {
    this.box = box; this.height = height; this.make = make; this.rows = []; this.first = -1; this.last = -1; this.kept = -1;
    this.spacer = el("div", { class: "spacer", role: "none" });
    box.append(this.spacer);
    box.addEventListener("scroll", () => this.draw());
    box.addEventListener("wheel", () => { this.kept = -1; }, { passive: true });
    new ResizeObserver(() => { this.draw(); this.reveal(this.kept); }).observe(box);
  }
  show(rows) {
    this.rows = rows;
    this.spacer.style.height = `${rows.length * this.height}px`;
    this.draw(true);
  }
  draw(again = false) {
    const first = Math.max(0, Math.floor(this.box.scrollTop / this.height) - 4);
    const last = Math.min(this.rows.length, first + Math.ceil(this.box.clientHeight / this.height) + 9);
    if (!again && first === this.first && last === this.last) return;
    this.first = first; this.last = last;
    const made = [];
    for (let place = first; place < last; place++) {
      const row = this.make(this.rows[place], place);
      row.style.top = `${place * this.height}px`;
      made.push(row);
    }
    this.spacer.replaceChildren(...made);
  }
  // Scrolls an invisible row into view, to about a third of the height.
  reveal(place) {
    this.kept = place;
    const top = place * this.height, { scrollTop, clientHeight } = this.box;
    if (place < 0 || (top >= scrollTop && top + this.height <= scrollTop + clientHeight)) return;
    this.box.scrollTop = Math.max(0, top - clientHeight / 3);
    this.draw();
  }
}
