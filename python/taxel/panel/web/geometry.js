// The geometry of a sensor on the page: how its taxels are drawn, which of them is where, and in which unit its centre is.

import { fitted } from "./dom.js";
import { counted, rounded } from "./words.js";

/** @typedef {import("./messages.js").ArrayInfo} ArrayInfo */
/** @typedef {import("./messages.js").FrameSourceInfo} FrameSourceInfo */
/** @typedef {[number, number]} Taxel column and row */
/** @typedef {[number, number]} Place x and y, in the unit of the array's centre */

/** Room around the outermost places of a sensor, in the distance between neighbours. */
const MARGIN = 0.75;
/** Size of a place's dot in the distance between neighbours. */
const DOT = 0.62;
/** The corners of a cell around its middle. @type {readonly Place[]} */
const CELL = [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]];

/** What all sensors have: rows, columns, and the sources that stand side by side. */
class Sensor {
  /** @param {ArrayInfo} array @param {FrameSourceInfo[]} sources */
  constructor(array, sources) {
    this.array = array;
    this.sources = sources;
    this.rows = array.rows;
    this.columns = array.columns;
    this.exists = array.exists;
    const all = Array.from({ length: this.rows * this.columns }, (_, k) => /** @type {Taxel} */ ([k % this.columns, Math.floor(k / this.columns)]));
    /** Those that exist, row by row. */
    this.taxelsThatExist = all.filter((taxel) => this.has(...taxel));
  }

  /** @param {number} x @param {number} y @returns {boolean} */
  has(x, y) {
    return x >= 0 && y >= 0 && x < this.columns && y < this.rows && (!this.exists || this.exists[y * this.columns + x] === "1");
  }

  /** @param {number} x @returns {FrameSourceInfo | undefined} the source that a column is of, where there are several */
  source(x) {
    return this.sources.length < 2 ? undefined : this.sources.find(({ left, columns }) => x >= left && x < left + columns);
  }

  /** @param {Taxel} taxel @returns {string} its name: source, and what it is called, or else where it is within that */
  named([x, y]) {
    const source = this.source(x);
    const called = this.array.names?.[y * this.columns + x] || this.numbered([x - (source?.left ?? 0), y]);
    return `${source ? `${source.name}, ` : ""}${called}`;
  }

  /** @param {Taxel} taxel within its source @returns {string} row and column */
  numbered([x, y]) {
    return `row ${y}, column ${x}`;
  }

  /**
   * @param {Taxel} from @param {Taxel} by columns and rows
   * @returns {Taxel} the taxel as far away, or the nearest one beyond places without a taxel; where there is none, the one it is from
   */
  moved([x, y], [dx, dy]) {
    const within = (/** @type {number} */ at, /** @type {number} */ count) => Math.max(0, Math.min(count - 1, at));
    let [column, row] = [within(x + dx, this.columns), within(y + dy, this.rows)];
    const [stepX, stepY] = [Math.sign(dx), Math.sign(dy)];
    while (column >= 0 && row >= 0 && column < this.columns && row < this.rows) {
      if (this.has(column, row)) return [column, row];
      [column, row] = [column + stepX, row + stepY];
    }
    return [x, y];
  }

  /** @returns {Taxel} where a crosshair begins */
  get middle() {
    const middle = /** @type {Taxel} */ ([this.columns >> 1, this.rows >> 1]);
    return this.has(...middle) ? middle : this.moved([0, middle[1]], [1, 0]);
  }

  /** @returns {number | null} area of each taxel, mm2; null where it is not known, or not the same for all */
  get taxel_mm2() {
    const { pitch_mm, places } = this.array;
    if (pitch_mm) return typeof pitch_mm === "number" ? pitch_mm ** 2 : pitch_mm[0] * pitch_mm[1];
    const areas = (places?.unit === "mm" && places.area?.filter((_, taxel) => this.has(taxel % this.columns, Math.floor(taxel / this.columns)))) || [];
    return areas.length && areas.every((area) => area === areas[0]) ? areas[0] : null;
  }

  /** @param {number} count @returns {string} an area, in taxels; in mm2, too, where that of a taxel is known */
  area(count) {
    const { taxel_mm2 } = this;
    return counted(count, "taxel") + (taxel_mm2 === null ? "" : ` (${rounded(count * taxel_mm2)} mm²)`);
  }
}

/** Taxels in rows and columns: one pixel each. */
class Grid extends Sensor {
  kind = /** @type {"grid" | "channels"} */ ("grid");
  axes = /** @type {[string, string]} */ (["column", "row"]);

