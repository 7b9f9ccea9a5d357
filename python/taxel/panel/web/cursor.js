// The time cursor over the lanes; what pointer and wheel do there.

import { part, write } from "./dom.js";
import { numbering, seconds, short } from "./words.js";

/** @typedef {import("./timeline.js").Timeline} Timeline */

/** How far a wheel turns to halve the stretch of time, pixels. */
const WHEEL_HALF = 400;
/** Pixels of a line, for wheels that count lines. */
const LINE_PX = 30;
/** From here on a press is a drag, CSS pixels. */
const DRAG = 4;
/** Where a press is for another control. */
const NOT_TIME = "#label-lane, button";

/** @param {number} us @returns {string} a time between, to the millisecond or closer */
const length = (us) => (us < 1e6 || numbering.number_us ? short(us) : `${(us / 1e6).toFixed(3)} s`);

export class Cursor {
  /**
   * @param {() => Timeline | null} timeline
   * @param {(t_us: number) => void} seek
   * @param {import("./window.js").TimeWindow} window
   * @param {() => void} moved called when the user has moved the cursor
   */
  constructor(timeline, seek, window, moved) {
    this.timeline = timeline;
    this.window = window;
    this.track = part("track", HTMLElement);
    /** Where a press began, and whether it has become a drag. @type {{ x: number, drags: boolean } | null} */
    this.press = null;
    /** Where the fingers are that touch the lanes, by pointer. @type {Map<number, number>} */
    this.fingers = new Map();
    /** The second cursor. @type {number | null} */
    this.second_us = null;
    const lanes = part("lanes", HTMLElement);
    /** @param {number | null} t_us */
    const point = (t_us) => {
      const shown = timeline();
      if (shown) shown.cursor_us = t_us;
      moved();
    };
    lanes.addEventListener("pointermove", (event) => {
      if (this.fingers.size > 1) return this.pinch(event);
      if (this.press) this.drag(event, lanes);
      point(this.timeAt(event));
    });
    lanes.addEventListener("pointerleave", () => point(null));
    lanes.addEventListener("wheel", (event) => this.turn(event), { passive: false });
    lanes.addEventListener("pointerdown", (event) => {
      const onTime = event.button === 0 && event.target instanceof Element && !event.target.closest(NOT_TIME);
      if (onTime && event.pointerType === "touch") this.fingers.set(event.pointerId, event.clientX);
      this.press = onTime && this.fingers.size < 2 ? { x: event.clientX, drags: false } : null;
    });
    for (const over of ["pointerup", "pointercancel"]) {
      addEventListener(over, (event) => event instanceof PointerEvent && this.fingers.delete(event.pointerId));
    }
    lanes.addEventListener("pointerup", (event) => {
      const { press } = this;
      this.press = null;
      lanes.classList.remove("dragged");
      const t_us = this.timeAt(event);
      if (press && !press.drags && t_us !== null) seek(t_us);
    });
    lanes.addEventListener("pointercancel", () => {
      this.press = null;
      lanes.classList.remove("dragged");
    });
  }

  /** Scrolls with the pointer. @param {PointerEvent} event @param {HTMLElement} lanes */
  drag(event, lanes) {
    const { press } = this;
    const timeline = this.timeline();
    if (!press || !timeline || (!press.drags && Math.abs(event.clientX - press.x) < DRAG)) return;
    if (!press.drags) lanes.setPointerCapture(event.pointerId);
    lanes.classList.add("dragged");
    press.drags = true;
    this.window.scroll(((press.x - event.clientX) / this.track.clientWidth) * timeline.span_us);
    press.x = event.clientX;
  }

  /** Two fingers that part show less time, around the cursor. @param {PointerEvent} event */
  pinch(event) {
    const apart = () => {
      const [a, b] = this.fingers.values();
      return Math.max(DRAG, Math.abs(a - b));
    };
    const before = apart();
    if (!this.fingers.has(event.pointerId)) return;
    this.fingers.set(event.pointerId, event.clientX);
    this.window.scale(before / apart());
  }

  /** @param {MouseEvent} event @returns {number | null} */
  timeAt(event) {
    const box = this.track.getBoundingClientRect();
    const share = (event.clientX - box.left) / box.width;
    return share < 0 || share > 1 ? null : (this.timeline()?.time(share) ?? null);
  }

  /**
   * The wheel zooms, with Shift or sideways it scrolls in time. Where the page itself scrolls, zooming takes Ctrl, which two fingers on
   * a touch pad send as well.
   * @param {WheelEvent} event
   */
  turn(event) {
    const timeline = this.timeline();
    if (!timeline) return;
    const unit = event.deltaMode === WheelEvent.DOM_DELTA_LINE ? LINE_PX : 1;
    const [x, y] = event.shiftKey ? [event.deltaX || event.deltaY, 0] : [event.deltaX, event.deltaY];
    const page = document.scrollingElement ?? document.body;
    const views = part("lanes", HTMLElement).parentElement ?? page;
    const scrolls = [page, views].some(({ scrollHeight, clientHeight }) => scrollHeight > clientHeight + 1);
    const zooms = event.ctrlKey || event.metaKey || !scrolls;
    if (Math.abs(x) > Math.abs(y)) this.window.scroll(((unit * x) / this.track.clientWidth) * timeline.span_us);
    else if (zooms) this.window.scale(2 ** ((unit * y) / WHEEL_HALF));
    else return;
    event.preventDefault();
  }

  /** Puts the second cursor at the cursor, or at the time shown, or takes it away. */
  second() {
    const timeline = this.timeline();
    this.second_us = this.second_us === null ? (timeline?.cursor_us ?? timeline?.t_us ?? null) : null;
    this.draw();
  }

  /** Draws the lines at the cursors and at the time shown. */
  draw() {
    const timeline = this.timeline();
    const moveTo = (/** @type {HTMLElement} */ line, /** @type {number | null} */ t_us) => {
      const share = t_us === null ? null : (timeline?.share(t_us) ?? null);
      line.hidden = share === null;
      if (share !== null) line.style.left = `${(100 * share).toFixed(3)}%`;
    };
    const cursor = timeline?.cursor_us ?? null;
    moveTo(part("cursor-line", HTMLElement), cursor);
    write(part("cursor-time", HTMLElement), cursor === null ? "" : seconds(cursor));
    moveTo(part("second-line", HTMLElement), this.second_us);
    const between = cursor === null || this.second_us === null ? null : cursor - this.second_us;
    write(part("second-time", HTMLElement), between === null ? "" : `${between < 0 ? "−" : "+"}${length(Math.abs(between))}`);
    const t_us = timeline?.t_us ?? null;
    moveTo(part("time-line", HTMLElement), timeline?.following ? null : t_us);
  }
}
