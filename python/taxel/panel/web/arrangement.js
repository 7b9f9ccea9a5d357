// Where the parts of the page are: the line between the maps, on the left, and the lanes, on the right; what a narrow page has where.

import { part } from "./dom.js";

/** @typedef {import("./settings.js").Settings} Settings */

/** The least and the largest part of the width that the maps take, percent. */
const [LEAST, MOST] = [15, 85];
/** How far an arrow key moves a line between parts, CSS pixels. */
const STEP = 16;

/**
 * Lets a line between two parts be moved by the pointer or the arrow keys.
 * @param {HTMLElement} line
 * @param {"x" | "y"} axis
 * @param {(by: number) => void} move CSS pixels
 */
export function movable(line, axis, move) {
  const keys = axis === "x" ? ["ArrowLeft", "ArrowRight"] : ["ArrowUp", "ArrowDown"];
  line.addEventListener("pointerdown", (event) => {
    event.stopPropagation();
    line.setPointerCapture(event.pointerId);
  });
  line.addEventListener("pointermove", (event) => {
    if (line.hasPointerCapture(event.pointerId)) move(axis === "x" ? event.movementX : event.movementY);
  });
  line.addEventListener("keydown", (event) => {
    const at = keys.indexOf(event.key);
    if (at < 0) return;
    event.preventDefault();
    event.stopPropagation();
    move(at ? STEP : -STEP);
  });
}

/** Makes the line between the maps and the lanes; its place is a setting. @param {Settings} settings */
export function divide(settings) {
  const [views, line] = [part("views", HTMLElement), part("divider", HTMLElement)];
  const show = () => {
    views.style.setProperty("--share", `${settings.values.share}%`);
    line.setAttribute("aria-valuenow", settings.values.share.toFixed(0));
  };
  movable(line, "x", (by) => {
    settings.set("share", Math.min(MOST, Math.max(LEAST, settings.values.share + (100 * by) / views.clientWidth)));
    show();
  });
  show();
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
  // The flags stop below the maps, which stay in sight.
  const [views, maps] = [part("views", HTMLElement), part("maps", HTMLElement)];
  new ResizeObserver(() => views.style.setProperty("--maps", `${maps.offsetHeight}px`)).observe(maps);
}
