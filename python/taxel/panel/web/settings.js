// The settings of the page, which the browser stores for this address.

const PLACE = "taxel.panel";

const DEFAULTS = { theme: "system", top: 0, share: 42, heights: /** @type {Record<string, number>} */ ({}), label: "contact" };

/** @typedef {typeof DEFAULTS} Values */

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
