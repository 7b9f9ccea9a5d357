// The lanes, one above the other: all share one time. A new lane is an entry of LANES and what draws it: the block on the page, its element, and
// what the cursor says come from the entry.

import { make, part, themed, write } from "./dom.js";
import { movable } from "./arrangement.js";
import { UNKNOWN_VALUE } from "./protocol.js";
import { Raster } from "./raster.js";
import { regionColour } from "./regions.js";
import uPlot from "./vendor/uPlot.js";
import { rounded, integer } from "./words.js";

/** @typedef {import("./timeline.js").Timeline} Timeline */
/** @typedef {import("./timeline.js").Values} Values */
/** @typedef {{ scales: uPlot.Scales, series: uPlot.Series[], axes: uPlot.Axis[], bands?: uPlot.Band[] }} Plan of the curves, without the axis of time */

/**
 * What the page shows.
 * @typedef {object} Shown
 * @property {import("./geometry.js").Geometry} sensor
 * @property {import("./geometry.js").Taxel | null} taxel the watched one
 * @property {string} named its name
 * @property {{ unit: string, step: number, zero: number, frames: boolean }} values their unit, the size of a tick in it, ticks of the value 0, and whether they are of frames
 * @property {{ unit: string, step: number }} sums unit of the sum of the values, and size of a tick in it
 * @property {number | null} gap_us how long frames of a live source may be away until the curves have a gap; null: however long
 * @property {number} top ticks above rest that fill the room of a channel's curve
 * @property {import("./regions.js").Regions} regions of the recording
 */

/**
 * A lane. It draws curves (`plan`, `at`, `says`), or paints a canvas (`painter`).
 * @typedef {object} Lane
 * @property {string} name of its elements: `NAME-block` with a heading, and `NAME-lane`
 * @property {string} label what it is, for those who hear the page
 * @property {string} [kind] class of its block and of its element in style.css
 * @property {(shown: Shown) => boolean} [fits] whether it has anything to show of this source; without it: of all
 * @property {(shown: Shown, sources: string[]) => (Node | string)[]} heading
 * @property {(shown: () => Shown, sources: string[]) => Plan} [plan]
 * @property {(shown: Shown, timeline: Timeline, column: number) => (number | null)[]} [at] values of all series in a column
 * @property {(shown: Shown, values: Values) => string[]} [says] texts of the outputs in its heading
 * @property {(element: HTMLElement) => Raster} [painter]
 */

/** Room for the numbers on the left, and for half a number of the axis of time on the right, CSS pixels; as in style.css. */
const SIDE = 44;
const RIGHT = 14;
/** Steps between the numbers of an axis of counts. */
const WHOLE = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10_000, 20_000];
/** Up to this many channels have a curve each, and so many a name of so many letters beside it. */
const MOST_CHANNELS = 64;
const NAMED = 8;
const LETTERS = 7;
/** Part of its room that a channel's curve takes. */
const ROOM = 0.94;
/** Colours of the sums of several sources, by their names in style.css. */
const COLOURS = ["more", "less", "label", "good"];

/** @param {string} kind */
const swatch = (kind) => make("span", { class: `swatch ${kind}` });
/** @param {Record<string, string>} [attributes] */
const output = (attributes) => make("output", { "aria-live": "off", ...attributes });

/** @param {string} scale @param {string} stroke @returns {uPlot.Axis} on the left */
const axis = (scale, stroke) => ({
  scale, stroke,
  side: 3,
  size: SIDE, gap: 4, space: 20,
  font: "11px system-ui, sans-serif",
  grid: { stroke: themed("grid"), width: 1 },
  ticks: { show: false },
  values: (_, marks) => marks.map((mark) => (mark >= 10_000 ? `${mark / 1000}k` : String(mark))),
});
/** @param {string | (() => string)} stroke @param {string} scale @param {number[]} [dash] @returns {uPlot.Series} */
const line = (stroke, scale, dash) => ({ stroke, scale, width: 1.25, points: { show: false }, ...(dash ? { dash } : {}) });
/**
 * Curves that are drawn from least to greatest.
 * @param {(string | (() => string))[]} strokes the colour of each
 * @param {string} scale
 * @param {(number[] | undefined)[]} [dashes]
 * @returns {{ series: uPlot.Series[], bands: uPlot.Band[] }}
 */