  /** @param {ArrayInfo} array @param {FrameSourceInfo[]} sources */
  constructor(array, sources) {
    super(array, sources);
    /** @type {[number, number]} */
    this.limits = [0, Math.max(this.rows, ...(sources.length ? sources : [this]).map(({ columns }) => columns))];
    const { pitch_mm } = array;
    this.mm = typeof pitch_mm === "number" ? [pitch_mm, pitch_mm] : pitch_mm;
    const ratio = this.mm ? this.mm[1] / this.mm[0] : 1;
    // A sensor much longer than wide stays within the page, and one of few rows can be pointed at: its taxels are no squares then.
    this.aspect = Math.max(1 / 3, Math.min(8, (ratio * this.columns) / Math.max(1, this.rows)));
    this.image = new ImageData(this.columns, this.rows);
    this.pixels = new Uint32Array(this.image.data.buffer);
  }

  /** @param {Taxel} taxel @returns {[number, number]} where it is, in shares of width and height */
  place([x, y]) {
    return [(x + 0.5) / this.columns, (y + 0.5) / this.rows];
  }

  /** @param {number} across @param {number} down shares of width and height @returns {Taxel} */
  at(across, down) {
    const index = (/** @type {number} */ share, /** @type {number} */ count) => Math.max(0, Math.min(count - 1, Math.floor(share * count)));
    return [index(across, this.columns), index(down, this.rows)];
  }

  /** @param {Place} place @returns {[number, number]} where it is seen, in shares of width and height */
  seen([x, y]) {
    const [across, down] = this.step;
    return this.place([x / across, y / down]);
  }

  /** @param {number} across @param {number} down shares of width and height @returns {Place} */
  where(across, down) {
    return [(across * this.columns - 0.5) * this.step[0], (down * this.rows - 0.5) * this.step[1]];
  }

  /** @returns {Place} from a taxel to the next one */
  get step() {
    return this.mm ? [this.mm[1], this.mm[0]] : [1, 1];
  }

  /** @param {Taxel} taxel @returns {Place[]} the corners of its cell */
  cell([x, y]) {
    return CELL.map(([a, b]) => [(x + a) * this.step[0], (y + b) * this.step[1]]);
  }

  /** @param {number} x @param {number} y @returns {string} a centre, in columns and rows; in mm, too, where the pitch is known */
  centre(x, y) {
    return `${x.toFixed(1)}, ${y.toFixed(1)}${this.mm ? ` (${rounded(x * this.mm[1])}, ${rounded(y * this.mm[0])} mm)` : ""}`;
  }

  /** @param {number} k @param {number} x @returns {number} a column, counted from the first one of source k */
  across(k, x) {
    return x - (this.sources[k]?.left ?? 0);
  }

  /** @param {number} k @param {[number, number]} at @returns {string} a centre within source k, in `unit` */
  within(k, [x, y]) {
    const column = this.across(k, x);
    return this.mm ? `x ${rounded(column * this.mm[1])}, y ${rounded(y * this.mm[0])}` : `column ${column.toFixed(1)}, row ${y.toFixed(1)}`;
  }

  /** @returns {string} the unit of a centre within a source, behind it */
  get unit() {
    return this.mm ? " mm" : "";
  }

  /** @param {HTMLCanvasElement} canvas @param {CanvasRenderingContext2D} context @param {Uint32Array} words colours by taxel a pixel */
  paint(canvas, context, words) {
    const { rows, columns, pixels } = this;
    if (canvas.width !== columns || canvas.height !== rows) [canvas.width, canvas.height] = [columns, rows];
    pixels.set(words);
    context.putImageData(this.image, 0, 0);
  }
}

/** A pixel's word as a colour. @param {number} word @returns {string} */
const css = (word) => `rgb(${word & 255} ${(word >> 8) & 255} ${(word >> 16) & 255})`;

/** Taxels at places: a dot each, or a cell of its area. */
class Placed extends Sensor {
  kind = /** @type {const} */ ("places");
  axes = /** @type {[string, string]} */ (["x", "y"]);

