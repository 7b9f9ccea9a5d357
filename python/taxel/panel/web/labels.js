// Labels by click: mark, name, move and delete events on the time line.

import { paintAs } from "./colours.js";
import { entitle, make, part, withChildren, write } from "./dom.js";
import { failed, notify, silence } from "./notice.js";
import { counted, listedTime, numbering, readTime, seconds, timeUnit } from "./words.js";

/** @typedef {import("./messages.js").LabelRow} Label */
/** @typedef {import("./messages.js").Labels} LabelsMessage */
/** @typedef {{ old?: Label | null, new?: Label | null }} Change */
/** @typedef {import("./server.js").Server} Server */
/** @typedef {import("./settings.js").Settings} Settings */
/** @typedef {import("./timeline.js").Timeline} Timeline */
/** @typedef {import("./player.js").Player} Player */

/** How far an arrow key moves a label, us. */
const STEP_US = 1000;
/** From here on a press is a drag, CSS pixels. */
const DRAG = 4;
/** Levels on which handles are stacked where they would cover each other; more labels than fit are lines. */
const LEVELS = 3;
/** Width of a handle, CSS pixels. */
const HANDLE = { mouse: 11, touch: 16 };
/** Width of a letter of a flag's name, CSS pixels, about. */
const LETTER = 7;

/** What makes a label another one. @param {Label} row */
const keyOf = ({ label, t_us, source, trial, replaces_us }) => JSON.stringify([label, t_us, source, trial, replaces_us]);
/** @param {number} t_us @returns {number} a time that a label can have: that of a frame, where frames are numbered */
const timeOfLabel = (t_us) => (numbering.number_us ? Math.floor(t_us / numbering.number_us) * numbering.number_us : Math.round(t_us));

/** The lane of flags above the raster, and the tab with all of them. */
export class Labels {
  /**
   * @param {Server} server
   * @param {Settings} settings
   * @param {Player} player
   * @param {() => Timeline | null} timeline
   * @param {() => void} shown called to bring the tab to the front
   * @param {(file: string) => void} counted called when the number of a recording's labels may have changed
   */
  constructor(server, settings, player, timeline, shown, counted) {
    this.server = server;
    this.player = player;
    this.timeline = timeline;
    this.shown = shown;
    this.counted = counted;
    /** @type {Map<string, { path: string, labels: Label[] }>} by recording */
    this.files = new Map();
    /** The recording whose labels are shown. @type {string | null} */
    this.file = null;
    /** Its trial, where the file holds several. @type {string | null} */
    this.trial = null;
    /** The labels whose flags are up, from left to right. @type {Label[]} */
    this.flagged = [];
    /** The notice that offers to take a deletion back. */
    this.offered = "";
    /** The chosen label, as the changes that were asked for leave it. @type {Label | null} */
    this.chosen = null;
    /** Where it is dragged to. @type {number | null} */
    this.dragged_us = null;
    /** Whether the flag of the chosen label gets the keyboard's focus when it is up: its arrow keys move it. */
    this.focuses = false;
    /** The label that is in the form. @type {Label | null} */
    this.edited = null;
    this.name = part("label-name", HTMLInputElement);
    this.name.value = settings.values.label;
    this.name.oninput = () => settings.set("label", this.name.value);
    this.lane = part("label-lane", HTMLElement);
    let from = 0;
    this.lane.addEventListener("pointerdown", (event) => (from = event.clientX));
    this.lane.addEventListener("click", (event) => {
      // The second click of a double one is no label of its own.
      if (event.target === this.lane && event.detail < 2 && Math.abs(event.clientX - from) < DRAG) this.mark(this.timeAt(event.clientX));
    });
    part("label-form", HTMLFormElement).onsubmit = (event) => {
      event.preventDefault();
      this.markHere();
    };
    const form = part("chosen-form", HTMLFormElement);
    form.onsubmit = (event) => event.preventDefault();
    form.onchange = () => this.edit();
    part("chosen-delete", HTMLButtonElement).onclick = () => this.removeChosen();
    new ResizeObserver(() => this.arrange()).observe(this.lane);
  }

