// The curves of all channels, one above the other: of a sensor that has no map.

import { fitted, ground, make, themed } from "./dom.js";
import { rounded } from "./words.js";

/** @typedef {import("./timeline.js").Timeline} Timeline */

/** Steps above rest that fill a curve's height at least. */
const LEAST = 8;
/** Room between two curves, CSS pixels. */
const GAP = 2;
/** How many names have room beside their curves. */
const NAMED = 8;

/** The canvas of the curves; all have one scale, so that they can be compared. */
export class Channels {
  /** @param {HTMLElement} element */
  constructor(element) {
    this.element = element;
    this.names = make("span", { id: "channel-names", class: "rows", "aria-hidden": "true" });
    this.canvas = make("canvas", { id: "channels" });
    element.append(this.names, this.canvas);
    this.context = ground(this.canvas);
    /** The sensor whose channels are named. @type {import("./geometry.js").Geometry | null} */
    this.sensor = null;
  }

  /**
   * Names the sources that stand one above the other; else the channels, or only the first and the last without names or of many.
   * @param {import("./geometry.js").Geometry} sensor
   * @param {number[]} taxels
   */
  name(sensor, taxels) {
    const { array, sources } = sensor;
    this.sensor = sensor;
    this.element.parentElement?.style.setProperty("--count", String(taxels.length));
    const all = array.names !== undefined && taxels.length <= NAMED;
    const shown = (all ? taxels : [taxels[0], taxels[taxels.length - 1]]).map((k) => array.names?.[k] || String(k));
    const several = sources.length > 1;
    this.names.classList.toggle("several", several || all);
    this.names.replaceChildren(...(several ? sources.map(({ name }) => name) : shown).map((name) => make("span", { title: name }, name)));
  }

  /**
   * @param {Timeline} timeline
   * @param {import("./lanes.js").Shown} shown
   * @returns {string} the value that fills a curve's height
   */
  draw(timeline, { sensor, taxel, values }) {
    if (sensor.kind !== "channels") return "";
    const taxels = sensor.existing;
    const watched = taxel && Math.max(...taxel);
    if (this.sensor !== sensor) this.name(sensor, taxels);
    const { width, height, ratio } = fitted(this.canvas);
    const { context } = this;
    const { columns, window, column_us, span_us, channels, channel_count: all } = timeline;
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, width, height);
    if (!columns || !window || !all || !width || !height) return "";
    const [first, last] = columns;
    // A column more on the left, so that curves begin at the edge.
    const shown = Array.from({ length: last - first + 2 }, (_, i) => timeline.known(first - 1 + i));
    let most = LEAST;
    for (const column of shown) if (column >= 0) for (const channel of taxels) most = Math.max(most, channels[2 * (column * all + channel) + 1]);
    const high = height / taxels.length;
    const [line, chosen, grid] = ["more", "less", "grid"].map(themed);
    context.lineWidth = 1.25;
    taxels.forEach((channel, k) => {
      const floor = (k + 1) * high - 0.5;
      context.fillStyle = grid;
      context.fillRect(0, floor, width, 0.5);
      context.strokeStyle = context.fillStyle = channel === watched ? chosen : line;
      const [curve, area] = [new Path2D(), new Path2D()];
      // The points since the last gap: where they are, the least and the greatest of each.
      /** @type {[number, number, number][]} */
      let points = [];
      const end = () => {
        if (!points.length) return;
        const [[from], [to]] = [points[0], points[points.length - 1]];
        area.moveTo(from, floor);
        for (const [x, , high] of points) area.lineTo(x, high);
        area.lineTo(to, floor);
        points.forEach(([x, , high], i) => (i ? curve.lineTo(x, high) : curve.moveTo(x, high)));
        for (const [x, low] of points.reverse()) curve.lineTo(x, low);
        curve.closePath();
        points = [];
      };
      shown.forEach((column, i) => {
        const at = 2 * (column * all + channel);
        if (column < 0 || channels[at] > channels[at + 1]) return end();
        const [low, top] = [channels[at], channels[at + 1]].map((ticks) => floor - (ticks / most) * (high - GAP));
        points.push([(((first - 0.5 + i) * column_us - window[0]) / span_us) * width, low, top]);
      });
      end();
      context.globalAlpha = 0.25;
      context.fill(area);
      context.globalAlpha = 1;
      context.fill(curve);
      context.stroke(curve);
    });
    return `each up to ${rounded(most * values.step)} ${values.unit}`;
  }
}
