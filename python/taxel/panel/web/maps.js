// Two maps side by side: pressure above rest, and change; of channels, which have no map, a cell each.

import { UNKNOWN, changeWords, pressureWords, word } from "./colours.js";
import { entitle, ground, make, part, write } from "./dom.js";
import { geometry } from "./geometry.js";
import { UNKNOWN_VALUE } from "./protocol.js";
import { counted, quantity, rounded } from "./words.js";

/** @typedef {import("./protocol.js").Frame} Frame */
/** @typedef {import("./geometry.js").Geometry} Geometry */
/** @typedef {import("./messages.js").Health} Health */
/** @typedef {import("./messages.js").FrameSourceInfo} FrameSourceInfo */
/** @typedef {import("./messages.js").Zeroing} Zeroing */
/** @typedef {import("./settings.js").Settings} Settings */

/** How long the largest value holds the scale, ms. */
const HOLD_MS = 10_000;
/** Up to so many zeroed taxels are marked: marks of more, as "Zero all" makes them, would hide the map. */
const MOST_ZEROED = 64;

/** The largest value lately: it holds for ten seconds, so that colours stay comparable. */
class Scale {
  /** @param {number} least of the scale, ticks */
  constructor(least) {
    this.least = least;
    this.top = least;
    this.since = -Infinity;
  }

  /** Another sensor or recording is shown. */
  forget() {
    this.top = this.least;
    this.since = -Infinity;
  }

  /** @param {number} largest @param {number} now_ms @returns {number} */
  held(largest, now_ms) {
    if (largest >= this.top || now_ms - this.since > HOLD_MS) {
      this.top = Math.max(largest, this.least);
      this.since = now_ms;
    }
    return this.top;
  }
}

/** One map on its canvas: draws values, and turns the pointer's place into a taxel. */
class Map2D {
  /** @param {string} name of its parts in the page */
  constructor(name) {
    this.canvas = part(`${name}-map`, HTMLCanvasElement);
    this.element = part(`${name}-frame`, HTMLElement);
    this.bar = part(`${name}-bar`, HTMLCanvasElement);
    this.lines = part(`${name}-cross`, HTMLElement);
    this.marks = part(`${name}-marks`, HTMLElement);
    this.sources = part(`${name}-sources`, HTMLElement);
    this.context = ground(this.canvas);
    /** Colour of each taxel. */
    this.words = new Uint32Array(0);
  }

  /** @param {Geometry} sensor */
  size(sensor) {
    this.element.style.aspectRatio = String(sensor.aspect);
    this.element.dataset.kind = sensor.kind;
    part("maps", HTMLElement).style.setProperty("--aspect", String(sensor.aspect));
    this.words = new Uint32Array(sensor.rows * sensor.columns);
  }

  /** @param {Uint32Array} words */
  showBar(words) {
    [this.bar.width, this.bar.height] = [256, 1];
    const image = new ImageData(256, 1);
    new Uint32Array(image.data.buffer).set(words);
    ground(this.bar).putImageData(image, 0, 0);
  }
}

/** What the page says of the rest: of events, and of frames, which are in a unit of force or pressure where it is given. */
const REST_FROM = {
  given: "above the given rest",
  quiet: "above the rest of a quiet stretch",
  none: "rest not known yet: above the first values",
};
const REST_OF_FRAMES = {
  given: "above 0",
  quiet: "above the rest of a quiet stretch",
  none: "rest not known: values as they are, negative ones above their least",
};

