// What the lanes show, by columns of time; the window of time that is shown, and the one time cursor that every view shares.

import { MISSING, UNKNOWN_VALUE } from "./protocol.js";
import { numbering, seconds, short } from "./words.js";

/** @typedef {import("./protocol.js").Frame} Frame */
/** @typedef {{ share: number, text: string }} Tick */

/** Columns that are stored; the window shows one less at most, as it need not begin where a column does. */
export const SPAN = 1250;
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
    this.spikes = new Uint8Array(SPAN * rows);
    this.sum = new Float64Array(SPAN);
    this.area = new Float64Array(SPAN);
    this.x = new Float32Array(SPAN);
    this.y = new Float32Array(SPAN);
    this.history = new Uint16Array(SPAN * 3);
    /** How many channels have a curve each, and their ticks above rest, column after column. */
    this.channel_count = 0;
    this.channels = new Uint16Array(0);
    /** How many of several sources have curves of their own, their sums, and their centres, x and y. */
    this.source_count = 0;
    this.sources = new Uint32Array(0);
    this.sourceCentres = new Float32Array(0);
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
    if (frame.restart || frame.column_us !== this.column_us) this.number.fill(NaN);
    this.column_us = frame.column_us;
    this.t_us = frame.t_us;
    this.following = frame.following;
    if (frame.t_us === null) return;
    if (frame.following || !this.window) {
      const end = (Math.floor(frame.t_us / this.column_us) + 1) * this.column_us;
      this.window = [end - this.span_us, end];
    }
    const { first, count, raster, spikes, sums, centres, history, channels, sources, sourceCentres } = frame;
    const each = channels && count ? channels.length / count : this.channel_count;
    if (each !== this.channel_count) [this.channel_count, this.channels] = [each, new Uint16Array(SPAN * each)];
    const several = count ? (sources?.length ?? 0) / count : this.source_count;
    if (several !== this.source_count) {
      this.source_count = several;
      [this.sources, this.sourceCentres] = [new Uint32Array(SPAN * several), new Float32Array(SPAN * several * 2)];
    }
    for (let i = 0; i < count; i++) {
      const column = this.columnOf(first + i);
      this.number[column] = first + i;
      if (raster) this.raster.set(raster.subarray(i * this.rows, (i + 1) * this.rows), column * this.rows);
      if (spikes) this.spikes.set(spikes.subarray(i * this.rows, (i + 1) * this.rows), column * this.rows);
      else this.spikes.fill(0, column * this.rows, (column + 1) * this.rows);
      if (sums && centres) {
        const missing = sums[4 * i + 1] === MISSING;
        this.sum[column] = missing ? NaN : sums[4 * i];
        this.area[column] = missing ? NaN : sums[4 * i + 1];
        this.x[column] = centres[4 * i + 2];
        this.y[column] = centres[4 * i + 3];
      }
      if (sources) this.sources.set(sources.subarray(i * several, (i + 1) * several), column * several);
      if (sourceCentres) this.sourceCentres.set(sourceCentres.subarray(2 * i * several, 2 * (i + 1) * several), 2 * column * several);
      if (channels) this.channels.set(channels.subarray(i * each, (i + 1) * each), column * each);
      if (history) this.history.set(history.subarray(3 * i, 3 * i + 3), 3 * column);
      else this.history.fill(UNKNOWN_VALUE, 3 * column, 3 * column + 3);
    }
  }

  /** @param {number} column @returns {number[]} the sum of each of several sources, or of all; not a number where no taxel has a value */
  sums(column) {
    const { source_count: count, sources } = this;
    if (!count) return [this.sum[column]];
    return Array.from(sources.subarray(column * count, (column + 1) * count), (sum) => (sum === MISSING ? NaN : sum));
  }

  /** @param {number} column @returns {[number, number][]} the centre of each of several sources, or of all; not a number where nothing is pressed */
  centres(column) {
    const { source_count: count, sourceCentres: all } = this;
    if (!count) return [[this.x[column], this.y[column]]];
    return Array.from({ length: count }, (_, k) => [all[2 * (column * count + k)], all[2 * (column * count + k) + 1]]);
  }

  /** Another taxel is watched: the values of the last one are discarded. */
  unwatch() {
    this.history.fill(UNKNOWN_VALUE);
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

  /** @returns {number} the column that the cursor points at, or of the time shown; -1: not known */
  get pointed() {
    const t = this.cursor_us ?? this.t_us;
    return t === null ? -1 : this.known(Math.floor(t / this.column_us));
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
