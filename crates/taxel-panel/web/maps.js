// Two maps side by side: pressure above rest, and change. One pixel a taxel.

import { MAPS, UNKNOWN, changeWords, pressureWords, word } from "./colours.js";
import { ground, make, part, write } from "./dom.js";
import { UNKNOWN_VALUE } from "./protocol.js";
import { counted, rounded } from "./words.js";

/** @typedef {import("./protocol.js").Picture} Picture */
/** @typedef {import("./protocol.js").Health} Health */
/** @typedef {import("./protocol.js").Zeroing} Zeroing */
/** @typedef {import("./settings.js").Settings} Settings */

/** How long the largest value holds the scale, ms. */
const HOLD_MS = 10_000;

/** The largest value lately: it holds for ten seconds, so that colours stay comparable. */
class Scale {
  /** @param {number} least of the scale, ticks */
  constructor(least) {
    this.least = least;
    this.top = least;
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
    this.frame = part(`${name}-frame`, HTMLElement);
    this.bar = part(`${name}-bar`, HTMLCanvasElement);
    this.lines = part(`${name}-cross`, HTMLElement);
    this.marks = part(`${name}-marks`, HTMLElement);
    this.context = ground(this.canvas);
    this.image = new ImageData(1, 1);
    this.pixels = new Uint32Array(this.image.data.buffer);
  }

  /** @param {number} rows @param {number} columns @param {number} aspect */
  size(rows, columns, aspect) {
    [this.canvas.width, this.canvas.height] = [columns, rows];
    this.frame.style.aspectRatio = String(aspect);
    part("maps", HTMLElement).style.setProperty("--aspect", String(aspect));
    this.image = new ImageData(columns, rows);
    this.pixels = new Uint32Array(this.image.data.buffer);
  }

  show() {
    this.context.putImageData(this.image, 0, 0);
  }

  /** @param {Uint32Array} words */
  showBar(words) {
    [this.bar.width, this.bar.height] = [256, 1];
    const image = new ImageData(256, 1);
    new Uint32Array(image.data.buffer).set(words);
    ground(this.bar).putImageData(image, 0, 0);
  }
}