/** The maps, their colours, the crosshair and the marks of unwell taxels. */
export class Maps {
  /**
   * @param {Settings} settings
   * @param {(taxel: [number, number] | null) => void} watched called when a person points at a taxel, or at none any more
   */
  constructor(settings, watched) {
    this.settings = settings;
    this.watched = watched;
    this.pressure = new Map2D("pressure");
    this.change = new Map2D("change");
    this.geometry = geometry({ rows: 1, columns: 1, pitch_mm: null, name: "", exists: null }, []);
    this.made = "";
    this.floor = 0;
    /** @type {[number, number] | null} */
    this.taxel = null;
    /** @type {Pick<Health, "dead" | "stuck" | "noisy"> | null} */
    this.health = null;
    /** Unit of the values, size of a tick in it, and ticks of the value 0; `frames` have no events. */
    this.values = { unit: "ticks", step: 1, zero: 0, frames: false, isBoard: true };
    /** The sources that stand side by side, of frames. @type {FrameSourceInfo[]} */
    this.sources = [];
    /** Taxels whose rest a person set. @type {Zeroing[]} */
    this.zeroed = [];
    /** @type {Frame | null} */
    this.frame = null;
    /** A picture of a time in place of what is now: ticks above rest, and what it is of. @type {{ values: Float32Array, words: string } | null} */
    this.picture = null;
    this.pressureScale = new Scale(20);
    /** Ticks of the full colour. */
    this.top = this.pressureScale.top;
    this.changeScale = new Scale(10);
    /** @type {{ pressure: Uint32Array, change: Uint32Array }} */
    this.words = { pressure: new Uint32Array(256), change: new Uint32Array(256) };
    /** What the last drawn frame says. */
    this.info = { unknown: 0, value: /** @type {number | null} */ (null), rest: /** @type {number | null} */ (null) };
    this.colour();
    for (const map of [this.pressure, this.change]) {
      map.element.addEventListener("pointerdown", (event) => this.point(this.at(map, event)));
      map.element.addEventListener("pointermove", (event) => {
        if (event.buttons & 1) this.point(this.at(map, event));
      });
      map.element.addEventListener("dblclick", () => this.point(null));
      map.element.addEventListener("keydown", (event) => this.key(event));
    }
  }

  /** Another recording is shown: scales of colours and crosshair are as when the page is opened. */
  forget() {
    this.pressureScale.forget();
    this.changeScale.forget();
    this.point(null);
  }

  /** @param {import("./messages.js").ArrayInfo} array @param {FrameSourceInfo[]} sources that stand side by side in it */
  size(array, sources) {
    const made = JSON.stringify([array, sources]);
    if (made === this.made) return;
    this.made = made;
    const { rows, columns } = this;
    this.geometry = geometry(array, sources);
    this.sources = sources;
    for (const map of [this.pressure, this.change]) map.size(this.geometry);
    this.name();
    if (rows !== this.rows || columns !== this.columns) {
      this.frame = null;
    }
    this.health = null;
    if (!this.taxel || !this.geometry.has(...this.taxel)) this.point(null);
    this.mark();
  }

  /** Heads the map with the quantity that its unit has. */
  name() {
    const title = this.geometry.kind === "channels" ? "Channels" : quantity(this.values.unit);
    write(part("pressure-title", HTMLElement), title);
    write(part("top-unit", HTMLElement), this.values.unit);
    entitle(part("pressure-frame", HTMLElement), "aria-label", `${title}: arrow keys move the crosshair, Escape hides it`);
  }

  get rows() {
    return this.geometry.rows;
  }

  get columns() {
    return this.geometry.columns;
  }

  /** @returns {[number, number][]} the taxels that have a value */
  get known() {
    const { pressure } = this.frame ?? {};
    return this.geometry.taxelsThatExist.filter(([x, y]) => pressure && pressure[y * this.columns + x] !== UNKNOWN_VALUE);
  }

  /** Makes the colours again, after the theme has changed. */
  colour() {
    const { theme } = this.settings;
    this.words = { pressure: pressureWords(theme), change: changeWords(theme) };
    this.pressure.showBar(this.words.pressure);
    this.change.showBar(this.words.change);
    this.mark();
  }

