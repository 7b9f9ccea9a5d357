// The settings of the page, which the browser stores for this address.

import { LANES } from "./lanes.js";

const PLACE = "taxel.panel";

const OTHERS = {
  theme: "system",
  map: "lipari",
  gamma: 1,
  top: 0,
  flipX: false,
  flipY: false,
  raster: "changes",
  maps: "both",
  share: 42,
  letters: true,
  label: "contact",
};

/** @typedef {typeof OTHERS & Record<`show${string}`, boolean>} Values those of the lanes are in LANES */

/** @type {Values} */
const DEFAULTS = { ...OTHERS, ...Object.fromEntries(LANES.map(({ setting }) => [setting, true])) };

/** Values by name; listeners are called after a change. */
export class Settings {
  constructor() {
    /** @type {Values} */
    this.values = { ...DEFAULTS };
    /** @type {((name: keyof Values) => void)[]} */
    this.listeners = [];
    try {
      const stored = JSON.parse(localStorage.getItem(PLACE) ?? "{}");
      for (const name of /** @type {(keyof Values)[]} */ (Object.keys(DEFAULTS))) {
        if (typeof stored[name] === typeof DEFAULTS[name]) Object.assign(this.values, { [name]: stored[name] });
      }
    } catch {
      // A browser that stores nothing (private windows) has the defaults.
    }
  }

  /**
   * @template {keyof Values} K
   * @param {K} name
   * @param {Values[K]} value
   */
  set(name, value) {
    if (this.values[name] === value) return;
    this.values[name] = value;
    try {
      localStorage.setItem(PLACE, JSON.stringify(this.values));
    } catch {
      // As above.
    }
    for (const listener of this.listeners) listener(name);
  }

  /** @param {(name: keyof Values) => void} listener */
  watch(listener) {
    this.listeners.push(listener);
  }

  /** @returns {import("./colours.js").Theme} the theme that is on */
  get theme() {
    const { theme } = this.values;
    if (theme === "dark" || theme === "light") return theme;
    return matchMedia("(prefers-color-scheme: light)").matches ? "light" : "dark";
  }
}
