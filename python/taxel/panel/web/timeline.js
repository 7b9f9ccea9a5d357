// What the lanes show, by columns of time; the window of time that is shown, and the one time cursor that every view shares.

import { MISSING, UNKNOWN_VALUE } from "./protocol.js";
import { numbering, seconds, short } from "./words.js";

/** @typedef {import("./protocol.js").Frame} Frame */
/** @typedef {{ share: number, text: string }} Tick */
/** @typedef {{ sum: number, area: number, x: number, y: number } | null} Curve the values at a time; null where no taxel has a value, and a centre that is no number where nothing is pressed */
/** @typedef {{ curves: Curve[], taxel: number | null }} Values of all taxels, then of each of several sources; what the watched taxel holds */
/** @typedef {[number, number]} Extent least and greatest */

/** Columns that are stored; the window shows one less at most, as it need not begin where a column does. */
export const SPAN = 1250;
/** Ticks above rest that fill the room of a channel at least. */
const LEAST_TOP = 8;
/** Steps between the numbers of the axis, of each power of ten. */
const STEPS = [1, 2, 5];

/** What each column of time holds, in a ring by its number; the window that is shown, and the times in it. */
export class Timeline {
  /**
   * @param {number} rows
   * @param {number} column_us
   */
  constructor(rows, column_us) {
    this.rows = rows;
    this.column_us = column_us;
    this.raster = new Uint8Array(SPAN * rows);
    this.history = new Uint16Array(SPAN * 3);
    /** How many channels have a curve each, and their least and greatest ticks above rest, column after column. */
    this.channel_count = 0;
    this.channels = new Uint16Array(0);
    /** How many curves there are, of all taxels and then of each of several sources: eight words each of a column, as in frames. */
    this.curve_count = 1;
    this.sums = new Uint32Array(SPAN * 8);
    this.centres = new Float32Array(this.sums.buffer);
    /** The values at the time shown. @type {Values | null} */
    this.now = null;
    /** The values at the cursor, once they have come, and their time. @type {Values & { t_us: number } | null} */
    this.pointed = null;
    this.number = new Float64Array(SPAN);
    /** The window, us from its left edge to its right one; null before the first frame. @type {[number, number] | null} */
    this.window = null;
    /** Length of the window, us. */
    this.span_us = (SPAN - 1) * column_us;
    /** Whether the window ends at the newest. */
    this.following = false;
    /** The time shown. @type {number | null} */
    this.t_us = null;
    /** Where a person points. @type {number | null} */
    this.cursor_us = null;
    this.number.fill(NaN);
  }

  /** @param {number} number of a column @returns {boolean} whether nothing arrived in it */
  isSilent(number) {
    const column = this.known(number);
    return column >= 0 && !this.raster.subarray(column * this.rows, (column + 1) * this.rows).some(Boolean);
  }

  /**
   * The columns of a live source of frames in which none arrived for longer than this: each frame has a change at least.
   * @param {number} first
   * @param {number} last
   * @param {number} gap_us
   * @returns {Set<number>} their numbers
   */
  gaps(first, last, gap_us) {
    const found = new Set();
    for (let from = first; from <= last; from++) {
      let to = from;
      while (to <= last && this.isSilent(to)) to++;
      // A gap that goes on beyond the edge is as long as what is seen of it.
      if ((to - from) * this.column_us > gap_us) for (let number = from; number < to; number++) found.add(number);
      from = to;
    }
    return found;
  }

  /** @param {number} number @returns {number} its column in the ring */
  columnOf(number) {
    return ((number % SPAN) + SPAN) % SPAN;
  }

  /** @param {number} number @returns {number} its column, or -1 where it is not known */
  known(number) {
    const column = this.columnOf(number);
    return this.number[column] === number ? column : -1;
  }

  /** @param {[number, number]} window us */
  show(window) {
    this.window = window;
    this.span_us = window[1] - window[0];
  }

  /**
   * Stores the columns of a frame. The window moves only while it follows the newest.
   * @param {Frame} frame
   */
  put(frame) {
    if (frame.restart || frame.column_us !== this.column_us) {
      this.number.fill(NaN);
      this.pointed = null;
    }
    this.column_us = frame.column_us;
    this.t_us = frame.t_us;
    this.following = frame.following;
    if (frame.t_us === null) return;
    if (frame.following || !this.window) {
      const end = (Math.floor(frame.t_us / this.column_us) + 1) * this.column_us;
      this.window = [end - this.span_us, end];
    }
    const { first, count, raster, sums, history, channels, sources, now, nowCentres } = frame;
    const each = channels && count ? channels.length / count / 2 : this.channel_count;
    if (each !== this.channel_count) [this.channel_count, this.channels] = [each, new Uint16Array(SPAN * each * 2)];
    const several = now ? now.length / 4 : this.curve_count;
    if (several !== this.curve_count) {
      [this.curve_count, this.sums] = [several, new Uint32Array(SPAN * several * 8)];
      this.centres = new Float32Array(this.sums.buffer);
    }
    if (now && nowCentres) {
      const curves = Array.from({ length: several }, (_, k) =>
        now[4 * k + 1] === MISSING ? null : { sum: now[4 * k], area: now[4 * k + 1], x: nowCentres[4 * k + 2], y: nowCentres[4 * k + 3] });
      const held = frame.watched === null ? UNKNOWN_VALUE : (frame.pressure?.[frame.watched] ?? UNKNOWN_VALUE);
      this.now = { curves, taxel: held === UNKNOWN_VALUE ? null : held };
    }
    for (let i = 0; i < count; i++) {
      const column = this.columnOf(first + i);
      this.number[column] = first + i;
      if (raster) this.raster.set(raster.subarray(i * this.rows, (i + 1) * this.rows), column * this.rows);
      if (sums) this.sums.set(sums.subarray(8 * i, 8 * i + 8), 8 * column * several);
      if (sources) this.sums.set(sources.subarray(8 * i * (several - 1), 8 * (i + 1) * (several - 1)), 8 * (column * several + 1));
      if (channels) this.channels.set(channels.subarray(2 * i * each, 2 * (i + 1) * each), 2 * column * each);
      if (history) this.history.set(history.subarray(3 * i, 3 * i + 3), 3 * column);
      else this.history.fill(UNKNOWN_VALUE, 3 * column, 3 * column + 3);
    }
  }

