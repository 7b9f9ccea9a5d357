// The tab of the view: the colour scale, the health of taxels, and cuts.

import { make, part, write } from "./dom.js";
import { failed } from "./notice.js";
import { counted, seconds } from "./words.js";

/** @typedef {import("./messages.js").Health} Health */
/** @typedef {import("./settings.js").Settings} Settings */
/** @typedef {import("./server.js").Server} Server */

/** The tab of the view. */
export class View {
  /**
   * @param {Server} server
   * @param {Settings} settings
   * @param {(taxel: [number, number]) => void} pointed called for a taxel of the list
   */
  constructor(server, settings, pointed) {
    this.server = server;
    this.pointed = pointed;
    /** @type {[number | null, number | null]} */
    this.cut = [null, null];
    /** Sets an end of the cut where the view is. @type {((end: 0 | 1) => void) | null} */
    this.cutHere = null;
    /** What is shown: a recording or, null, the live board. @type {string | null} */
    this.source = null;
    const top = part("top", HTMLInputElement);
    top.value = settings.values.top ? String(settings.values.top) : "";
    top.oninput = () => {
      const value = Number(top.value.replace(",", "."));
      top.setAttribute("aria-invalid", String(!(value >= 0)));
      if (value >= 0) settings.set("top", value);
    };
    part("look", HTMLButtonElement).onclick = () => this.look();
    part("cut-from", HTMLButtonElement).onclick = () => this.cutHere?.(0);
    part("cut-to", HTMLButtonElement).onclick = () => this.cutHere?.(1);
    part("cut-form", HTMLFormElement).onsubmit = (event) => {
      event.preventDefault();
      this.write();
    };
  }

  look() {
    write(part("health-info", HTMLElement), "checking …");
    return this.server.request({ type: "health" }).catch((error) => {
      write(part("health-info", HTMLElement), "");
      failed(error);
    });
  }

  /** @param {Health} health */
  takeHealth(health) {
    const kinds = /** @type {const} */ (["dead", "stuck", "noisy"]);
    const counts = kinds.map((kind) => `${health[kind].length} ${kind}`).join(", ");
    write(part("health-info", HTMLElement), `${counts}, of ${counted(health.taxels, "taxel")}; ${health.untested} not touched enough to say whether they work`);
    const items = kinds.flatMap((kind) =>
      health[kind].slice(0, 200).map(([x, y]) => {
        const button = make("button", { type: "button", class: "link" }, make("span", { class: `unwell ${kind}` }), ` ${kind}: row ${y}, column ${x}`);
        button.onclick = () => this.pointed([x, y]);
        return make("li", {}, button);
      }),
    );
    part("health-list", HTMLElement).replaceChildren(...items);
  }

  /** @param {0 | 1} end @param {number | null} t_us */
  setCut(end, t_us) {
    if (t_us === null) return;
    this.cut[end] = t_us;
    const [from, to] = this.cut;
    // The other end gives way where the two would change places.
    if (from !== null && to !== null && from >= to) this.cut[end ? 0 : 1] = null;
    this.showCut();
  }

  /** @param {string | null} source */
  choose(source) {
    if (source !== this.source) {
      this.cut = [null, null];
      part("cut-name", HTMLInputElement).value = source?.replace(/(\.[^.]+)$/, "-cut$1") ?? "";
    }
    this.source = source;
    this.showCut();
  }

  showCut() {
    const [from, to] = this.cut;
    write(part("cut-from-time", HTMLElement), seconds(from));
    write(part("cut-to-time", HTMLElement), seconds(to));
    const ready = this.source !== null && from !== null && to !== null;
    part("cut-write", HTMLButtonElement).disabled = !ready;
    write(part("cut-why", HTMLElement), this.source === null ? "Open a recording first: a cut writes a part of a recording to a file." : "");
  }

  write() {
    const [start_us, stop_us] = this.cut;
    if (start_us === null || stop_us === null) return;
    this.server.ask({ type: "cut", start_us, stop_us, name: part("cut-name", HTMLInputElement).value.trim() });
  }
}
