// Curves under the raster: the watched taxel, force and area, the centre. All share one time.

import uPlot from "./vendor/uPlot.js";
import { escaped, make, part, themed, write } from "./dom.js";
import { UNKNOWN_VALUE } from "./protocol.js";
import { rounded } from "./words.js";

/** @typedef {import("./timeline.js").Timeline} Timeline */
/** @typedef {(number | null)[]} Curve */
/** @typedef {"taxel" | "force" | "centre"} Name */

/** Room for the numbers on either side, CSS pixels; the raster has the same. */
const SIDE = 44;
/** CSS pixels between two lines of the grid. */
const GRID_PX = 96;
/** @type {readonly Name[]} */
const NAMES = ["taxel", "force", "centre"];
/** Colours of the sums of several sources, by their names in style.css. */
const COLOURS = ["more", "less", "label", "good"];

/** Curves of the window, drawn by uPlot. */
export class Lanes {
  constructor() {
    /** @type {Map<Name, uPlot>} */
    this.plots = new Map();
    /** Least and greatest coordinate of a centre; null of channels, which have neither centre nor area. @type {[number, number] | null} */
    this.limits = [0, 64];
    /** Names of the sources that have curves of their own; empty: one for all. @type {string[]} */
    this.sources = [];
    /** The sensor that is shown. @type {import("./geometry.js").Geometry | null} */
    this.sensor = null;
    /** Size of a tick in the unit of the values, and ticks of the value 0. */
    this.values = { step: 1, zero: 0 };
    /** Size of a tick in the unit of the sum of the values. */
    this.sum_step = 1;
    /** Times from the left edge of the window, s, and curves at them. @type {Record<Name, [number[], ...Curve[]]>} */
    this.data = { taxel: [[], [], [], []], force: [[], [], []], centre: [[], [], []] };
    /** The length of the window, s, and where the axis has numbers, s from its left edge. */
    this.span_s = 1;
    /** @type {number[]} */
    this.splits = [];
    this.observer = new ResizeObserver(() => this.fit());
    for (const name of NAMES) this.observer.observe(part(`${name}-lane`, HTMLElement));
    this.make();
  }

  /** Makes the plots, and again after the theme has changed. */
  make() {
    const [text, grid, one, two, band] = ["dim", "grid", "more", "less", "band"].map(themed);
    /**
     * @param {string} scale
     * @param {number} side
     * @param {string} stroke
     * @returns {uPlot.Axis}
     */
    const axis = (scale, side, stroke) => ({
      scale,
      side,
      stroke,
      size: SIDE,
      gap: 4,
      space: 24,
      font: "11px system-ui, sans-serif",
      grid: { show: side === 3, stroke: grid, width: 1 },
      ticks: { show: false },
      values: (_, marks) => marks.map((mark) => (mark >= 10_000 ? `${mark / 1000}k` : String(mark))),
    });
    /** @type {uPlot.Axis} */
    const time = { show: true, size: 0, values: () => [], grid: { stroke: grid, width: 1 }, ticks: { show: false }, splits: () => this.splits };
    /** @param {string} stroke @param {string} scale @param {number[]} [dash] @returns {uPlot.Series} */
    const line = (stroke, scale, dash) => ({ stroke, scale, width: 1.25, points: { show: false }, ...(dash ? { dash } : {}) });
    /** @type {uPlot.Series} the edge of a band */
    const bound = { scale: "value", points: { show: false } };
    /** @param {() => number} least of its end @returns {uPlot.Scale.Range} */
    const fromZero = (least) => (_, __, most) => [0, Math.max(least(), (most ?? 0) * 1.1)];
    const [low, high] = this.limits ?? [0, 1];
    const areas = this.limits !== null;
    const colours = this.sources.length ? COLOURS.slice(0, this.sources.length).map(themed) : [one];
    // Beside the colours of several sources the area has none.
    const area = this.sources.length ? text : two;
    /** @type {Record<Name, { scales: uPlot.Scales, series: uPlot.Series[], axes: uPlot.Axis[], bands?: uPlot.Band[] }>} */
    const plans = {
      taxel: {
        scales: { value: { range: (_, least, most) => (least === null ? [0, 10] : [least - 2 * this.values.step, most + 2 * this.values.step]) } },
        series: [{}, bound, bound, line(one, "value")],
        bands: [{ series: [2, 1], fill: band }],
        axes: [time, axis("value", 3, text)],
      },
      force: {
        scales: { force: { range: fromZero(() => 8 * this.sum_step) }, area: { range: fromZero(() => 8) } },
        series: [{}, ...colours.map((colour) => line(colour, "force")), { ...line(area, "area", [5, 3]), show: areas }],
        axes: [time, axis("force", 3, this.sources.length ? text : one), { ...axis("area", 1, area), ...(areas ? {} : { values: () => [] }) }],
      },
      centre: {
        scales: { place: { range: [low, high] } },
        series: [{}, ...(this.sources.length ? colours.flatMap((colour) => [line(colour, "place"), line(colour, "place", [5, 3])]) : [line(one, "place"), line(two, "place", [5, 3])])],
        axes: [time, { ...axis("place", 3, text), splits: () => [low, (low + high) / 2, high], values: (_, marks) => marks.map(rounded) }],
      },
    };
    for (const name of NAMES) {
      this.plots.get(name)?.destroy();
      const place = part(`${name}-lane`, HTMLElement);
      const { scales, ...plan } = plans[name];
      const right = name === "force" ? 0 : SIDE;
      const plot = new uPlot(
        {
          ...plan,
          width: Math.max(100, place.clientWidth),
          height: Math.max(40, place.clientHeight),
          // Half of the uppermost number's height.
          padding: [7, right, 4, 0],
          legend: { show: false },
          cursor: { show: false },
          scales: { x: { time: false, range: () => [0, this.span_s] }, ...scales },
        },
        this.data[name],
        place,
      );
      this.plots.set(name, plot);
    }
  }

