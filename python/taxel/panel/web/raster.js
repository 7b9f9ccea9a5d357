// Ups and downs of each row over time.

import { fitted, ground, make, themed, write } from "./dom.js";

/** @typedef {import("./timeline.js").Timeline} Timeline */

/** The raster's canvas. Columns of time and rows are gathered, most first, where the screen has fewer pixels. */
export class Raster {
  /** @param {HTMLElement} element */
  constructor(element) {
    this.canvas = make("canvas", { id: "raster" });
    this.last = make("span");
    element.append(make("span", { class: "rows", "aria-hidden": "true" }, make("span", {}, "0"), this.last), this.canvas);
    this.context = ground(this.canvas);
    this.image = new ImageData(1, 1);
    this.pixels = new Uint32Array(1);
    this.words = new Uint32Array(256);
    this.unscaled = document.createElement("canvas");
  }

  /** Makes the colours again, after the theme has changed. */
  colour() {
    /** @param {string} name of a colour that the style sheet gives as #rrggbb */
    const read = (name) => [1, 3, 5].map((at) => parseInt(themed(name).slice(at, at + 2), 16));
    const [more, less, back] = ["more", "less", "well"].map(read);
    for (let i = 0; i < 256; i++) {
      const [ups, downs] = [i & 15, i >> 4];
      const strength = Math.min(1, (ups + downs) / 6 + 0.35) * (ups + downs ? 1 : 0);
      const [r, g, b] = [0, 1, 2].map((c) => {
        const ink = ups + downs ? (ups * more[c] + downs * less[c]) / (ups + downs) : 0;
        return Math.round(back[c] + (ink - back[c]) * strength);
      });
      this.words[i] = ((255 << 24) | (b << 16) | (g << 8) | r) >>> 0;
    }
  }

  /** @param {Timeline} timeline */
  draw(timeline) {
    write(this.last, String(timeline.rows - 1));
    const { width, height } = fitted(this.canvas);
    const { columns: shown, window, column_us, span_us, rows } = timeline;
    if (!shown || !window || !width || !height) {
      this.context.clearRect(0, 0, this.canvas.width, this.canvas.height);
      return;
    }
    const [begin, end] = shown;
    const columns = Math.ceil((end - begin + 1) / this.canvas.width);
    const gathered = Math.ceil(rows / this.canvas.height);
    const [wide, high] = [Math.ceil((end - begin + 1) / columns) + 1, Math.ceil(rows / gathered)];
    if (this.image.width !== wide || this.image.height !== high) {
      this.image = new ImageData(wide, high);
      this.pixels = new Uint32Array(this.image.data.buffer);
    }
    this.pixels.fill(this.words[0]);
    // Groups begin at whole multiples of their width, so that what is seen moves and does not flicker.
    const group = Math.floor(begin / columns);
    const seen = new Uint8Array(high);
    for (let i = 0; i < wide; i++) {
      seen.fill(0);
      for (let k = (group + i) * columns; k < (group + i + 1) * columns; k++) {
        const column = timeline.columnOf(k);
        if (k < begin || k > end || timeline.number[column] !== k) continue;
        for (let row = 0; row < rows; row++) {
          const value = timeline.raster[column * rows + row];
          if (!value) continue;
          const at = gathered === 1 ? row : Math.floor(row / gathered);
          const old = seen[at];
          seen[at] = Math.max(old & 15, value & 15) | Math.max(old & 240, value & 240);
        }
      }
      for (let y = 0; y < high; y++) if (seen[y]) this.pixels[y * wide + i] = this.words[seen[y]];
    }
    if (this.unscaled.width !== wide || this.unscaled.height !== high) [this.unscaled.width, this.unscaled.height] = [wide, high];
    ground(this.unscaled).putImageData(this.image, 0, 0);
    this.context.imageSmoothingEnabled = false;
    const scale = (this.canvas.width * column_us) / span_us;
    this.context.drawImage(this.unscaled, (group * columns - window[0] / column_us) * scale, 0, wide * columns * scale, this.canvas.height);
  }
}
