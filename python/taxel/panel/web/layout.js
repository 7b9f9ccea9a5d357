// Where the parts of the page are: the line between the maps, on the left, and the lanes, on the right; what a narrow page has where.

import { part } from "./dom.js";

/** @typedef {import("./settings.js").Settings} Settings */

/** The least and the largest part of the width that the maps take, percent, and a step of the arrow keys. */
const [LEAST, MOST, STEP] = [15, 85, 2];

/** The divider; its place is a setting. */
export class Divider {
  /**
   * @param {Settings} settings
   * @param {() => void} resized called after the sizes have changed
   */
  constructor(settings, resized) {
    this.settings = settings;
    this.views = part("views", HTMLElement);
    this.line = part("divider", HTMLElement);
    this.show();
    this.line.addEventListener("pointerdown", (event) => this.line.setPointerCapture(event.pointerId));
    this.line.addEventListener("pointermove", (event) => {
      if (!this.line.hasPointerCapture(event.pointerId)) return;
      const { left, width } = this.views.getBoundingClientRect();
      this.move((100 * (event.clientX - left)) / width);
    });
    this.line.addEventListener("keydown", (event) => {
      const by = { ArrowLeft: -STEP, ArrowRight: STEP }[event.key];
      if (by === undefined) return;
      event.preventDefault();
      event.stopPropagation();
      this.move(settings.values.share + by);
    });
    new ResizeObserver(resized).observe(part("lanes", HTMLElement));
  }

  /** @param {number} share of the width that the maps take, percent */
  move(share) {
    this.settings.set("share", Math.round(Math.min(MOST, Math.max(LEAST, share))));
    this.show();
  }

  show() {
    const share = String(this.settings.values.share);
    this.views.style.setProperty("--share", `${share}%`);
    this.line.setAttribute("aria-valuenow", share);
  }
}

/** A narrow page has only what must stay in sight in its header and footer, so that these stay low. */
export function arrangeForWidth() {
  const narrow = matchMedia("(max-width: 860px)");
  const arrange = () => {
    if (narrow.matches) {
      part("opening", HTMLElement).append(part("files", HTMLElement), part("speed", HTMLElement));
      part("strip-place", HTMLElement).append(part("strip", HTMLElement));
      part("aside", HTMLElement).prepend(part("counters", HTMLElement));
    } else {
      part("clock-place", HTMLElement).before(part("strip", HTMLElement));
      part("corner", HTMLElement).before(part("counters", HTMLElement));
      part("record", HTMLElement).after(part("files", HTMLElement));
      part("step-on", HTMLElement).after(part("speed", HTMLElement));
    }
  };
  narrow.addEventListener("change", arrange);
  arrange();
}