  /** @param {import("./geometry.js").Geometry} sensor */
  size(sensor) {
    this.sensor = sensor;
    const limits = sensor.kind === "channels" ? null : sensor.limits;
    const [across, down] = sensor.axes;
    write(part("centre-across", HTMLElement), across);
    write(part("centre-down", HTMLElement), down);
    part("area-legend", HTMLElement).hidden = limits === null;
    if (String(this.limits) === String(limits)) return;
    this.limits = limits;
    this.make();
  }

  /** Names the curves of the sums, by their colours, which those of the centres have too. @param {string[]} sources that have a curve each; none: one curve for all */
  name(sources) {
    if (String(this.sources) === String(sources)) return;
    this.sources = sources;
    /** @type {Curve[]} */
    const curves = [[], ...(sources.length ? sources.map(() => []) : [[]])];
    this.data.force = [this.data.taxel[0], ...curves];
    this.data.centre = [this.data.taxel[0], ...curves.slice(1).flatMap(() => [[], []])];
    part("centre-legend", HTMLElement).classList.toggle("apart", sources.length > 0);
    const one = () => make("output", { id: "force-sum", "aria-live": "off" });
    const names = sources.flatMap((source, k) => [make("span", { class: `swatch ${COLOURS[k]}` }), ` ${escaped(source)} `, make("output", { "aria-live": "off" }), " "]);
    part("force-sums", HTMLElement).replaceChildren(...(names.length ? names : [make("span", { class: "swatch more" }), " ", one()]));
    part("area-legend", HTMLElement).classList.toggle("apart", sources.length > 0);
    this.make();
  }

  /** Fits the plots to their places. */
  fit() {
    for (const [name, plot] of this.plots) {
      const { clientWidth: width, clientHeight: height } = part(`${name}-lane`, HTMLElement);
      if (width > 0 && height > 0 && (plot.width !== width || plot.height !== height)) plot.setSize({ width, height });
    }
  }

  /** @param {Timeline} timeline */
  draw(timeline) {
    const { columns, window, column_us, history, area } = timeline;
    const { step, zero } = this.values;
    if (!columns || !window) return;
    this.span_s = timeline.span_us / 1e6;
    this.splits = timeline.ticks(part("force-lane", HTMLElement).clientWidth / GRID_PX).map(({ share }) => share * this.span_s);
    const [first, end] = columns;
    // A column more on the left, so that curves begin at the edge.
    const count = end - first + 2;
    const [times, least, greatest, last] = this.data.taxel;
    const [, ...sums] = this.data.force;
    const touched = sums.pop() ?? [];
    const [, ...places] = this.data.centre;
    this.data.force[0] = this.data.centre[0] = times;
    for (const curve of [times, least, greatest, last, ...sums, touched, ...places]) curve.length = count;
    const { sensor } = this;
    /** @param {number} k @param {number} x */
    const across = (k, x) => (sensor && sensor.kind !== "channels" ? sensor.across(k, x) : x);
    for (let i = 0; i < count; i++) {
      const place = timeline.known(first - 1 + i);
      // A curve has the value at the end of its column.
      times[i] = ((first + i) * column_us - window[0]) / 1e6;
      const known = place >= 0 && history[3 * place + 2] !== UNKNOWN_VALUE;
      least[i] = known ? (history[3 * place] - zero) * step : null;
      greatest[i] = known ? (history[3 * place + 1] - zero) * step : null;
      last[i] = known ? (history[3 * place + 2] - zero) * step : null;
      const each = place >= 0 ? timeline.sums(place) : [];
      sums.forEach((curve, k) => (curve[i] = each[k] >= 0 ? each[k] * this.sum_step : null));
      touched[i] = place >= 0 && area[place] >= 0 ? area[place] : null;
      const centres = place >= 0 ? timeline.centres(place) : [];
      for (let k = 0; 2 * k < places.length; k++) {
        const [x, y] = centres[k] ?? [NaN, NaN];
        places[2 * k][i] = Number.isNaN(x) ? null : across(k, x);
        places[2 * k + 1][i] = Number.isNaN(x) ? null : y;
      }
    }
    for (const [name, plot] of this.plots) {
      if (!part(`${name}-block`, HTMLElement).hidden) plot.setData(this.data[name]);
    }
  }
}
