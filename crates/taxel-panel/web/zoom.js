// The stretch of time that the lanes show: half or twice of it, and the axis below them.

import { part, write } from "./dom.js";
import { failed } from "./notice.js";
import { SPAN } from "./timeline.js";
import { short } from "./words.js";

/** @typedef {import("./player.js").Player} Player */
/** @typedef {import("./protocol.js").Picture} Picture */
/** @typedef {import("./server.js").Server} Server */
/** @typedef {import("./timeline.js").Timeline} Timeline */

/** How long a zoom waits for the picture at the end of its window, ms. */
const PICTURE_WITHIN_MS = 5000;

export class Zoom {
  /**
   * @param {Server} server
   * @param {Player} player
   * @param {() => Timeline | null} timeline
   * @param {() => [number, number] | null} limits narrowest and widest column of time, us
   */
  constructor(server, player, timeline, limits) {
    this.server = server;
    this.player = player;
    this.timeline = timeline;
    this.limits = limits;
    /** Width of the columns that the axis is written for, us. */
    this.axis_us = 0;
    /** Fulfilled when the last zoom is done: the next one starts from the window that it leaves. */
    this.last = Promise.resolve();
    /** The picture at which the window is to end, us, and what waits for it. @type {{ t_us: number, arrived: () => void } | null} */
    this.awaited = null;
  }

  /**
   * Shows half or twice the stretch of time, after the zooms that were asked for before. Where the view is paused, the
   * time at the cursor stays where it is.
   * @param {1 | -1} by 1: half, -1: twice
   */
  by(by) {
    this.last = this.last.then(() => this.once(by));
    return this.last;
  }

  /** @param {1 | -1} by */
  async once(by) {
    const [least, most] = this.limits() ?? [0, 0];
    const timeline = this.timeline();
    if (!timeline) return;
    const column_us = by > 0 ? timeline.column_us / 2 : timeline.column_us * 2;
    if (column_us < least || column_us > most) return;
    const { player } = this;
    const paused = player.transport.state === "paused";
    const { t_us, end_us } = timeline;
    const cursor = timeline.cursor_us ?? t_us;
    await this.server.request({ type: "zoom", column_us }).catch(failed);
    if (!paused || t_us === null || end_us === null || cursor === null) return;
    const end = cursor + (end_us - cursor) * (by > 0 ? 0.5 : 2);
    // The window first, by a picture at its end, then the time in it; the server leaves out pictures that are overtaken.
    player.seek(end);
    await this.pictureAt(player.goal ?? end);
    player.seek(t_us <= end && t_us > end - SPAN * column_us ? t_us : cursor);
    await player.settled();
  }

  /**
   * @param {number} t_us
   * @returns {Promise<void>} fulfilled when the picture of that time has arrived, or has not arrived for long
   */
  pictureAt(t_us) {
    return new Promise((resolve) => {
      const awaited = {
        t_us,
        arrived: () => {
          if (this.awaited === awaited) this.awaited = null;
          resolve();
        },
      };
      this.awaited = awaited;
      setTimeout(awaited.arrived, PICTURE_WITHIN_MS);
    });
  }

  /** @param {Picture} picture @returns {boolean} whether the window is to end at it */
  endsAt({ t_us, column_us }) {
    return this.awaited !== null && t_us !== null && Math.abs(t_us - this.awaited.t_us) <= column_us;
  }

  /** Writes the axis. @param {number} column_us */
  show(column_us) {
    if (column_us === this.axis_us) return;
    this.axis_us = column_us;
    const span_us = SPAN * column_us;
    const places = part("axis", HTMLElement).children;
    [...places].forEach((place, i) => write(place, i + 1 < places.length ? `−${short((span_us * (places.length - 1 - i)) / (places.length - 1))}` : "0"));
    write(part("span", HTMLElement), short(span_us));
    const [least, most] = this.limits() ?? [column_us, column_us];
    part("zoom-in", HTMLButtonElement).disabled = column_us <= least;
    part("zoom-out", HTMLButtonElement).disabled = column_us >= most;
  }
}
