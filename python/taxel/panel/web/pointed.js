// The values at the cursor: the server is asked for those of its time.

import { inTurn } from "./server.js";

/** @typedef {import("./server.js").Server} Server */
/** @typedef {import("./timeline.js").Timeline} Timeline */

export class Pointed {
  /**
   * @param {Server} server
   * @param {() => Timeline | null} timeline
   */
  constructor(server, timeline) {
    this.timeline = timeline;
    /** The times whose values were asked for last, and refused last. */
    let [asked_us, refused_us] = [NaN, NaN];
    /** Asks for the values at the cursor, unless they are there. */
    this.ask = inTurn(server, () => {
      const { cursor_us = null, pointed = null } = timeline() ?? {};
      if (cursor_us === null || cursor_us === refused_us || pointed?.t_us === cursor_us) return null;
      return { type: "values", t_us: (asked_us = cursor_us) };
    }, () => (refused_us = asked_us));
  }

  /** @param {import("./messages.js").Values} values */
  take({ t_us, curves, taxel }) {
    const timeline = this.timeline();
    if (!timeline) return;
    const real = (/** @type {number | null} */ value) => value ?? NaN;
    timeline.pointed = { t_us, taxel, curves: curves.map((curve) => curve && { ...curve, x: real(curve.x), y: real(curve.y) }) };
  }
}
