// What the lanes show, by columns of time, and the one time cursor that every view shares.

import { UNKNOWN_VALUE } from "./protocol.js";

/** @typedef {import("./protocol.js").Picture} Picture */

/** Columns that are stored and shown. */
export const SPAN = 1250;

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
    this.number = new Float64Array(SPAN);
    /** Number of the last column shown. @type {number | null} */
    this.end = null;
    /** Time of the picture. @type {number | null} */
    this.t_us = null;
    /** Where a person points. @type {number | null} */
    this.cursor_us = null;
    this.clear();
  }

  /** Forgets every column. */
  clear() {
    this.number.fill(NaN);
    this.end = this.t_us = this.cursor_us = null;
  }

  /** @param {number} number @returns {number} its place in the ring */
  place(number) {
    return ((number % SPAN) + SPAN) % SPAN;
  }

  /** @param {number} number @returns {number} its place, or -1 where it is not known */
  known(number) {
    const place = this.place(number);
    return this.number[place] === number ? place : -1;
  }

  /**
   * Stores the columns of a picture. A time within the window leaves the window where it is, so that the view can move back and
   * forth in it; any other moves it.
   * @param {Picture} picture
   * @param {boolean} anew discard earlier columns
   * @param {boolean} ends the window ends at it, wherever that lay
   */
  put(picture, anew, ends) {
    if (anew || picture.column_us !== this.column_us) {
      // Where a person points stays the same time.
      const cursor_us = this.cursor_us;
      this.clear();
      if (!anew) this.cursor_us = cursor_us;
    }
    this.column_us = picture.column_us;
    this.t_us = picture.t_us;
    if (picture.t_us === null) return;
    const now = Math.floor(picture.t_us / this.column_us);
    if (this.end === null || ends || picture.following || now > this.end || now <= this.end - SPAN) this.end = now;
    const { first, count, raster, spikes, sums, centres, history } = picture;
    for (let i = Math.max(0, this.end - SPAN + 1 - first); i < count && first + i <= this.end; i++) {
      const place = this.place(first + i);
      this.number[place] = first + i;
      if (raster) this.raster.set(raster.subarray(i * this.rows, (i + 1) * this.rows), place * this.rows);
      if (spikes) this.spikes.set(spikes.subarray(i * this.rows, (i + 1) * this.rows), place * this.rows);
      else this.spikes.fill(0, place * this.rows, (place + 1) * this.rows);
      if (sums && centres) {
        this.sum[place] = sums[4 * i];
        this.area[place] = sums[4 * i + 1];
        this.x[place] = centres[4 * i + 2];
        this.y[place] = centres[4 * i + 3];
      }
      if (history) this.history.set(history.subarray(3 * i, 3 * i + 3), 3 * place);
      else this.history.fill(UNKNOWN_VALUE, 3 * place, 3 * place + 3);
    }
  }

  /** Another taxel is watched: the values of the last one are discarded. */
  unwatch() {
    this.history.fill(UNKNOWN_VALUE);
  }

  /** @returns {number | null} us at the right edge of the window */
  get end_us() {
    return this.end === null ? null : (this.end + 1) * this.column_us;
  }

  /** @returns {number} us from edge to edge */
  get span_us() {
    return SPAN * this.column_us;
  }

  /** @param {number} t_us @returns {number | null} 0 at the left edge to 1 at the right; null outside */
  share(t_us) {
    const { end_us } = this;
    if (end_us === null) return null;
    const share = 1 - (end_us - t_us) / this.span_us;
    return share >= 0 && share <= 1 ? share : null;
  }

  /** @param {number} share @returns {number | null} the time there */
  time(share) {
    const { end_us } = this;
    return end_us === null ? null : Math.round(end_us - (1 - share) * this.span_us);
  }

  /** @returns {number} the place of the column that the cursor points at, or of the picture; -1: not known */
  get pointed() {
    const t = this.cursor_us ?? this.t_us;
    return t === null ? -1 : this.known(Math.floor(t / this.column_us));
  }
}