  /** @param {ArrayInfo} array @param {FrameSourceInfo[]} sources @param {import("./messages.js").TaxelPlaces} places */
  constructor(array, sources, places) {
    super(array, sources);
    this.places = places;
    this.taxels = places.x.map((_, taxel) => taxel).filter((taxel) => this.has(taxel % this.columns, Math.floor(taxel / this.columns)));
    const [xs, ys] = [places.x, places.y].map((all) => this.taxels.map((taxel) => all[taxel]));
    const near = this.taxels.map((_, i) => Math.min(...this.taxels.map((_, k) => (k === i ? Infinity : Math.hypot(xs[k] - xs[i], ys[k] - ys[i])))));
    const finite = near.filter((distance) => distance > 0 && distance < Infinity).sort((a, b) => a - b);
    /** Distance between neighbours. */
    this.near = finite[finite.length >> 1] ?? 1;
    const { near: unit } = this;
    const [left, right, top, bottom] = [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)];
    this.from = [left - MARGIN * unit, top - MARGIN * unit];
    this.extent = [right - left + 2 * MARGIN * unit, bottom - top + 2 * MARGIN * unit];
    this.aspect = Math.max(1 / 3, Math.min(8, this.extent[0] / this.extent[1]));
    /** @type {[number, number]} */
    this.limits = [Math.min(left, top), Math.max(right, bottom)];
  }

  /** @returns {number} how much of the frame's height, and of its width, a unit takes: the same on the screen */
  scaled() {
    return Math.min(1 / this.extent[0], 1 / this.aspect / this.extent[1]);
  }

  /** @param {Taxel} taxel @returns {[number, number]} */
  place([x, y]) {
    const taxel = y * this.columns + x;
    return this.seen([this.places.x[taxel], this.places.y[taxel]]);
  }

  /** @param {Place} place @returns {[number, number]} where it is seen, in shares of width and height */
  seen([x, y]) {
    const scale = this.scaled();
    return [0.5 + (x - this.from[0] - this.extent[0] / 2) * scale, 0.5 + (y - this.from[1] - this.extent[1] / 2) * scale * this.aspect];
  }

  /** @param {number} across @param {number} down shares of width and height @returns {Place} */
  where(across, down) {
    const scale = this.scaled();
    return [(across - 0.5) / scale + this.from[0] + this.extent[0] / 2, (down - 0.5) / scale / this.aspect + this.from[1] + this.extent[1] / 2];
  }

  /** @returns {Place} a tenth of the way from a taxel to the next one */
  get step() {
    return [this.near / 10, this.near / 10];
  }

  /** @param {Taxel} taxel @returns {Place[]} the corners of the dot's square */
  cell([x, y]) {
    const [a, b] = [this.places.x[y * this.columns + x], this.places.y[y * this.columns + x]];
    return CELL.map(([across, down]) => [a + across * this.near, b + down * this.near]);
  }

  /** @param {number} across @param {number} down @returns {Taxel} the nearest one */
  at(across, down) {
    let [least, nearest] = [Infinity, 0];
    for (const taxel of this.taxels) {
      const [x, y] = this.seen([this.places.x[taxel], this.places.y[taxel]]);
      const distance = Math.hypot((x - across) * this.aspect, y - down);
      if (distance < least) [least, nearest] = [distance, taxel];
    }
    return [nearest % this.columns, Math.floor(nearest / this.columns)];
  }

  /** @param {number} x @param {number} y @returns {string} a centre, in the unit of the places */
  centre(x, y) {
    return `${this.within(0, [x, y])}${this.unit}`;
  }

  /** @param {number} _ @param {number} x @returns {number} x as it is: the places of all sources are in one system */
  across(_, x) {
    return x;
  }

  /** @param {number} _ @param {[number, number]} at @returns {string} a centre, in `unit` */
  within(_, at) {
    // Coordinates are in steps of the extent.
    const [x, y] = at.map((coordinate) => rounded(Math.abs(coordinate) < this.near / 100 ? 0 : coordinate));
    return `x ${x}, y ${y}`;
  }

  /** @returns {string} */
  get unit() {
    return this.places.unit ? ` ${this.places.unit}` : ", units of the file";
  }

  /** @param {HTMLCanvasElement} canvas @param {CanvasRenderingContext2D} context @param {Uint32Array} words colours by taxel a pixel */
  paint(canvas, context, words) {
    const { width, height, ratio } = fitted(canvas);
    const { near, places } = this;
    const unit = this.scaled() * width;
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, width, height);
    for (const taxel of this.taxels) {
      const [across, down] = this.seen([places.x[taxel], places.y[taxel]]);
      const [x, y] = [across * width, down * height];
      const side = unit * (places.area ? Math.sqrt(places.area[taxel]) : DOT * near);
      context.fillStyle = css(words[taxel]);
      context.beginPath();
      if (places.area) context.roundRect(x - side / 2, y - side / 2, side, side, side / 8);
      else context.arc(x, y, side / 2, 0, 2 * Math.PI);
      context.fill();
    }
  }
}

/** Channels: neither pitch nor places, so that they have no centre and no area, only a cell each. */
class Channels extends Grid {
  kind = /** @type {"grid" | "channels"} */ ("channels");

  /** @param {Taxel} taxel within its source @returns {string} its number */
  numbered([x, y]) {
    return `channel ${Math.max(x, y)}`;
  }

  /** @returns {string} */
  centre() {
    return "";
  }
}

/** @typedef {Grid | Placed | Channels} Geometry */

/**
 * The geometry of a sensor.
 * @param {ArrayInfo} array
 * @param {FrameSourceInfo[]} sources that stand side by side in it
 * @returns {Geometry}
 */
export function geometry(array, sources) {
  if (array.places) return new Placed(array, sources, array.places);
  return array.pitch_mm === null && Math.min(array.rows, array.columns) === 1 ? new Channels(array, sources) : new Grid(array, sources);
}