  /** @returns {Label[]} of the recording or the trial shown, by time */
  get labels() {
    const all = (this.file && this.files.get(this.file)?.labels) || [];
    return all.filter(({ trial }) => !trial || trial === this.trial);
  }

  /** @param {LabelsMessage} message */
  take({ name, path, labels }) {
    this.files.set(name, { path, labels: labels.sort((a, b) => a.t_us - b.t_us) });
    if (name === this.file) this.show();
    this.counted(name);
  }

  /** @param {string} file @returns {number | null} how many labels it has, where they have been read */
  count(file) {
    return this.files.get(file)?.labels.length ?? null;
  }

  /** @param {string | null} file @param {string | null} [trial] where the file holds several */
  choose(file, trial = null) {
    if (this.file === file && this.trial === trial) return;
    [this.file, this.trial] = [file, trial];
    this.chosen = null;
    this.show();
  }

  /** @param {string[]} names to offer: the readout's, and those used */
  offer(names) {
    const known = new Set([...names, ...this.labels.map(({ label }) => label)]);
    part("label-names", HTMLElement).replaceChildren(...[...known].sort().map((value) => make("option", { value })));
  }

  /** @param {number} clientX @returns {number | null} */
  timeAt(clientX) {
    const box = this.lane.getBoundingClientRect();
    const t_us = this.timeline()?.time(Math.max(0, Math.min(1, (clientX - box.left) / box.width))) ?? null;
    const reach = this.player.transport.source === null ? null : this.player.reach;
    // The columns of time go a little beyond the recording.
    return t_us === null || !reach ? t_us : Math.max(reach[0], Math.min(reach[1], t_us));
  }

  /** Marks at the cursor, or at the time shown. */
  markHere() {
    this.mark(this.timeline()?.cursor_us ?? this.player.targetTime);
  }

  /** Makes a label and chooses it. @param {number | null} t_us */
  mark(t_us) {
    const label = this.name.value.trim();
    if (!label) {
      this.shown();
      this.name.focus();
      return notify("type the label's name first");
    }
    if (t_us !== null) this.put(null, { label, t_us: timeOfLabel(t_us), source: "", trial: this.trial ?? "", replaces_us: null });
  }

  /** Asks for changes of labels, all or none. @param {Change[]} changes */
  change(changes) {
    silence(this.offered);
    return this.server.request({ type: "change", changes });
  }

  /** Takes back the last change of labels that was made in this window. */
  undo() {
    silence(this.offered);
    this.server.request({ type: "undo" }).then(() => notify("undid the last change of labels"), failed);
  }

  /** Puts a label in the place of another or of none, and chooses it; the next change is one of it. @param {Label | null} old @param {Label} wanted */
  put(old, wanted) {
    const before = this.chosen;
    this.chosen = wanted;
    this.change([{ old, new: wanted }]).catch((error) => {
      if (this.chosen === wanted) this.chosen = before;
      this.edited = null;
      failed(error);
      this.show();
    });
  }

  /** Changes the chosen label. @param {Partial<Label>} by */
  alter(by) {
    if (!this.chosen) return;
    const wanted = { ...this.chosen, ...by };
    if (keyOf(wanted) !== keyOf(this.chosen)) this.put(this.chosen, wanted);
  }

  /** Changes the chosen label to what was typed. */
  edit() {
    const time = part("chosen-time", HTMLInputElement).value;
    const t_us = readTime(time);
    if (Number.isFinite(t_us)) return this.alter({ label: part("chosen-name", HTMLInputElement).value.trim(), t_us });
    failed(new Error(`${time} is not a number of ${timeUnit()}`));
    this.edited = null;
    return this.show();
  }

  /** @param {Label} gone */
  remove(gone) {
    if (this.isChosen(gone)) this.chosen = null;
    this.change([{ old: gone }]).then(() => this.offerUndo(`deleted ${gone.label} at ${seconds(gone.t_us)}`), failed);
  }