  /**
   * Draws the last frame.
   * @param {number} now_ms
   */
  draw(now_ms) {
    const { frame, rows, columns, floor, picture } = this;
    const { exists } = this.geometry;
    if (!frame?.pressure || !frame.rest || frame.rows !== rows || frame.columns !== columns) return;
    const { pressure, change, rest } = frame;
    const isUnknown = (/** @type {number} */ i) => !picture && pressure[i] === UNKNOWN_VALUE;
    const above = (/** @type {number} */ i) => (picture ? picture.values[i] : rest[i] === UNKNOWN_VALUE ? 0 : pressure[i] - rest[i]);
    let most = 0;
    let moved = 0;
    for (let i = 0; i < pressure.length; i++) {
      if (!isUnknown(i)) most = Math.max(most, above(i));
      if (change) moved = Math.max(moved, Math.abs(change[i]));
    }
    const scale = this.settings.values.top / this.values.step || (picture ? most || 1 : this.pressureScale.held(most, now_ms));
    this.top = scale;
    const changes = this.changeScale.held(moved, now_ms);
    const ground = UNKNOWN[this.settings.theme].map(word);
    const [onPressure, onChange] = [this.pressure.words, this.change.words];
    const { pressure: pressureWord, change: changeWord } = this.words;
    let unknown = 0;
    for (let y = 0; y < rows; y++) {
      for (let x = 0; x < columns; x++) {
        const from = y * columns + x;
        if (exists && exists[from] !== "1") {
          onPressure[from] = onChange[from] = 0;
          continue;
        }
        if (isUnknown(from)) {
          unknown++;
          onPressure[from] = ground[(x + y) & 1];
        } else onPressure[from] = pressureWord[above(from) > floor ? Math.min(255, Math.round((255 * above(from)) / scale)) : 0];
        const moves = change ? Math.max(-127, Math.min(127, (127 * change[from]) / changes)) : 0;
        onChange[from] = changeWord[128 + Math.round(moves)];
      }
    }
    for (const { canvas, context, words } of [this.pressure, this.change]) {
      if (canvas.clientWidth) this.geometry.paint(canvas, context, words);
    }
    this.info.unknown = unknown;
    const watched = this.taxel ? this.taxel[1] * columns + this.taxel[0] : -1;
    this.info.value = watched < 0 || isUnknown(watched) ? null : picture ? above(watched) + this.values.zero : pressure[watched];
    this.info.rest = watched < 0 || picture || rest[watched] === UNKNOWN_VALUE ? null : rest[watched];
  }

  /** Writes the numbers beside the colours. */
  write() {
    const [scale, changes] = [this.top, this.changeScale.top];
    const { unit, step, zero, frames } = this.values;
    write(part("pressure-half", HTMLElement), rounded((scale * step) / 2));
    write(part("pressure-top", HTMLElement), `${rounded(scale * step)} ${unit}`);
    write(part("change-least", HTMLElement), `−${rounded(Math.round(changes) * step)}`);
    write(part("change-top", HTMLElement), `+${rounded(Math.round(changes) * step)} ${unit}`);
    write(part("rest-from", HTMLElement), this.restWords());
    write(part("pressure-above", HTMLElement), this.picture ? this.picture.words : !frames || this.sources.some(({ rest }) => rest === "quiet") ? "above rest" : "");
    const { unknown } = this.info;
    part("unknown", HTMLElement).hidden = unknown === 0;
    write(part("unknown-count", HTMLElement), frames ? counted(unknown, "missing value") : counted(unknown, "taxel without events", "taxels without events"));
    write(part("taxel-name", HTMLElement), this.named());
    const { value, rest } = this.info;
    const above = value === null || rest === null || rest === zero ? "" : `, ${rounded(Math.max(0, value - rest) * step)} above rest`;
    const zeroed = this.zeroed.some(({ taxel: [x, y] }) => x === this.taxel?.[0] && y === this.taxel?.[1]) ? ", zeroed" : "";
    write(part("taxel-value", HTMLElement), !this.taxel ? "" : value === null ? (frames ? "missing" : "no event yet") : `${rounded((value - zero) * step)} ${unit}${above}${zeroed}`);
  }

