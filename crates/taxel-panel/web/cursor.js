// The time cursor over the lanes, and the values of the lanes at it.

import { part, write } from "./dom.js";
import { UNKNOWN_VALUE } from "./protocol.js";
import { counted, seconds, whole } from "./words.js";

/** @typedef {import("./timeline.js").Timeline} Timeline */

/** How far a wheel turns for one step of the zoom, pixels. */
const WHEEL_STEP = 40;

export class Cursor {
  /**
   * @param {() => Timeline | null} timeline
   * @param {(t_us: number) => void} seek
   * @param {(by: 1 | -1) => Promise<void>} zoom
   * @param {() => void} moved called when the user has moved the cursor
   */
  constructor(timeline, seek, zoom, moved) {
    this.timeline = timeline;
    this.track = part("track", HTMLElement);
    this.turned = 0;
    this.zooming = false;
    const lanes = part("lanes", HTMLElement);
    /** @param {number | null} t_us */
    const point = (t_us) => {
      const shown = timeline();
      if (shown) shown.cursor_us = t_us;
      moved();
    };
    lanes.addEventListener("pointermove", (event) => point(this.timeAt(event)));
    lanes.addEventListener("pointerleave", () => point(null));
    lanes.addEventListener("wheel", (event) => this.turn(event, zoom), { passive: false });
    lanes.addEventListener("click", (event) => {
      const t_us = this.timeAt(event);
      if (t_us !== null && event.target instanceof Element && !event.target.closest("#label-lane, button, h2")) seek(t_us);
    });
  }

  /** @param {MouseEvent} event @returns {number | null} */
  timeAt(event) {
    const box = this.track.getBoundingClientRect();
    const share = (event.clientX - box.left) / box.width;
    return share < 0 || share > 1 ? null : (this.timeline()?.time(share) ?? null);
  }

  /**
   * Zooms with Ctrl, which two fingers on a touch pad send as well; the wheel alone scrolls.
   * @param {WheelEvent} event
   * @param {(by: 1 | -1) => Promise<void>} zoom
   */
  turn(event, zoom) {
    if (!event.ctrlKey && !event.metaKey) return;
    event.preventDefault();
    this.turned += event.deltaY;
    if (this.zooming || Math.abs(this.turned) < WHEEL_STEP) return;
    this.zooming = true;
    zoom(this.turned < 0 ? 1 : -1).finally(() => {
      this.zooming = false;
      this.turned = 0;
    });
  }

  /** Draws the lines at the cursor and at the time of the picture. */
  draw() {
    const timeline = this.timeline();
    const place = (/** @type {HTMLElement} */ line, /** @type {number | null} */ t_us) => {
      const share = t_us === null ? null : (timeline?.share(t_us) ?? null);
      line.hidden = share === null;
      if (share !== null) line.style.left = `${(100 * share).toFixed(3)}%`;
    };
    place(part("cursor-line", HTMLElement), timeline?.cursor_us ?? null);
    const t_us = timeline?.t_us ?? null;
    const atEdge = t_us !== null && timeline?.end_us !== null && (timeline?.end_us ?? 0) - t_us < 2 * (timeline?.column_us ?? 0);
    place(part("time-line", HTMLElement), atEdge ? null : t_us);
  }

  /** Writes the values at the cursor, or at the time of the picture. */
  write() {
    const timeline = this.timeline();
    const place = timeline?.pointed ?? -1;
    const cursor = timeline?.cursor_us ?? null;
    write(part("cursor-time", HTMLElement), cursor === null ? "" : seconds(cursor));
    if (!timeline || place < 0) {
      for (const id of ["taxel-now", "force-sum", "force-area", "centre-now"]) write(part(id, HTMLElement), "");
      return;
    }
    const [least, greatest, last] = timeline.history.subarray(3 * place, 3 * place + 3);
    write(part("taxel-now", HTMLElement), last === UNKNOWN_VALUE ? "" : least === greatest ? `${last} ticks` : `${last} ticks (${least} to ${greatest})`);
    write(part("force-sum", HTMLElement), `${whole(timeline.sum[place])} ticks`);
    write(part("force-area", HTMLElement), counted(timeline.area[place], "taxel"));
    const [x, y] = [timeline.x[place], timeline.y[place]];
    const centre = Number.isNaN(x) ? "nothing pressed" : `column ${x.toFixed(1)}, row ${y.toFixed(1)}`;
    write(part("centre-now", HTMLElement), centre);
    const force = `${whole(timeline.sum[place])} ticks over ${counted(timeline.area[place], "taxel")}`;
    write(part("picture-info", HTMLElement), `${force}, centre: ${centre}`);
  }
}