  /** Says what was changed, and offers to take it back. @param {string} text */
  offerUndo(text) {
    this.offered = text;
    notify(text, false, { text: "Undo", action: () => this.undo() });
  }

  /** @param {Label} label */
  isChosen(label) {
    return this.chosen !== null && keyOf(this.chosen) === keyOf(label);
  }

  /** Chooses a label, and shows its time. @param {Label} label */
  goTo(label) {
    this.chosen = label;
    this.player.seek(label.t_us);
    this.show();
  }

  /** @param {number} by 1: the next label after the time shown, -1: the one before */
  go(by) {
    const now = this.player.targetTime ?? 0;
    const others = this.labels.filter(({ t_us }) => (by > 0 ? t_us > now : t_us < now));
    const next = by > 0 ? others[0] : others[others.length - 1];
    if (!next) return;
    this.focuses = true;
    this.goTo(next);
  }

  /** Deletes the chosen label. */
  removeChosen() {
    if (this.chosen !== null) this.remove(this.chosen);
  }

  /** Writes the list and puts up the flags. */
  show() {
    const { labels } = this;
    write(part("label-count", HTMLElement), this.file ? counted(labels.length, "label") : "");
    this.lane.dataset.hint = this.file ? "Labels: click here to add a label" : "Labels: open or start a recording first";
    const table = this.file ? this.files.get(this.file) : undefined;
    write(part("label-place", HTMLElement), table ? `${labels.length ? "Saved" : "To be saved"} in ${table.path}` : "Open or start a recording, then label its events.");
    // A training that runs can be stopped, whatever is shown.
    const train = part("train", HTMLButtonElement);
    train.disabled = !labels.length && train.dataset.state !== "running";
    // Who has made labels knows how, and needs the room.
    part("label-how", HTMLElement).hidden = labels.length > 0;
    const rows = withChildren(part("label-list", HTMLElement), labels.length, (i) => this.row(i));
    labels.forEach((label, i) => {
      const [go, away] = rows[i].children;
      write(go.children[0], label.source ? `${label.label}, ${label.source}` : label.label);
      write(go.children[1], seconds(label.t_us));
      entitle(away, "aria-label", `delete ${label.label}, ${seconds(label.t_us)}`);
      go.setAttribute("aria-current", String(this.isChosen(label)));
      paintAs(rows[i], label.label);
    });
    this.showChosen();
    this.arrange();
  }

  /** Writes the chosen label into the form; what is typed there stays while it is the same. */
  showChosen() {
    const { chosen } = this;
    part("chosen", HTMLFieldSetElement).disabled = chosen === null;
    if (chosen === this.edited && chosen !== null) return;
    this.edited = chosen;
    part("chosen-name", HTMLInputElement).value = chosen?.label ?? "";
    part("chosen-time", HTMLInputElement).value = chosen ? listedTime(chosen.t_us) : "";
    write(part("chosen-unit", HTMLElement), timeUnit() === "seconds" ? "s" : "");
  }

  /** @param {number} i its number in the list @returns {HTMLElement} */
  row(i) {
    const go = make("button", { type: "button", class: "link" }, make("span", { class: "what" }), make("span"));
    const away = make("button", { type: "button", class: "small" }, "×");
    go.onclick = () => this.goTo(this.labels[i]);
    away.onclick = () => this.remove(this.labels[i]);
    return make("li", {}, go, away);
  }

