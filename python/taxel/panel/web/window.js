// The window of time that the lanes show: it zooms and scrolls as a time axis, and the server sends the columns that it lacks.

import { make, part, withChildren, write } from "./dom.js";
import { inTurn } from "./server.js";
import { SPAN } from "./timeline.js";
import { short } from "./words.js";

/** @typedef {import("./player.js").Player} Player */
/** @typedef {import("./protocol.js").Frame} Frame */
/** @typedef {import("./server.js").Server} Server */
/** @typedef {import("./timeline.js").Timeline} Timeline */

/** The shortest window, us. */
const SHORTEST_US = 5000;
/** Room beside the beginning and the end of a recording, part of the window. */
const ROOM = 0.01;
/** The longest stretch of a recording with which the page opens: so much can be read, us. */
const READABLE_US = 10e6;
/** Where in a window that jumps to a time this lies. */
const AHEAD = 0.2;
/** CSS pixels between two numbers of the axis. */
const TICK_PX = 96;

export class TimeWindow {
  /**
   * @param {Server} server
   * @param {Player} player
   * @param {() => Timeline | null} timeline
   * @param {() => [number, number] | null} limits narrowest and widest column of time, us
   * @param {() => void} moved called when the window has changed
   */
  constructor(server, player, timeline, limits, moved) {
    this.player = player;
    this.timeline = timeline;
    this.limits = limits;
    this.moved = moved;
    /** The columns that were asked for: their width, and where they end. @type {{ column_us: number, end_us: number | null } | null} */
    this.asked = null;
    /** Asks for the columns of the window, unless the server has been asked for them. */
    this.ask = inTurn(server, () => this.lacking(), () => this.forget());
    /** The time shown when the window last moved to it. @type {number | null} */
    this.t_us = null;
    this.axis = part("axis", HTMLElement);
    part("zoom-all", HTMLButtonElement).onclick = () => this.showAll();
  }

  /** Forgets what was asked for: the server knows nothing of it any more. */
  forget() {
    this.asked = null;
  }

  /** @param {Timeline} timeline @returns {number} width of the columns that show its window, us; all that follow share those of 4 ms */
  columnFor({ span_us, following }) {
    const [least, most] = this.limits() ?? [4000, 4000];
    let column_us = following ? 4000 : least;
    while (column_us < most && (SPAN - 1) * column_us < span_us) column_us *= 2;
    return column_us;
  }

  /** @param {number} times as long a stretch of time as now, around the cursor, or around the time shown */
  scale(times) {
    const timeline = this.timeline();
    if (!timeline?.window) return;
    const [, most] = this.limits() ?? [0, 4000];
    const { window, span_us, following, t_us, cursor_us } = timeline;
    let span = Math.max(SHORTEST_US, Math.min((SPAN - 1) * most, span_us * times));
    const { reach } = this.player;
    if (!following && reach) span = Math.min(span, Math.max(SHORTEST_US, (1 + 2 * ROOM) * (reach[1] - reach[0])));
    const at = cursor_us ?? (t_us !== null && timeline.share(t_us) !== null ? t_us : (window[0] + window[1]) / 2);
    const from = following ? window[1] - span : at - ((at - window[0]) / span_us) * span;
    this.set(from, from + span);
  }

  /** @param {number} us later; a view that follows the newest stays there */
  scroll(us) {
    const timeline = this.timeline();
    if (!timeline?.window || timeline.following) return;
    this.set(timeline.window[0] + us, timeline.window[1] + us);
  }

  /** Shows the whole recording, or all of the past that can be viewed. */
  showAll() {
    const { reach } = this.player;
    if (!reach) return;
    const room = Math.max(SHORTEST_US / 2, ROOM * (reach[1] - reach[0]));
    this.set(reach[0] - room, reach[1] + room);
  }

  /** Shows the first touches of a recording, or all of a short one. @param {number | null} touch_us the time of the first touch */
  showBeginning(touch_us) {
    const { reach } = this.player;
    if (!reach || reach[1] - reach[0] <= READABLE_US) return this.showAll();
    const from = (touch_us ?? reach[0]) - AHEAD * READABLE_US;
    this.set(from, from + READABLE_US);
  }

  /**
   * Shows this stretch of time, moved so that it lies within what can be viewed.
   * @param {number} from
   * @param {number} to
   */
  set(from, to) {
    const timeline = this.timeline();
    if (!timeline) return;
    const { reach } = this.player;
    const span = to - from;
    if (reach && !timeline.following) {
      const room = ROOM * span;
      const [first, last] = [reach[0] - room, reach[1] + room];
      if (span >= last - first) from = (first + last - span) / 2;
      else from = Math.max(first, Math.min(last - span, from));
    }
    timeline.show([from, from + span]);
    this.ask();
    this.moved();
  }

  /** Moves the window so that the time shown lies within it, where it has changed. @param {Frame} frame */
  follow({ t_us, following, moves }) {
    const timeline = this.timeline();
    if (!timeline?.window || t_us === null || following || t_us === this.t_us) return;
    this.t_us = t_us;
    if (moves && this.asked?.end_us != null) this.asked.end_us = Math.max(this.asked.end_us, t_us);
    if (timeline.share(t_us) !== null) return;
    const [from, to] = timeline.window;
    // A view that plays on moves the window with it; the server sends the columns without being asked.
    if (moves && t_us > to && t_us - to < timeline.span_us) this.set(t_us - timeline.span_us, t_us);
    else this.set(t_us - (t_us > from ? AHEAD : 1 - AHEAD) * timeline.span_us, t_us + (t_us > from ? 1 - AHEAD : AHEAD) * timeline.span_us);
  }

  /** @returns {import("./messages.js").ZoomRequest | null} */
  lacking() {
    const timeline = this.timeline();
    if (!timeline?.window) return null;
    const column_us = this.columnFor(timeline);
    const [from, to] = timeline.window;
    const { asked } = this;
    let end_us = null;
    if (!timeline.following) {
      const [first, last] = this.player.reach ?? [from, to];
      const begins = asked?.end_us != null ? asked.end_us - (SPAN - 1) * column_us : Infinity;
      if (asked?.column_us === column_us && asked.end_us !== null && asked.end_us >= Math.min(to, last) && begins <= Math.max(from, first)) return null;
      // As much beyond the window on either side, so that it can be moved.
      end_us = Math.round(to + ((SPAN - 1) * column_us - timeline.span_us) / 2);
    } else if (asked?.column_us === column_us && asked.end_us === null) return null;
    this.asked = { column_us, end_us };
    return { type: "zoom", ...this.asked };
  }

  /** Writes the axis. @param {import("./timeline.js").Tick[]} ticks */
  writeAxis(ticks) {
    const marks = withChildren(this.axis, ticks.length, () => make("span"));
    ticks.forEach(({ share, text }, i) => {
      write(marks[i], text);
      marks[i].style.left = `${(100 * share).toFixed(2)}%`;
    });
  }

  /** @param {import("./timeline.js").Timeline} timeline @returns {import("./timeline.js").Tick[]} the numbers of the axis, as many as have room */
  ticks(timeline) {
    return timeline.ticks(this.axis.clientWidth / TICK_PX);
  }

  /** Writes the length of the window. */
  write() {
    const timeline = this.timeline();
    if (!timeline) return;
    write(part("span", HTMLElement), short(timeline.span_us));
    const [, most] = this.limits() ?? [0, timeline.column_us];
    part("zoom-in", HTMLButtonElement).disabled = timeline.span_us <= SHORTEST_US;
    part("zoom-out", HTMLButtonElement).disabled = timeline.span_us >= (SPAN - 1) * most;
  }
}
