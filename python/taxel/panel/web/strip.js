// The whole recording, or the past of the live source as far as it can be viewed: force and marks; click or drag to move there.

import { labelColour } from "./colours.js";
import { fitted, ground, part, themed } from "./dom.js";
import { seconds, writtenTime } from "./words.js";

/** @typedef {import("./messages.js").Overview} Overview */
/** @typedef {import("./player.js").Player} Player */
/** @typedef {import("./timeline.js").Timeline} Timeline */
/** @typedef {{ t_us: number, label: string }} Labelled */
/** @typedef {{ labels: Labelled[], detections: Labelled[], mistakes: { t_us: number }[], notes: { t_us: number }[], cut: [number | null, number | null] }} Marks */

/** The strip at the foot of the page. */
export class Strip {
  /**
   * @param {Player} player
   * @param {() => Timeline | null} timeline
   * @param {() => Marks} marks
   */
  constructor(player, timeline, marks) {
    this.player = player;
    this.timeline = timeline;
    this.marks = marks;
    this.canvas = part("strip", HTMLCanvasElement);
    this.context = ground(this.canvas);
    /** @type {Overview | null} */
    this.overview = null;
    this.canvas.addEventListener("pointerdown", (event) => {
      this.canvas.setPointerCapture(event.pointerId);
      this.go(event);
    });
    this.canvas.addEventListener("pointermove", (event) => {
      if (event.buttons & 1) this.go(event);
    });
    this.canvas.addEventListener("keydown", (event) => this.key(event));
  }

  /** @param {PointerEvent} event */
  go(event) {
    const { reach } = this.player;
    if (reach) this.player.seek(reach[0] + (event.offsetX / this.canvas.clientWidth) * (reach[1] - reach[0]));
  }

  /** @param {KeyboardEvent} event */
  key(event) {
    const { reach, targetTime: t_us } = this.player;
    if (!reach || t_us === null || event.ctrlKey || event.altKey || event.metaKey) return;
    const [from, to] = reach;
    /** @type {Record<string, number>} */
    const times = {
      ArrowLeft: t_us - (event.shiftKey ? 1e6 : 1e5),
      ArrowRight: t_us + (event.shiftKey ? 1e6 : 1e5),
      PageDown: t_us - (to - from) / 10,
      PageUp: t_us + (to - from) / 10,
      Home: from,
      End: to,
    };
    const time = times[event.key];
    if (time === undefined) return;
    event.preventDefault();
    event.stopPropagation();
    this.player.seek(time);
  }

  draw() {
    const { width, height, ratio } = fitted(this.canvas);
    const { context, overview } = this;
    const { reach, t_us } = this.player;
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, width, height);
    if (!reach || reach[1] <= reach[0]) return;
    const x = (/** @type {number} */ t) => ((t - reach[0]) / (reach[1] - reach[0])) * width;
    const timeline = this.timeline();
    if (timeline?.window) {
      context.fillStyle = themed("shade");
      const [left, right] = timeline.window.map((t) => Math.max(0, Math.min(width, x(t))));
      context.fillRect(left, 0, right - left, height);
    }
    const { labels, detections, mistakes, notes, cut } = this.marks();
    const [begin, end] = cut;
    if (begin !== null || end !== null) {
      context.fillStyle = themed("cut");
      const [left, right] = [begin === null ? 0 : x(begin), end === null ? width : x(end)];
      context.fillRect(left, 0, right - left, height);
    }
    if (overview) {
      // The force, whose scale is that of touches; of a board without intensities, the number of events.
      const heights = overview.force.some((sum) => sum > 0) ? overview.force : overview.events;
      const most = heights.reduce((a, b) => Math.max(a, b), 1);
      context.fillStyle = themed("rate");
      const wide = Math.max(1, (overview.step_us / (reach[1] - reach[0])) * width);
      heights.forEach((value, i) => {
        if (!value) return;
        // The root of the share: an impact has thousands of times the force of a finger.
        const high = Math.max(1, Math.sqrt(value / most) * (height - 10));
        context.fillRect(x(overview.start_us + i * overview.step_us), height - high, wide, high);
      });
    }
    /** @param {{ t_us: number }[]} marked @param {string} colour @param {number} from @param {number} to @param {number} wide */
    const ticks = (marked, colour, from, to, wide) => {
      context.fillStyle = themed(colour);
      for (const { t_us: t } of marked) context.fillRect(x(t) - wide / 2, from, wide, to - from);
    };
    ticks(notes, "dim", 0, 5, 1.5);
    /** @param {Labelled[]} named @param {number} to */
    const labelled = (named, to) => {
      for (const label of new Set(named.map((each) => each.label))) {
        ticks(named.filter((each) => each.label === label), labelColour(label), 0, to, 2);
      }
    };
    labelled(detections, 5);
    labelled(labels, height);
    ticks(mistakes, "bad", 5, 12, 3);
    if (t_us !== null) {
      context.fillStyle = themed("text");
      context.fillRect(Math.min(width - 2, Math.max(0, x(t_us) - 1)), 0, 2, height);
    }
  }

  /** Describes the position of the view to screen readers. */
  write() {
    const { reach, t_us } = this.player;
    const { canvas } = this;
    canvas.setAttribute("aria-valuemin", writtenTime(reach?.[0] ?? 0));
    canvas.setAttribute("aria-valuemax", writtenTime(reach?.[1] ?? 0));
    canvas.setAttribute("aria-valuenow", writtenTime(t_us ?? 0));
    canvas.setAttribute("aria-valuetext", reach ? `${seconds(t_us)} of ${seconds(reach[0])} to ${seconds(reach[1])}` : "nothing yet");
  }
}
