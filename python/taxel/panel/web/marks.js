// Marks in a row of the lanes, each at its time.

import { paintAs } from "./colours.js";
import { entitle, make, withChildren } from "./dom.js";

/** @typedef {import("./timeline.js").Timeline} Timeline */
/** @typedef {{ t_us: number, kind: string, title: string, label?: string }} Mark `kind`: its class; `label` gives its colour */

/**
 * Puts marks in a row; of those on one pixel one is seen.
 * @param {HTMLElement} row
 * @param {Timeline | null} timeline
 * @param {Mark[]} marks
 */
export function putMarks(row, timeline, marks) {
  row.hidden = !marks.length;
  const { clientWidth } = row;
  /** @type {Map<number, Mark>} */
  const places = new Map();
  for (const mark of marks) {
    const share = timeline?.share(mark.t_us) ?? null;
    if (share !== null) places.set(Math.round(share * clientWidth), mark);
  }
  const elements = withChildren(row, places.size, () => make("span"));
  [...places].forEach(([x, { kind, title, label }], i) => {
    elements[i].className = kind;
    if (label !== undefined) paintAs(elements[i], label);
    entitle(elements[i], "title", title);
    elements[i].style.left = `${x}px`;
  });
}
