// The notes that a recording holds itself: listed, shown in time, and used as labels.

import { make, part, write } from "./dom.js";
import { failed } from "./notice.js";
import { counted, seconds } from "./words.js";

/** @typedef {import("./labels.js").Labels} Labels */
/** @typedef {import("./player.js").Player} Player */
/** @typedef {import("./messages.js").RecordedNote} RecordedNote */

/** The list of notes, and the button that makes labels of those with a time. */
export class Notes {
  /**
   * @param {Player} player
   * @param {Labels} labels
   */
  constructor(player, labels) {
    this.player = player;
    this.labels = labels;
    /** @type {RecordedNote[]} */
    this.notes = [];
    this.button = part("notes-as-labels", HTMLButtonElement);
    this.button.onclick = () => this.use();
  }

  /** @returns {{ t_us: number, text: string, source: string }[]} those with a time; another is about the whole recording */
  get withTime() {
    return this.notes.flatMap(({ t_us, ...note }) => (t_us === null ? [] : [{ t_us, ...note }]));
  }

  /** Those with a time that are no labels yet. */
  get unused() {
    const { labels } = this.labels;
    const used = (/** @type {{ t_us: number, text: string, source: string }} */ { t_us, text, source }) =>
      labels.some((label) => label.source === source && (label.replaces_us === t_us || (label.t_us === t_us && label.label === text)));
    return this.withTime.filter((note) => !used(note));
  }

  /** @param {RecordedNote[]} notes of the recording that is shown */
  choose(notes) {
    this.notes = notes;
    part("notes-block", HTMLElement).hidden = !notes.length;
    part("note-list", HTMLElement).replaceChildren(
      ...notes.map(({ t_us, text, source }) => {
        const named = source ? `${text}, ${source}` : text;
        if (t_us === null) return make("li", {}, named);
        const button = make("button", { type: "button", class: "link" }, `${seconds(t_us)}  ${named}`);
        button.onclick = () => this.player.seek(t_us);
        return make("li", {}, button);
      }),
    );
    this.show();
  }

  /** Shows the button where there is something to use. */
  show() {
    const { length } = this.unused;
    this.button.hidden = !length;
    write(this.button, `Use as labels (${length})`);
  }

  /** Makes labels of all of them, or of none. */
  async use() {
    const { unused } = this;
    this.button.disabled = true;
    const changes = unused.map(({ t_us, text, source }) => ({ new: { label: text, t_us, source, trial: "", replaces_us: t_us } }));
    await this.labels.change(changes).then(() => this.labels.offerUndo(`${counted(unused.length, "note")} used as labels`), failed);
    this.button.disabled = false;
    this.show();
  }
}
