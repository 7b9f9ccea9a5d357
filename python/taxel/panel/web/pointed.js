// The values at the cursor: the server is asked for those of its time.

import { failed } from "./notice.js";

/** @typedef {import("./server.js").Server} Server */
/** @typedef {import("./timeline.js").Timeline} Timeline */

export class Pointed {
  /**
   * @param {Server} server
   * @param {() => Timeline | null} timeline
   */
  constructor(server, timeline) {
    this.server = server;
    this.timeline = timeline;
    this.asking = false;
    /** The time whose values were refused. @type {number | null} */
    this.refused_us = null;
  }

  /** Asks for the values at the cursor, unless they are there. */
  ask() {
    const timeline = this.timeline();
    const t_us = timeline?.cursor_us ?? null;
    if (this.asking || t_us === null || timeline?.pointed?.t_us === t_us || this.refused_us === t_us) return;
    this.asking = true;
    this.server
      .request({ type: "values", t_us })
      .catch((error) => {
        this.refused_us = t_us;
        failed(error);
      })
      .finally(() => (this.asking = false));
  }

  /** @param {import("./messages.js").Values} values */
  take({ t_us, curves, taxel }) {
    const timeline = this.timeline();
    if (!timeline) return;
    const real = (/** @type {number | null} */ value) => value ?? NaN;
    timeline.pointed = { t_us, taxel, curves: curves.map((curve) => curve && { ...curve, x: real(curve.x), y: real(curve.y) }) };
  }
}