  /** @returns {number} ticks above rest that the greatest channel reaches in the window, eight at least */
  channelTop() {
    const [first, last] = this.columns ?? [0, -1];
    const width = 2 * this.channel_count;
    let top = LEAST_TOP;
    for (let number = width ? first - 1 : last + 1; number <= last; number++) {
      const column = this.known(number);
      if (column >= 0) for (let at = column * width + 1; at < (column + 1) * width; at += 2) top = Math.max(top, this.channels[at]);
    }
    return top;
  }

  /** @returns {number} how many sources have curves of their own; 0: one for all */
  get source_count() {
    return this.curve_count - 1;
  }

  /** @returns {number[]} the numbers of the curves that are drawn: of each of several sources, or of all */
  get drawn() {
    return Array.from({ length: Math.max(1, this.source_count) }, (_, k) => k + (this.source_count ? 1 : 0));
  }

  /** @param {number} column @param {number} curve its number @returns {Extent | null} the sum; null where no taxel has a value */
  sumIn(column, curve) {
    return this.extent(this.sums, column, curve, 0);
  }

  /** @param {number} column @returns {Extent | null} the number of taxels that are pressed */
  areaIn(column) {
    return this.extent(this.sums, column, 0, 2);
  }

  /** @param {number} column @param {number} curve its number @returns {[Extent | null, Extent | null]} x and y of the centre; null where nothing is pressed */
  centreIn(column, curve) {
    return [this.extent(this.centres, column, curve, 4), this.extent(this.centres, column, curve, 6)];
  }

  /** @param {Uint32Array | Float32Array} words @param {number} column @param {number} curve @param {number} word @returns {Extent | null} */
  extent(words, column, curve, word) {
    const at = 8 * (column * this.curve_count + curve) + word;
    // Of no time the least is above the greatest.
    return words[at] <= words[at + 1] ? [words[at], words[at + 1]] : null;
  }

  /** Another taxel is watched: the values of the last one are discarded. */
  unwatch() {
    this.history.fill(UNKNOWN_VALUE);
    this.pointed = null;
  }

  /** @returns {[number, number] | null} the numbers of the first and the last column in the window */
  get columns() {
    return this.window && [Math.floor(this.window[0] / this.column_us), Math.ceil(this.window[1] / this.column_us) - 1];
  }

  /** @param {number} t_us @returns {number | null} 0 at the left edge to 1 at the right; null outside */
  share(t_us) {
    if (!this.window) return null;
    const share = (t_us - this.window[0]) / this.span_us;
    return share >= 0 && share <= 1 ? share : null;
  }

  /** @param {number} share @returns {number | null} the time there */
  time(share) {
    return this.window && Math.round(this.window[0] + share * this.span_us);
  }

  /** @returns {Values | null} the values at the cursor, or at the time shown; null: not known */
  get values() {
    const { cursor_us, pointed } = this;
    if (cursor_us === null) return this.now;
    return pointed?.t_us === cursor_us && this.known(Math.floor(cursor_us / this.column_us)) >= 0 ? pointed : null;
  }

  /**
   * Where the axis has numbers: on the source's own time; behind the newest where the window follows it.
   * @param {number} most about so many of them
   * @returns {Tick[]}
   */
  ticks(most) {
    if (!this.window) return [];
    const [from, to] = this.window;
    const zero = this.following ? to : numbering.begin_us;
    const least = this.span_us / Math.max(2, most);
    const power = 10 ** Math.floor(Math.log10(least));
    const step = Math.max(1, (STEPS.find((times) => times * power >= least) ?? 10) * power);
    const decimals = Math.max(0, 6 - Math.floor(Math.log10(step) + 1e-9));
    const ticks = [];
    for (let k = Math.ceil((from - zero) / step); k * step + zero <= to; k++) {
      const behind = -k * step;
      ticks.push({ share: (k * step + zero - from) / this.span_us, text: this.following ? (behind ? `−${short(behind)}` : "now") : seconds(k * step + zero, decimals) });
    }
    return ticks;
  }
}
