// A table of labels that another program has saved without what was set on the page: both versions, and the choice between them.

import { make, part, write } from "./dom.js";
import { notify, silence } from "./notice.js";
import { counted, listedTime, seconds, timeUnit } from "./words.js";

/** @typedef {import("./messages.js").LabelRow} ConflictRow */
/** @typedef {import("./messages.js").Labels} LabelsMessage */
/** @typedef {import("./server.js").Server} Server */

/** @param {number} t_us @returns {string} */
const at = (t_us) => (timeUnit() === "seconds" ? `${listedTime(t_us)} s` : seconds(t_us));

/** @param {ConflictRow} row @returns {string} */
function described({ label, t_us, source, trial, replaces_us }) {
  const labelAndTime = label ? `${label}, ${at(t_us)}` : `no label for the note at ${at(replaces_us ?? t_us)}`;
  return [labelAndTime, source, trial].filter(Boolean).join(", ");
}

/** The block above the list of labels, while there is a conflict. */
export class LabelConflict {
  /**
   * @param {Server} server
   * @param {(error: unknown) => void} failed
   * @param {() => void} shown called to bring the tab to the front
   */
  constructor(server, failed, shown) {
    this.shown = shown;
    this.block = part("label-conflict", HTMLElement);
    /** The conflict that is shown. @type {number | null} */
    this.id = null;
    /** The text of its notice. */
    this.notice = "";
    this.buttons = [part("conflict-restore", HTMLButtonElement), part("conflict-accept", HTMLButtonElement)];
    this.buttons.forEach((button, i) => {
      button.onclick = () => {
        if (this.id === null) return;
        for (const choice of this.buttons) choice.disabled = true;
        server.request({ type: "settle", conflict_id: this.id, keep: i ? "file" : "acknowledged" }).catch(failed).then(() => this.buttons.forEach((choice) => (choice.disabled = false)));
      };
    });
  }

  /** @param {LabelsMessage | undefined} message of the recording that is shown */
  show(message) {
    const conflict = message?.conflict ?? null;
    this.block.hidden = conflict === null;
    if (!message || conflict === null || conflict.conflict_id === this.id) {
      if (conflict === null && this.id !== null) {
        this.id = null;
        silence(this.notice);
      }
      return;
    }
    this.id = conflict.conflict_id;
    const { missing, returned, new: added } = conflict;
    const were = (/** @type {number} */ count) => (count === 1 ? "was" : "were");
    const lacks = missing.length ? `lacks ${counted(missing.length, "label")} that ${were(missing.length)} set on the page` : "";
    const again = returned.length ? `has ${counted(returned.length, "label")} again that ${were(returned.length)} deleted or changed on the page` : "";
    const change = `Another program saved ${message.path}: the file ${[lacks, again].filter(Boolean).join(", and ")}.`;
    write(part("conflict-text", HTMLElement), `${change} Choose the version to keep.${added.length ? " New labels of the file stay in both." : ""}`);
    const line = (/** @type {string} */ acknowledged, /** @type {string} */ file, /** @type {string} */ kind) =>
      make("tr", { class: kind }, make("td", {}, acknowledged), make("td", {}, file));
    part("conflict-rows", HTMLElement).replaceChildren(
      ...missing.map((row) => line(described(row), "missing", "missing")),
      ...returned.map((row) => line("deleted or changed", described(row), "returned")),
      ...added.map((row) => line("–", `${described(row)} (new)`, "new")),
    );
    this.notice = change;
    notify(change, true, { text: "Look", action: () => this.look() });
  }

  /** Brings the block to the front. */
  look() {
    this.shown();
    this.block.scrollIntoView({ block: "nearest" });
    this.buttons[0].focus();
  }
}