/** What the page says of the rest. */
const REST_FROM = {
  given: "above the given rest",
  quiet: "above the rest of a quiet stretch",
  none: "rest not known yet: above the first values",
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
    this.rows = 0;
    this.columns = 0;
    /** @type {string | null} */
    this.exists = null;
    this.floor = 0;
    /** @type {[number, number] | null} */
    this.taxel = null;
    /** @type {Health | null} */
    this.health = null;
    /** Unit of the values, size of a tick in it, and ticks of the value 0; `pictures` have no events. */
    this.values = { unit: "ticks", step: 1, zero: 0, pictures: false };
    /** Taxels whose rest a person set. @type {Zeroing[]} */
    this.zeroed = [];
    /** @type {Picture | null} */
    this.picture = null;
    /** @type {Uint16Array} */
    this.rest = new Uint16Array(0);
    this.pressureScale = new Scale(20);
    this.changeScale = new Scale(10);
    /** @type {{ pressure: Uint32Array, change: Uint32Array }} */
    this.words = { pressure: new Uint32Array(256), change: new Uint32Array(256) };
    /** Of the last picture drawn. */
    this.info = { unknown: 0, value: /** @type {number | null} */ (null), rest: /** @type {number | null} */ (null) };
    this.colour();
    for (const map of [this.pressure, this.change]) {
      map.frame.addEventListener("pointerdown", (event) => this.point(this.at(map, event)));
      map.frame.addEventListener("pointermove", (event) => {
        if (event.buttons & 1) this.point(this.at(map, event));
      });
      map.frame.addEventListener("dblclick", () => this.point(null));
      map.frame.addEventListener("keydown", (event) => this.key(event));
    }
  }

  /**
   * @param {number} rows
   * @param {number} columns
   * @param {string | null} exists
   */
  size(rows, columns, exists) {
    this.exists = exists;
    if (rows === this.rows && columns === this.columns) return;
    [this.rows, this.columns] = [rows, columns];
    for (const map of [this.pressure, this.change]) map.size(rows, columns, this.aspect);
    this.rest = new Uint16Array(rows * columns).fill(UNKNOWN_VALUE);
    this.picture = null;
    this.health = null;
    if (this.taxel && (this.taxel[0] >= columns || this.taxel[1] >= rows)) this.point(null);
    this.mark();
  }

  /** Makes the colours again, after the theme or a setting has changed. */
  colour() {
    const { values, theme } = this.settings;
    const name = MAPS.includes(values.map) ? values.map : MAPS[0];
    this.words = { pressure: pressureWords(name, theme, values.gamma), change: changeWords(theme, values.gamma) };
    this.pressure.showBar(this.words.pressure);
    this.change.showBar(this.words.change);
    this.mark();
  }

  /** @param {Picture} picture */
  take(picture) {
    this.picture = picture;
    if (picture.rest) this.rest = picture.rest;
  }

  /**
   * Draws the last picture.
   * @param {number} now_ms
   */
  draw(now_ms) {
    const { picture, rows, columns, rest, exists, floor } = this;
    const { flipX, flipY, contrast } = this.settings.values;
    if (!picture?.pressure || picture.rows !== rows || picture.columns !== columns) return;
    const { pressure, change } = picture;
    let most = 0;
    let moved = 0;
    for (let i = 0; i < pressure.length; i++) {
      if (pressure[i] !== UNKNOWN_VALUE && rest[i] !== UNKNOWN_VALUE) most = Math.max(most, pressure[i] - rest[i]);
      if (change) moved = Math.max(moved, Math.abs(change[i]));
    }
    const scale = this.pressureScale.held(most, now_ms);
    const changes = this.changeScale.held(moved, now_ms);
    const ground = UNKNOWN[this.settings.theme].map(word);
    const [onPressure, onChange] = [this.pressure.pixels, this.change.pixels];
    const { pressure: pressureWord, change: changeWord } = this.words;
    let unknown = 0;
    for (let y = 0; y < rows; y++) {
      for (let x = 0; x < columns; x++) {
        const from = y * columns + x;
        const to = (flipY ? rows - 1 - y : y) * columns + (flipX ? columns - 1 - x : x);
        if (exists && exists[from] !== "1") {
          onPressure[to] = onChange[to] = 0;
          continue;
        }
        if (pressure[from] === UNKNOWN_VALUE) {
          unknown++;
          onPressure[to] = ground[(x + y) & 1];
        } else {
          const above = rest[from] === UNKNOWN_VALUE ? 0 : pressure[from] - rest[from];
          onPressure[to] = pressureWord[above > floor ? Math.min(255, Math.round((255 * contrast * above) / scale)) : 0];
        }
        const moves = change ? Math.max(-127, Math.min(127, (127 * contrast * change[from]) / changes)) : 0;
        onChange[to] = changeWord[128 + Math.round(moves)];
      }
    }
    this.pressure.show();
    this.change.show();
    this.info.unknown = unknown;
    const watched = this.taxel ? this.taxel[1] * columns + this.taxel[0] : -1;
    const value = watched < 0 ? UNKNOWN_VALUE : pressure[watched];
    this.info.value = value === UNKNOWN_VALUE ? null : value;
    this.info.rest = watched < 0 || rest[watched] === UNKNOWN_VALUE ? null : rest[watched];
  }

  /** Writes the numbers beside the colours. */
  write() {
    const { contrast } = this.settings.values;
    const [scale, changes] = [this.pressureScale.top / contrast, this.changeScale.top / contrast];
    const { unit, step, zero, pictures } = this.values;
    write(part("pressure-half", HTMLElement), rounded((scale * step) / 2));
    write(part("pressure-top", HTMLElement), `${rounded(scale * step)} ${unit}`);
    write(part("change-least", HTMLElement), `−${Math.round(changes)}`);
    write(part("change-top", HTMLElement), `+${Math.round(changes)} ticks`);
    write(part("rest-from", HTMLElement), this.picture ? REST_FROM[this.picture.restFrom] : "");
    const { unknown } = this.info;
    part("unknown", HTMLElement).hidden = unknown === 0;
    write(part("unknown-count", HTMLElement), pictures ? counted(unknown, "missing value") : counted(unknown, "taxel without events", "taxels without events"));
    write(part("taxel-name", HTMLElement), this.named());
    const { value, rest } = this.info;
    const above = value === null || rest === null || pictures ? "" : `, ${Math.max(0, value - rest)} above rest`;
    const zeroed = this.zeroed.some(({ taxel: [x, y] }) => x === this.taxel?.[0] && y === this.taxel?.[1]) ? ", zeroed" : "";
    write(part("taxel-value", HTMLElement), !this.taxel ? "" : value === null ? (pictures ? "missing" : "no event yet") : `${rounded((value - zero) * step)} ${unit}${above}${zeroed}`);
  }

  /** @returns {string} row, column and traces of the taxel under the crosshair */
  named() {
    if (!this.taxel) return "none: click a map, or use its arrow keys";
    const [x, y] = this.taxel;
    return `row ${y}, column ${x} · sense line ${y}, driven line ${x}`;
  }

  /**
   * @param {Map2D} map
   * @param {PointerEvent} event
   * @returns {[number, number]}
   */
  at(map, event) {
    const box = map.canvas.getBoundingClientRect();
    const share = (/** @type {number} */ at, /** @type {number} */ of, /** @type {number} */ count) =>
      Math.max(0, Math.min(count - 1, Math.floor((at / of) * count)));
    const x = share(event.clientX - box.left, box.width, this.columns);
    const y = share(event.clientY - box.top, box.height, this.rows);
    const { flipX, flipY } = this.settings.values;
    return [flipX ? this.columns - 1 - x : x, flipY ? this.rows - 1 - y : y];
  }

  /** @param {KeyboardEvent} event */
  key(event) {
    if (event.ctrlKey || event.altKey || event.metaKey || !this.columns) return;
    const { flipX, flipY } = this.settings.values;
    const far = event.shiftKey ? 8 : 1;
    /** @type {Record<string, [number, number]>} */
    const moves = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
    const move = moves[event.key];
    if (event.key === "Escape" && this.taxel) this.point(null);
    else if (move) {
      const [x, y] = this.taxel ?? [this.columns >> 1, this.rows >> 1];
      const held = (/** @type {number} */ at, /** @type {number} */ count) => Math.max(0, Math.min(count - 1, at));
      const [dx, dy] = [move[0] * far * (flipX ? -1 : 1), move[1] * far * (flipY ? -1 : 1)];
      this.point(this.taxel ? [held(x + dx, this.columns), held(y + dy, this.rows)] : [x, y]);
    } else return;
    event.preventDefault();
    event.stopPropagation();
  }

  /**
   * @returns {number} width over height of a map on the page; a sensor much longer than wide stays within it, and one of few rows
   *   can be pointed at: its taxels are no squares then
   */
  get aspect() {
    return Math.max(1 / 3, Math.min(8, this.columns / Math.max(1, this.rows)));
  }

  /** @param {[number, number] | null} taxel */
  point(taxel) {
    if (this.taxel === taxel || (taxel && this.taxel && taxel[0] === this.taxel[0] && taxel[1] === this.taxel[1])) return;
    this.taxel = taxel;
    this.watched(taxel);
    this.mark();
    write(part("taxel-info", HTMLElement), taxel ? this.named() : "no taxel watched");
  }

  /** Puts crosshair and marks where they belong. */
  mark() {
    const { flipX, flipY } = this.settings.values;
    const place = (/** @type {[number, number]} */ [x, y]) => [
      ((flipX ? this.columns - 1 - x : x) + 0.5) / this.columns,
      ((flipY ? this.rows - 1 - y : y) + 0.5) / this.rows,
    ];
    for (const map of [this.pressure, this.change]) {
      map.lines.hidden = !this.taxel;
      if (this.taxel) {
        const [left, top] = place(this.taxel);
        map.lines.style.setProperty("--x", `${100 * left}%`);
        map.lines.style.setProperty("--y", `${100 * top}%`);
      }
      map.marks.replaceChildren();
      const put = (/** @type {[number, number]} */ taxel, /** @type {string} */ kind, more = "") => {
        const mark = make("span", { class: `unwell ${kind}`, title: `${kind}: row ${taxel[1]}, column ${taxel[0]}${more}` });
        const [left, top] = place(taxel);
        // On the edge it is whole, too.
        mark.style.left = `clamp(6px, ${100 * left}%, 100% - 6px)`;
        mark.style.top = `clamp(6px, ${100 * top}%, 100% - 6px)`;
        map.marks.append(mark);
      };
      for (const kind of /** @type {const} */ (["dead", "stuck", "noisy"])) for (const taxel of this.health?.[kind] ?? []) put(taxel, kind);
      for (const { taxel, rest } of this.zeroed) put(taxel, "zeroed", `, rests at ${rest} ticks`);
    }
  }
}