  /** Puts each flag in the window where its time is; its handle on the first level where it covers no other. */
  arrange() {
    const timeline = this.timeline();
    const wide = this.lane.clientWidth;
    const handle = HANDLE[matchMedia("(max-width: 860px)").matches ? "touch" : "mouse"];
    const inside = this.labels.flatMap((label) => {
      const chosen = this.isChosen(label);
      const share = timeline?.share(chosen && this.dragged_us !== null ? this.dragged_us : label.t_us) ?? null;
      return share === null ? [] : [{ label, chosen, x: share * wide }];
    });
    /** @type {number[]} where the last handle of each level ends */
    const ends = new Array(LEVELS).fill(-Infinity);
    const lines = new Set();
    const flags = inside.flatMap(({ label, chosen, x }, i) => {
      const level = ends.findIndex((end) => end <= x);
      // Of lines on one pixel one is seen.
      if (level < 0 && !chosen && lines.has(Math.round(x))) return [];
      lines.add(Math.round(x));
      if (level >= 0) ends[level] = x + handle;
      // The name stands where no other handle of its level follows.
      const next = inside.slice(i + 1, i + 1 + LEVELS).reduce((least, later) => Math.min(least, later.x), wide + handle);
      const length = handle + LETTER * Math.min(label.label.length, 14);
      const named = level === 0 && next - x > length;
      if (named) ends.fill(x + length);
      return [{ label, chosen, x, level, named }];
    });
    this.flagged = flags.map(({ label }) => label);
    const elements = withChildren(this.lane, flags.length, (i) => this.flag(i));
    flags.forEach(({ label, chosen, x, level, named }, i) => {
      const flag = elements[i];
      flag.style.left = `${((100 * x) / wide).toFixed(3)}%`;
      flag.dataset.level = String(level);
      flag.classList.toggle("line", level < 0 && !chosen);
      flag.classList.toggle("chosen", chosen);
      write(/** @type {HTMLElement} */ (flag.lastElementChild), named ? label.label : "");
      const name = `label ${label.label} at ${seconds(label.t_us)}`;
      entitle(flag, "aria-label", name);
      entitle(flag, "title", name);
      paintAs(flag, label.label);
      if (chosen && this.dragged_us === null && (this.focuses || this.lane.contains(document.activeElement))) {
        this.focuses = false;
        flag.focus();
      }
    });
  }

  /** @param {number} i its number in the lane @returns {HTMLButtonElement} */
  flag(i) {
    const flag = make("button", { type: "button", class: "flag" }, make("i"), make("span"));
    let from = 0;
    // The pointer holds the handle, which stands beside the label's time.
    let beside_us = 0;
    const choose = () => {
      if (this.isChosen(this.flagged[i])) return;
      this.chosen = this.flagged[i];
      this.show();
    };
    flag.addEventListener("focus", choose);
    flag.addEventListener("pointerdown", (event) => {
      choose();
      from = event.clientX;
      beside_us = this.flagged[i].t_us - (this.timeAt(from) ?? 0);
      flag.setPointerCapture(event.pointerId);
    });
    flag.addEventListener("pointermove", (event) => {
      if (!flag.hasPointerCapture(event.pointerId) || (this.dragged_us === null && !(Math.abs(event.clientX - from) >= DRAG))) return;
      const t_us = this.timeAt(event.clientX);
      if (t_us === null) return;
      this.dragged_us = t_us + beside_us;
      this.arrange();
    });
    flag.addEventListener("pointerup", () => {
      const { dragged_us } = this;
      this.dragged_us = null;
      if (dragged_us === null) this.shown();
      else this.alter({ t_us: timeOfLabel(dragged_us) });
      this.show();
    });
    flag.addEventListener("pointercancel", () => {
      this.dragged_us = null;
      this.arrange();
    });
    flag.addEventListener("keydown", (event) => {
      if (event.key === "Escape" && this.dragged_us !== null) {
        // The press goes on, but moves nothing.
        this.dragged_us = null;
        from = NaN;
        return this.arrange();
      }
      if (!this.chosen || event.ctrlKey || event.altKey || event.metaKey) return;
      const far = (numbering.number_us ?? STEP_US) * (event.shiftKey ? 100 : 1);
      if (event.key === "ArrowLeft") this.alter({ t_us: this.chosen.t_us - far });
      else if (event.key === "ArrowRight") this.alter({ t_us: this.chosen.t_us + far });
      else if (event.key === "Delete" || event.key === "Backspace") this.removeChosen();
      else if (event.key === "Enter") {
        this.shown();
        part("chosen-name", HTMLInputElement).focus();
      } else return;
      event.preventDefault();
      event.stopPropagation();
    });
    return flag;
  }
}
