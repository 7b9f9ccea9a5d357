// The tabs of the controls.

import { part } from "./dom.js";

export const TABS = /** @type {const} */ (["board", "record", "labels", "train", "view"]);
/** @typedef {(typeof TABS)[number]} Tab */

/** @param {Tab} chosen @param {boolean} [focus] */
export function showTab(chosen, focus = false) {
  for (const name of TABS) {
    const tab = part(`tab-${name}`, HTMLButtonElement);
    tab.setAttribute("aria-selected", String(name === chosen));
    tab.tabIndex = name === chosen ? 0 : -1;
    part(`panel-${name}`, HTMLElement).hidden = name !== chosen;
    if (focus && name === chosen) tab.focus();
  }
}

TABS.forEach((name, i) => {
  const tab = part(`tab-${name}`, HTMLButtonElement);
  tab.onclick = () => showTab(name);
  tab.onkeydown = (event) => {
    const to = { ArrowLeft: i - 1, ArrowRight: i + 1, Home: 0, End: TABS.length - 1 }[event.key];
    if (to === undefined) return;
    event.preventDefault();
    showTab(TABS[(to + TABS.length) % TABS.length], true);
  };
});
