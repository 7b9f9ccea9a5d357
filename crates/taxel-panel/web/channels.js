// The curves of all channels, one above the other: of a sensor that has no map.

import { fitted, ground, themed } from "./dom.js";

/** @typedef {import("./timeline.js").Timeline} Timeline */

/** Steps above rest that fill a curve's height at least. */
const LEAST = 8;
/** Room between two curves, CSS pixels. */
const GAP = 2;

/** The canvas of the curves; all have one scale, so that they can be compared. */
export class Channels {
  /** @param {HTMLCanvasElement} canvas */
  constructor(canvas) {
    this.canvas = canvas;
    this.context = ground(canvas);
  }

  /**
   * @param {Timeline} timeline
   * @param {number[]} places of the channels that exist
   * @param {number | null} watched the place of one of them
   * @returns {number} the steps above rest that fill a curve's height
   */
  draw(timeline, places, watched) {
    const { width, height, ratio } = fitted(this.canvas);
    const { context } = this;
    const { columns, window, column_us, span_us, channels, channel_count: all } = timeline;
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, width, height);
    if (!columns || !window || !all || !width || !height) return LEAST;
    const [first, last] = columns;
    // A column more on the left, so that curves begin at the edge.
    const shown = Array.from({ length: last - first + 2 }, (_, i) => timeline.known(first - 1 + i));
    let most = LEAST;
    for (const place of shown) if (place >= 0) for (const channel of places) most = Math.max(most, channels[place * all + channel]);
    const high = height / places.length;
    const [line, other, grid] = ["more", "less", "grid"].map(themed);
    context.lineWidth = 1.25;
    places.forEach((channel, k) => {
      const floor = (k + 1) * high - 0.5;
      context.fillStyle = grid;
      context.fillRect(0, floor, width, 0.5);
      context.strokeStyle = context.fillStyle = channel === watched ? other : line;
      const [curve, area] = [new Path2D(), new Path2D()];
      // Where the curve begins after a gap, and where it is.
      let [from, x] = [NaN, 0];
      const end = () => {
        if (Number.isNaN(from)) return;
        area.lineTo(x, floor);
        area.lineTo(from, floor);
        from = NaN;
      };
      shown.forEach((place, i) => {
        if (place < 0) return end();
        // A curve has the value at the end of its column.
        x = (((first + i) * column_us - window[0]) / span_us) * width;
        const y = floor - (channels[place * all + channel] / most) * (high - GAP);
        if (Number.isNaN(from)) {
          from = x;
          curve.moveTo(x, y);
          area.moveTo(x, y);
        }
        curve.lineTo(x, y);
        area.lineTo(x, y);
      });
      end();
      context.globalAlpha = 0.25;
      context.fill(area);
      context.globalAlpha = 1;
      context.stroke(curve);
    });
    return most;
  }
}