const extents = (strokes, scale, dashes = []) => ({
  series: strokes.flatMap((stroke, k) => [line(stroke, scale, dashes[k]), line(stroke, scale, dashes[k])]),
  bands: strokes.map((fill, k) => ({ series: [2 * k + 2, 2 * k + 1], fill })),
});
/** @param {import("./timeline.js").Extent | null} extent @param {number} [step] @returns {(number | null)[]} what is drawn of it */
const ends = (extent, step = 1) => (extent ? extent.map((value) => value * step) : [null, null]);
/** @param {() => number} least of its end @returns {uPlot.Scale.Range} */
const fromZero = (least) => (_, __, greatest) => [0, Math.max(least(), (greatest ?? 0) * 1.1)];
/** @param {string[]} sources @returns {string[]} the colour of each, or of one curve for all */
const coloured = (sources) => (sources.length ? COLOURS.slice(0, sources.length) : COLOURS.slice(0, 1)).map(themed);

/** @param {Values} values @returns {import("./timeline.js").Curve[]} of each of several sources, or of all */
const each = ({ curves }) => (curves.length > 1 ? curves.slice(1) : curves);

/** @param {Shown} shown @param {Values} values @returns {string[]} the sum, of several sources of each */
const sumsAt = ({ sums: { unit, step } }, values) =>
  each(values).map((curve) => (curve ? `${step === 1 ? integer(curve.sum) : rounded(curve.sum * step)} ${unit}` : "missing"));

/** @param {Shown} shown @param {Values} values @returns {string} the number of taxels that are pressed */
const areaAt = ({ sensor }, { curves: [all] }) => (all ? sensor.area(all.area) : "");

/** @param {Shown} shown @param {Values} values @returns {string} the centre of pressure, of several sources of each that is pressed */
function centreAt({ sensor }, values) {
  const [all] = values.curves;
  if (sensor.kind === "channels" || !all || all.area <= 1) return "";
  const of = each(values);
  if (of.length === 1) return Number.isNaN(all.x) ? "nothing pressed" : sensor.centre(all.x, all.y);
  const pressed = of.flatMap((curve, k) => (!curve || Number.isNaN(curve.x) ? [] : [`${sensor.sources[k].name} ${sensor.within(k, [curve.x, curve.y])}`]));
  return pressed.length ? pressed.join(", ") + sensor.unit : "nothing pressed";
}

/**
 * Names of the curves of channels: of several sources each at its first one; else of all, or of many only of the first and the last.
 * @param {import("./geometry.js").Geometry} sensor
 * @returns {string[]}
 */
function namesOf({ array, columns, sources, taxelsThatExist: taxels }) {
  const named = taxels.map(([x, y], k) => {
    if (sources.length > 1) return sources.find(({ left }) => left === x)?.name ?? "";
    const few = array.names !== undefined && taxels.length <= NAMED;
    return few || k === 0 || k === taxels.length - 1 ? array.names?.[y * columns + x] || String(k) : "";
  });
  return named.map((name) => (name.length > LETTERS ? `${name.slice(0, LETTERS - 1)}…` : name));
}