  /** @returns {string} what the shown values are above, of each source where that differs */
  restWords() {
    if (!this.frame) return "";
    if (!this.values.frames) return REST_FROM[this.frame.restFrom];
    const all = new Set(this.sources.map(({ rest }) => REST_OF_FRAMES[rest]));
    const from = all.size === 1 ? [...all] : this.sources.map(({ name, rest }) => `${name}: ${REST_OF_FRAMES[rest]}`);
    return from.join("; ");
  }

  /** @returns {string} the taxel under the crosshair; of a board its traces, too */
  named() {
    if (!this.taxel) return "none: click a map, or use the arrow keys on a map";
    const [x, y] = this.taxel;
    return this.geometry.named(this.taxel) + (this.values.isBoard ? ` · sense line ${y}, driven line ${x}` : "");
  }

  /**
   * @param {Map2D} map
   * @param {PointerEvent} event
   * @returns {[number, number]}
   */
  at(map, event) {
    const box = map.canvas.getBoundingClientRect();
    return this.geometry.at((event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height);
  }

  /** @param {KeyboardEvent} event */
  key(event) {
    if (event.ctrlKey || event.altKey || event.metaKey || !this.columns) return;
    const far = event.shiftKey ? 8 : 1;
    /** @type {Record<string, [number, number]>} */
    const moves = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
    const move = moves[event.key];
    if (event.key === "Escape" && this.taxel) this.point(null);
    else if (move) {
      this.point(this.taxel ? this.geometry.moved(this.taxel, [move[0] * far, move[1] * far]) : this.geometry.middle);
    } else return;
    event.preventDefault();
    event.stopPropagation();
  }

  /** @param {[number, number] | null} taxel */
  point(taxel) {
    if (this.taxel === taxel || (taxel && this.taxel && taxel[0] === this.taxel[0] && taxel[1] === this.taxel[1])) return;
    this.taxel = taxel;
    this.watched(taxel);
    this.mark();
    write(part("taxel-info", HTMLElement), taxel ? this.named() : "no taxel watched");
  }

  /** The name of a source, over its taxels. @param {FrameSourceInfo} source @returns {HTMLElement} */
  nameOf({ name, left, columns }) {
    const ends = [left, left + columns - 1].map((x) => this.geometry.place([x, 0])[0]);
    const label = make("span", {}, name);
    label.style.left = `${50 * (ends[0] + ends[1])}%`;
    return label;
  }

  /** Puts crosshair and marks where they belong. */
  mark() {
    const place = (/** @type {[number, number]} */ taxel) => this.geometry.place(taxel);
    for (const map of [this.pressure, this.change]) {
      map.lines.hidden = !this.taxel;
      if (this.taxel) {
        const [left, top] = place(this.taxel);
        map.lines.style.setProperty("--x", `${100 * left}%`);
        map.lines.style.setProperty("--y", `${100 * top}%`);
      }
      map.marks.replaceChildren();
      const put = (/** @type {[number, number]} */ taxel, /** @type {string} */ kind, more = "") => {
        const mark = make("span", { class: `unwell ${kind}`, title: `${kind}: ${this.geometry.named(taxel)}${more}` });
        const [left, top] = place(taxel);
        // On the edge it is whole, too.
        mark.style.left = `clamp(6px, ${100 * left}%, 100% - 6px)`;
        mark.style.top = `clamp(6px, ${100 * top}%, 100% - 6px)`;
        map.marks.append(mark);
      };
      for (const kind of /** @type {const} */ (["dead", "stuck", "noisy"])) for (const taxel of this.health?.[kind] ?? []) put(taxel, kind);
      const marked = this.zeroed.length <= MOST_ZEROED && this.zeroed.length < this.geometry.taxelsThatExist.length ? this.zeroed : [];
      for (const { taxel, rest } of marked) put(taxel, "zeroed", `, rests at ${rest} ${this.values.unit}`);
      map.sources.replaceChildren(...(this.sources.length > 1 ? this.sources.map((source) => this.nameOf(source)) : []));
    }
  }
}
