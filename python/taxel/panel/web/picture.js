// A picture of the time that is shown on the pressure map: largest or mean values, isobars, and the path of the centre with marks in time.

import { drawing, make, part } from "./dom.js";
import { inTurn } from "./server.js";
import { seconds } from "./words.js";

/** @typedef {import("./messages.js").Picture} Message */
/** @typedef {import("./timeline.js").Timeline} Timeline */

/** Where marks are on a path, shares of its time. */
const MARKS = [0, 0.25, 0.5, 0.75, 1];

export class Picture {
  /**
   * @param {import("./server.js").Server} server
   * @param {import("./maps.js").Maps} maps
   * @param {() => Timeline | null} timeline
   * @param {import("./player.js").Player} player
   * @param {() => void} drawn called when the map is to be drawn again
   */
  constructor(server, maps, timeline, player, drawn) {
    this.maps = maps;
    this.timeline = timeline;
    this.player = player;
    this.drawn = drawn;
    /** What was asked for. */
    this.asked = "";
    this.kind = part("picture", HTMLSelectElement);
    this.lines = part("picture-lines", SVGSVGElement);
    this.marks = part("picture-marks", HTMLElement);
    /** Asks for the picture of the window, unless it was asked for. */
    this.ask = inTurn(server, () => this.lacking());
    this.kind.onchange = () => {
      this.show(null);
      this.ask();
    };
  }

  /** Another source is shown. @param {boolean} fits whether it has pictures */
  choose(fits) {
    this.kind.hidden = !fits;
    this.kind.value = "";
    this.show(null);
  }

  /** @returns {import("./messages.js").PictureRequest | null} */
  lacking() {
    const kind = /** @type {"" | "maximum" | "mean"} */ (this.kind.value);
    const window = this.timeline()?.window;
    if (!kind || !window) return null;
    const [first, last] = this.player.reach ?? window;
    const [start_us, stop_us] = window.map((t_us) => Math.round(Math.min(last, Math.max(first, t_us))));
    const asked = `${kind} ${start_us} ${stop_us}`;
    if (asked === this.asked) return null;
    this.asked = asked;
    return { type: "picture", kind, start_us, stop_us };
  }

  /** @param {Message} message */
  take(message) {
    if (message.kind === this.kind.value) this.show(message);
  }

  /** @param {Message | null} picture null: the map shows what is now */
  show(picture) {
    if (!picture) this.asked = "";
    const { maps } = this;
    const line = (/** @type {import("./geometry.js").Place[]} */ places) => places.map((place, k) => `${k ? "L" : "M"}${maps.geometry.seen(place).map((share) => (1000 * share).toFixed(1))}`).join("");
    maps.picture = picture && { values: Float32Array.from(picture.values, (value) => value / maps.values.step), words: `${seconds(picture.start_us)} to ${seconds(picture.stop_us)}` };
    const paths = picture?.paths ?? [];
    // A path has a gap where nothing is loaded.
    const pieces = paths.flatMap((path) => path.reduce((all, at) => (at ? [...all.slice(0, -1), [...all[all.length - 1], at]] : [...all, []]), /** @type {[number, number, number][][]} */ ([[]])));
    this.lines.replaceChildren(
      drawing("path", { class: "isobars", d: (picture?.isobars ?? []).map(line).join("") }),
      drawing("path", { class: "path", d: pieces.map((piece) => line(piece.map(([, x, y]) => [x, y]))).join("") }),
    );
    this.marks.replaceChildren(...paths.flatMap((path) => this.marksOf(path.filter((at) => at !== null))));
    this.drawn();
  }

  /** Marks on a path, in percent of the time from its first point to its last one. @param {[number, number, number][]} path @returns {HTMLElement[]} */
  marksOf(path) {
    if (path.length < 2) return [];
    const [[first], [last]] = [path[0], path[path.length - 1]];
    return MARKS.map((share) => {
      const [t, x, y] = path.find(([t]) => t >= first + share * (last - first)) ?? path[0];
      const mark = make("span", { title: seconds(t) }, `${100 * share} %`);
      [mark.style.left, mark.style.top] = this.maps.geometry.seen([x, y]).map((at) => `${100 * at}%`);
      return mark;
    });
  }
}