/** The lanes, from top to bottom. @type {readonly Lane[]} */
export const LANES = [
  {
    name: "raster", label: "Raster of events by row over time", kind: "raster",
    // The values of frames and of channels say more than their changes.
    fits: ({ values, sensor }) => !values.frames && sensor.kind !== "channels",
    heading: () => ["Raster ", make("span", {}, swatch("more"), " more ", swatch("less"), " less, by row")],
    painter: (element) => new Raster(element),
  },
  {
    name: "channels", label: "Curve of each channel over time, one above the other", kind: "tall",
    fits: ({ sensor }) => sensor.kind === "channels" && sensor.rows * sensor.columns <= MOST_CHANNELS,
    heading: () => ["Channels ", swatch("more"), " ", output({ id: "channels-scale", class: "dim" })],
    says: ({ values: { step, unit }, top }) => [`each up to ${rounded(top * step)} ${unit}`],
    plan: (shown) => {
      const { sensor } = shown();
      const [line, chosen, dim] = ["more", "less", "dim"].map(themed);
      const taxels = sensor.taxelsThatExist;
      return {
        scales: { channels: { range: () => [-taxels.length, 0] } },
        ...extents(taxels.map((taxel) => () => (String(taxel) === String(shown().taxel) ? chosen : line)), "channels"),
        axes: [{ ...axis("channels", dim), grid: { show: false }, splits: () => taxels.map((_, k) => -k - 0.5), values: () => namesOf(sensor) }],
      };
    },
    at: ({ sensor, top }, { channels, channel_count: all }, column) =>
      sensor.taxelsThatExist.flatMap(([x, y], k) => {
        const at = 2 * (column * all + y * sensor.columns + x);
        const [low, high] = [channels[at], channels[at + 1]];
        return low > high ? [null, null] : [(ROOM * low) / top - k - 1, (ROOM * high) / top - k - 1];
      }),
  },
  {
    name: "taxel", label: "History of the watched taxel",
    heading: () => ["Taxel ", make("span", {}, "least to greatest"), " ", output()],
    says: ({ values: { unit, step, zero } }, { taxel }) => (taxel === null ? [] : [`${rounded((taxel - zero) * step)} ${unit}`]),
    plan: (shown) => {
      const room = () => 2 * shown().values.step;
      return {
        scales: { value: { range: (_, least, greatest) => (least === null ? [0, 10] : [least - room(), greatest + room()]) } },
        ...extents([themed("more")], "value"),
        axes: [axis("value", themed("dim"))],
      };
    },
    at: ({ values: { step, zero } }, { history }, column) =>
      history[3 * column + 2] === UNKNOWN_VALUE ? [] : Array.from(history.subarray(3 * column, 3 * column + 2), (ticks) => (ticks - zero) * step),
  },
  {
    name: "force", label: "Sum of the values, or force",
    heading: ({ sums }, sources) => [
      make("b", { id: "force-title" }, sums.unit === "N" ? "Force" : "Sum"),
      " ",
      make("span", { id: "force-sums" }, ...(sources.length ? sources.flatMap((source, k) => [swatch(COLOURS[k]), ` ${source} `, output(), " "]) : [swatch("more"), " ", output({ id: "force-sum" })])),
    ],
    says: sumsAt,
    plan: (shown, sources) => ({
      scales: { force: { range: fromZero(() => 8 * shown().sums.step) } },
      ...extents(coloured(sources), "force"),
      axes: [axis("force", sources.length ? themed("dim") : themed("more"))],
    }),
    at: ({ sums: { step } }, timeline, column) => timeline.drawn.flatMap((curve) => ends(timeline.sumIn(column, curve), step)),
  },
  {
    name: "regions", label: "Force, pressure or area of each region",
    fits: ({ regions }) => regions.all.length > 0,
    heading: ({ regions }) => [
      make("b", {}, `${regions.quantity} of regions`),
      ...regions.all.flatMap(({ name }, k) => {
        const colour = swatch("");
        colour.style.background = regionColour(k);
        return [" ", colour, ` ${name} `, output()];
      }),
    ],
    says: ({ regions }) => regions.all.map((region) => regions.says(region)),
    plan: (shown) => ({
      scales: { regions: { range: fromZero(() => 1e-6) } },
      ...extents(shown().regions.all.map((_, k) => regionColour(k)), "regions"),
      axes: [axis("regions", themed("dim"))],
    }),
    at: ({ regions }, { number, column_us }, column) => regions.all.flatMap((region) => regions.at(region, number[column], column_us) ?? [null, null]),
  },
  {
    name: "area", label: "Number of taxels pressed", kind: "low",
    fits: ({ sensor }) => sensor.kind !== "channels",
    heading: () => ["Area ", swatch("less"), " ", output({ id: "area-now" })],
    says: (shown, values) => [areaAt(shown, values)],
    plan: () => ({ scales: { area: { range: fromZero(() => 8) } }, ...extents([themed("less")], "area"), axes: [{ ...axis("area", themed("less")), incrs: WHOLE }] }),
    at: (_, timeline, column) => ends(timeline.areaIn(column)),
  },
  {
    name: "centre", label: "Centre of pressure", kind: "low",
    fits: ({ sensor }) => sensor.kind !== "channels",
    heading: ({ sensor: { axes: [across, down] } }, sources) =>
      // Of several sources each value has the name of its axis.
      ["Centre ", make("span", { class: sources.length ? "apart" : "" }, swatch("more"), sources.length ? " " : ` ${across} `, swatch("less dashed"), sources.length ? "" : ` ${down}`), " ", output({ id: "centre-now" })],
    says: (shown, values) => [centreAt(shown, values)],
    plan: (shown, sources) => {
      const [low, high] = shown().sensor.limits;
      const down = themed("less");
      const colours = coloured(sources).flatMap((colour) => [colour, sources.length ? colour : down]);
      return {
        scales: { centre: { range: [low, high] } },
        ...extents(colours, "centre", colours.map((_, k) => (k % 2 ? [5, 3] : undefined))),
        axes: [{ ...axis("centre", themed("dim")), splits: () => [low, (low + high) / 2, high], values: (_, marks) => marks.map(rounded) }],
      };
    },
    // A single loaded taxel has no centre of its own.
    at: ({ sensor }, timeline, column) =>
      (timeline.areaIn(column)?.[1] ?? 0) <= 1
        ? []
        : timeline.drawn.flatMap((curve, k) => {
            const [x, y] = timeline.centreIn(column, curve);
            return [...ends(sensor.kind === "channels" || !x ? x : [sensor.across(k, x[0]), sensor.across(k, x[1])]), ...ends(y)];
          }),
  },
];

