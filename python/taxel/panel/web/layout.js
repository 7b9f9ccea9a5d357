// Where maps and lanes stand, so that both use the room: maps above the lanes or beside them, one or two, as large as fits.

import { part } from "./dom.js";

/** Room around a map: title, colour bar, scale, CSS pixels. */
const AROUND_MAP = 50;
/** Below the maps: room for two lines, so that nothing moves where a sentence comes or goes. */
const UNDER = { above: 41, beside: 50 };
const GAP = 20;
/** Below the message above the maps. */
const BELOW_BANNER = 8;
/** The least that is needed beside the lanes: the flags, the detections, the axis. */
const FLAGS_AND_AXIS = 79;
/** A row of marks that is shown at times. */
const MARKS = 15;
/** The least width of lanes that stand beside maps. */
const LANES_WIDE = 460;
/** Part of the width that maps beside the lanes may take. */
const BESIDE = 0.5;
/** A narrow page has one column, which scrolls. */
const NARROW = "(max-width: 860px)";

/** @typedef {"above" | "beside" | "column"} Side where the maps are: above lanes; two maps side by side, or in a column, beside the lanes */

/** Chooses the arrangement in which the maps are largest. */
export class Layout {
  /**
   * @param {() => { aspect: number, maps: number, lanes: import("./lanes.js").Lane[] }} shown width over height of a map, how many
   *   maps there are, and the lanes
   * @param {() => void} arranged called after the sizes have changed
   */
  constructor(shown, arranged) {
    this.shown = shown;
    this.arranged = arranged;
    this.views = part("views", HTMLElement);
    /** The message above the maps, shown at times. */
    this.banner = part("silence", HTMLElement);
    this.mistakes = part("mistake-marks", HTMLElement);
    this.done = "";
    const resized = new ResizeObserver(() => this.arrange());
    resized.observe(this.views);
    resized.observe(this.banner);
  }

  /** @returns {{ side: Side, width: number }} of the maps, and of one map, CSS pixels */
  widest() {
    const { aspect, maps, lanes } = this.shown();
    const { clientWidth: wide } = this.views;
    const banner = this.banner.offsetHeight;
    const high = this.views.clientHeight - (banner && banner + BELOW_BANNER);
    const low = FLAGS_AND_AXIS + (this.mistakes.hidden ? 0 : MARKS) + lanes.reduce((sum, { least }) => sum + least, 0);
    const beside = Math.min(BESIDE * wide, wide - LANES_WIDE - GAP);
    /** @type {[Side, number][]} */
    const widths = [
      ["above", Math.min((wide - (maps - 1) * GAP) / maps, Math.max(120, high - low - UNDER.above - AROUND_MAP) * aspect)],
      ["beside", Math.min((beside - (maps - 1) * GAP) / maps, (high - UNDER.beside - AROUND_MAP) * aspect)],
      ["column", Math.min(beside, ((high - UNDER.beside) / maps - AROUND_MAP) * aspect)],
    ];
    const [side, width] = widths.reduce((best, next) => (next[1] > best[1] * 1.05 ? next : best));
    return { side, width };
  }

  arrange() {
    const { side, width } = matchMedia(NARROW).matches ? { side: /** @type {Side} */ ("above"), width: 0 } : this.widest();
    const chosen = `${side} ${Math.floor(width)}`;
    if (chosen === this.done) return;
    this.done = chosen;
    this.views.dataset.place = side;
    const { maps } = this.shown();
    const row = side === "beside" ? maps : 1;
    for (const [name, value] of [["--map", Math.floor(width)], ["--maps", row * Math.floor(width) + (row - 1) * GAP]]) {
      if (width) this.views.style.setProperty(String(name), `${value}px`);
      else this.views.style.removeProperty(String(name));
    }
    this.arranged();
  }
}