/** The lanes on the page. */
export class Lanes {
  /**
   * @param {import("./settings.js").Settings} settings
   * @param {() => Shown} shown
   */
  constructor(settings, shown) {
    this.settings = settings;
    this.shown = shown;
    /** Names of the sources that have curves of their own; empty: one for all. @type {string[]} */
    this.sources = [];
    /** What the headings and plots were made for. */
    this.made = "";
    /** The length of the window, s, and where the axis has numbers, s from its left edge. */
    this.span_s = 1;
    /** @type {number[]} */
    this.splits = [];
    const observer = new ResizeObserver(() => this.fit());
    this.all = LANES.map((lane) => {
      const [heading, element] = [make("h2"), make("div", { id: `${lane.name}-lane`, class: `lane ${lane.kind ?? ""}`, role: "img", "aria-label": lane.label })];
      const line = make("div", { class: "between", role: "separator", tabindex: 0, "aria-orientation": "horizontal", "aria-label": `${lane.label}: its upper edge, arrow keys` });
      const block = make("section", { id: `${lane.name}-block`, class: lane.kind ?? "" }, line, heading, element);
      movable(line, "y", (by) => this.resize(block, by));
      part("axis", HTMLElement).before(block);
      observer.observe(element);
      return { lane, block, line, heading, element, painter: lane.painter?.(element), plot: /** @type {uPlot | null} */ (null) };
    });
  }

  /** @returns {Lane[]} those that are shown */
  get visible() {
    const shown = this.shown();
    return LANES.filter(({ fits }) => !fits || fits(shown));
  }

  /** Shows the lanes that the source has. */
  show() {
    const { visible } = this;
    for (const { lane, block, line } of this.all) {
      block.hidden = !visible.includes(lane);
      line.hidden = lane === visible[0];
      block.style.flexGrow = String(this.settings.values.heights[lane.name] ?? "");
    }
    this.renew();
  }

  /** Makes headings and plots where they are not yet for this theme and source. */
  renew() {
    const { sources } = this;
    const shown = this.shown();
    const { sensor, sums, regions } = shown;
    const key = JSON.stringify([this.settings.theme, sensor.kind, sensor.limits, sensor.axes, sums.unit, sources, regions.named]);
    if (this.made === key) return;
    this.made = key;
    const grid = { stroke: themed("grid"), width: 1 };
    /** @type {uPlot.Axis} */
    const time = { show: true, size: 0, values: () => [], grid, ticks: { show: false }, splits: () => this.splits };
    for (const item of this.all) {
      const { lane, heading, element, painter } = item;
      heading.replaceChildren(...lane.heading(shown, sources));
      painter?.colour();
      item.plot?.destroy();
      if (!lane.plan) continue;
      const { scales, series, axes, bands } = lane.plan(this.shown, sources);
      item.plot = new uPlot(
        {
          bands, series: [{}, ...series], axes: [time, ...axes],
          width: Math.max(100, element.clientWidth), height: Math.max(40, element.clientHeight),
          // Half of the uppermost number's height.
          padding: [7, RIGHT, 4, 0],
          legend: { show: false }, cursor: { show: false },
          scales: { x: { time: false, range: () => [0, this.span_s] }, ...scales },
        },
        [[], ...series.map(() => [])],
        element,
      );
    }
  }

  /** Moves the upper edge of a lane: what it loses the one above it gains. @param {HTMLElement} block @param {number} by CSS pixels */
  resize(block, by) {
    const shown = this.all.filter(({ block: { hidden } }) => !hidden);
    const heights = shown.map((one) => one.block.clientHeight);
    const below = shown.findIndex((one) => one.block === block);
    heights[below - 1] += by;
    heights[below] -= by;
    this.settings.set("heights", { ...this.settings.values.heights, ...Object.fromEntries(shown.map(({ lane }, k) => [lane.name, heights[k]])) });
    this.show();
  }

  /** Fits the plots to their elements. */
  fit() {
    for (const { plot, element: { clientWidth: width, clientHeight: height } } of this.all) {
      if (plot && width > 0 && height > 0 && (plot.width !== width || plot.height !== height)) plot.setSize({ width, height });
    }
  }

  /** @param {Timeline} timeline @param {import("./timeline.js").Tick[]} ticks of its axis @param {string} [only] the lane to draw; default: all */
  draw(timeline, ticks, only) {
    const { columns, window, column_us } = timeline;
    const shown = this.shown();
    this.sources = shown.sensor.sources.slice(0, timeline.source_count).map(({ name }) => name);
    this.renew();
    this.span_s = timeline.span_us / 1e6;
    this.splits = ticks.map(({ share }) => share * this.span_s);
    const gaps = shown.gap_us !== null && columns ? timeline.gaps(columns[0] - 1, columns[1], shown.gap_us) : new Set();
    for (const { lane, block, painter, plot } of this.all) {
      if (block.hidden || (only && only !== lane.name)) continue;
      painter?.draw(timeline);
      if (!plot || !lane.at || !columns || !window) continue;
      // A column more on the left, so that curves begin at the edge.
      const numbers = Array.from({ length: columns[1] - columns[0] + 2 }, (_, i) => columns[0] - 1 + i);
      /** @type {(number | null)[][]} */
      const curves = plot.series.slice(1).map(() => []);
      for (const number of numbers) {
        const column = timeline.known(number);
        const values = column < 0 || gaps.has(number) ? [] : lane.at(shown, timeline, column);
        curves.forEach((curve, k) => curve.push(values[k] ?? null));
      }
      plot.setData([numbers.map((number) => ((number + 0.5) * column_us - window[0]) / 1e6), ...curves]);
      // The grid moves with the window, also where no scale has changed.
      plot.redraw(false, true);
    }
  }

  /** Writes the values at the cursor, or at the time shown. @param {Timeline | null} timeline */
  write(timeline) {
    const shown = this.shown();
    const values = timeline?.values ?? null;
    for (const { lane, heading } of this.all) {
      if (!lane.says) continue;
      const texts = values ? lane.says(shown, values) : [];
      heading.querySelectorAll("output").forEach((output, k) => write(output, texts[k] ?? ""));
    }
    if (!values) return;
    const { sensor } = shown;
    const sums = sumsAt(shown, values);
    const sum = sums.length > 1 ? sums.map((text, k) => `${sensor.sources[k].name} ${text}`).join(", ") : sums[0];
    const more = sensor.kind === "channels" ? "" : ` over ${areaAt(shown, values)}, centre (${sensor.axes.join(", ")}): ${centreAt(shown, values)}`;
    write(part("shown-info", HTMLElement), values.curves[0] ? `${sum}${more}` : "missing");
  }
}
