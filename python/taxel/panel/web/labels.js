// Labels by click: mark, name, move and delete events on the time line.

import { collapsed } from "./clusters.js";
import { paintAs } from "./colours.js";
import { entitle, make, part, write } from "./dom.js";
import { notify, silence } from "./notice.js";
import { counted, integer, listedTime, readTime, seconds, timeUnit } from "./words.js";

/** @typedef {import("./messages.js").LabelRow} LabelRow as the server has it */
/** @typedef {LabelRow & { label_id: number }} Label with a number of this page */
/** @typedef {import("./messages.js").Labels} LabelsMessage */
/** @typedef {{ old?: LabelRow | null, new?: LabelRow | null }} Change */
/** @typedef {import("./server.js").Server} Server */
/** @typedef {import("./settings.js").Settings} Settings */
/** @typedef {import("./timeline.js").Timeline} Timeline */
/** @typedef {import("./player.js").Player} Player */

/** How far an arrow key moves a label, us. */
const STEP_US = 1000;
/** From here on a press is a drag, CSS pixels. */
const DRAG = 4;
/** Levels on which handles are stacked where they would cover each other; more labels than fit are a count. */
const LEVELS = 3;
/** Width of a handle, CSS pixels. */
const HANDLE = { mouse: 11, touch: 16 };
/** What makes a label another one. @param {LabelRow} row */
const keyOf = ({ label, t_us, source, trial, replaces_us }) => JSON.stringify([label, t_us, source, trial, replaces_us]);
/** @param {Label} label @returns {LabelRow} */
const asRow = ({ label, t_us, source, trial, replaces_us }) => ({ label, t_us, source, trial, replaces_us });
/** Width of a letter of a flag's name, CSS pixels, about. */
const LETTER = 7;

/** The lane of flags above the raster, and the tab with all of them. */
export class Labels {
  /**
   * @param {Server} server
   * @param {Settings} settings
   * @param {Player} player
   * @param {() => Timeline | null} timeline
   * @param {(error: unknown) => void} failed
   * @param {() => void} shown called to bring the tab to the front
   * @param {(from_us: number, to_us: number) => void} closer called to show a stretch of time
   * @param {(file: string) => void} counted called when the number of a recording's labels may have changed
   */
  constructor(server, settings, player, timeline, failed, shown, closer, counted) {
    this.server = server;
    this.settings = settings;
    this.player = player;
    this.timeline = timeline;
    this.failed = failed;
    this.shown = shown;
    this.closer = closer;
    this.counted = counted;
    /** @type {Map<string, { path: string, labels: Label[] }>} by recording */
    this.files = new Map();
    this.last_id = 0;
    /** What labels become by the changes that are under way, by their numbers. @type {Map<number, string>} */
    this.becoming = new Map();
    /** The recording whose labels are shown. @type {string | null} */
    this.file = null;
    /** Its trial, where the file holds several. @type {string | null} */
    this.trial = null;
    /** @type {Map<number, HTMLButtonElement>} */
    this.flags = new Map();
    /** The counts of flags that would cover each other. @type {HTMLButtonElement[]} */
    this.counts = [];
    /** The rows of the list, with what each was made for. @type {Map<number, { made: string, row: HTMLElement }>} */
    this.rows = new Map();
    /** The notice that offers to take a deletion back. */
    this.offered = "";
    /** The answer to the last change: the next one that is taken back is that of after it. @type {Promise<unknown>} */
    this.saved = Promise.resolve();
    /** @type {number | null} */
    this.chosen = null;
    /** The name that was marked by the last click. */
    this.clicked = "";
    /** Time of a click that was made before a label name was typed; the label is set when there is a name. @type {number | null} */
    this.waiting_us = null;
    /** The one being dragged, and where to. @type {{ label_id: number, t_us: number } | null} */
    this.dragged = null;
    this.name = part("label-name", HTMLInputElement);
    this.name.value = settings.values.label;
    /** Whether the name is one for the recording that is shown: offered by its labels, or typed. */
    this.named = false;
    this.name.oninput = () => {
      this.named = true;
      settings.set("label", this.name.value);
    };
    this.lane = part("label-lane", HTMLElement);
    let from = 0;
    this.lane.addEventListener("pointerdown", (event) => (from = event.clientX));
    this.lane.addEventListener("click", (event) => {
      if (event.target === this.lane && Math.abs(event.clientX - from) < DRAG) this.click(event);
    });
    part("mark", HTMLButtonElement).onclick = () => this.markHere();
    part("label-form", HTMLFormElement).onsubmit = (event) => {
      event.preventDefault();
      if (this.waiting_us === null) this.markHere();
      else this.mark(this.waiting_us);
    };
    new ResizeObserver(() => this.arrange()).observe(this.lane);
  }

  /** @returns {Label[]} of the recording or the trial shown, by time */
  get labels() {
    const all = (this.file && this.files.get(this.file)?.labels) || [];
    return all.filter(({ trial }) => !trial || trial === this.trial);
  }

  /** @param {LabelsMessage} message */
  take({ name, path, labels }) {
    // A label that was there, or that one becomes, keeps its number.
    const before = this.files.get(name)?.labels ?? [];
    const known = new Map(before.map((label) => [keyOf(label), label.label_id]));
    for (const [id, key] of this.becoming) known.set(key, id);
    const numbered = labels.map((row) => {
      const key = keyOf(row);
      const label_id = known.get(key) ?? ++this.last_id;
      known.delete(key);
      return { ...row, label_id };
    });
    this.files.set(name, { path, labels: numbered.sort((a, b) => a.t_us - b.t_us) });
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
    this.chosen = this.waiting_us = null;
    this.named = false;
    this.show();
  }

  /** Offers the name of the last label, where none has the name that was typed for another recording. */
  offerName() {
    const last = this.labels.at(-1);
    if (this.named || !last) return;
    this.named = true;
    if (!this.labels.some(({ label }) => label === this.name.value.trim())) this.name.value = last.label;
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

  /** Marks where the pointer is; the second click of a double one is no label of its own. @param {MouseEvent} event */
  click({ clientX, detail }) {
    const name = this.name.value.trim();
    if (detail < 2 || name !== this.clicked) this.mark(this.timeAt(clientX));
    this.clicked = name;
  }

  /** Marks at the cursor, or at the time shown. */
  markHere() {
    this.player.timeToMark(this.timeline()?.cursor_us).then((t_us) => this.mark(t_us));
  }

  /** @param {number | null} t_us */
  mark(t_us) {
    const label = this.name.value.trim();
    this.waiting_us = label ? null : t_us;
    if (!label) {
      this.shown();
      this.name.focus();
      notify("type the label's name, then Enter");
      return;
    }
    if (t_us !== null) this.add({ label, t_us });
  }

  /** Asks for a request about labels; the tab says so until there is an answer. @param {import("./messages.js").Request} message */
  save(message) {
    silence(this.offered);
    const answer = this.server.request(message).finally(() => this.showPlace());
    this.saved = answer.catch(() => {});
    this.showPlace();
    return answer;
  }

  /** Asks for changes of labels, all or none. @param {Change[]} changes */
  change(changes) {
    return this.save({ type: "change", changes });
  }

  /** Takes back the last change of labels that was made in this window. */
  undo() {
    // The server takes back what it has carried out.
    this.saved = this.saved.then(() => this.save({ type: "undo" })).then(() => notify("undid the last change of labels"), this.failed);
  }

  /** Makes a label and chooses it. @param {{ label: string, t_us: number }} label */
  add({ label, t_us }) {
    const before = new Set(this.labels.map(({ label_id }) => label_id));
    this.change([{ new: { label, t_us: Math.round(t_us), source: "", trial: "", replaces_us: null } }]).then(() => {
      this.chosen = this.labels.find(({ label_id }) => !before.has(label_id))?.label_id ?? this.chosen;
      this.show();
    }, this.failed);
  }

  /** Changes a label, which keeps its number. @param {number} label_id @param {Partial<LabelRow>} by */
  async alter(label_id, by) {
    // The server knows the label as the change before leaves it.
    await this.saved;
    const label = this.labels.find((known) => known.label_id === label_id);
    if (!label) throw new Error("this label was deleted");
    const altered = { ...asRow(label), ...by };
    this.becoming.set(label_id, keyOf(altered));
    try {
      await this.change([{ old: asRow(label), new: altered }]);
    } finally {
      this.becoming.delete(label_id);
    }
  }

  /** @param {number} label_id @param {number} t_us */
  move(label_id, t_us) {
    this.alter(label_id, { t_us: Math.round(t_us) }).catch((error) => {
      this.failed(error);
      this.show();
    });
  }

  /** @param {number} label_id */
  remove(label_id) {
    const gone = this.labels.find((label) => label.label_id === label_id);
    if (!gone) return;
    this.change([{ old: asRow(gone) }]).then(() => this.offerUndo(`deleted ${gone.label} at ${seconds(gone.t_us)}`), this.failed);
  }

  /** Says what was changed, and offers to take it back. @param {string} text */
  offerUndo(text) {
    this.offered = text;
    notify(text, false, { text: "Undo", action: () => this.undo() });
  }

  /** @param {number} by 1: the next label after the time shown, -1: the one before */
  go(by) {
    const now = this.player.targetTime ?? 0;
    const others = this.labels.filter(({ t_us }) => (by > 0 ? t_us > now : t_us < now));
    const next = by > 0 ? others[0] : others[others.length - 1];
    if (!next) return;
    this.chosen = next.label_id;
    this.player.seek(next.t_us);
    this.show();
  }

  /** Deletes the label that was chosen last. */
  removeChosen() {
    if (this.chosen !== null) this.remove(this.chosen);
  }

  /** Writes the list and puts up the flags. */
  show() {
    const { labels } = this;
    this.offerName();
    write(part("label-count", HTMLElement), this.file ? counted(labels.length, "label") : "");
    this.lane.dataset.hint = this.file ? "Labels: click here to add a label" : "Labels: open or start a recording first";
    this.showPlace();
    part("train-line", HTMLElement).hidden = !labels.length;
    // Who has made labels knows how, and needs the room.
    part("label-how", HTMLElement).hidden = labels.length > 0;
    const list = part("label-list", HTMLElement);
    // A row in which a person types stays what it is.
    const typing = list.contains(document.activeElement) ? document.activeElement?.closest("li")?.dataset.id : undefined;
    const edited = typing === undefined ? null : list.querySelector(`li[data-id="${CSS.escape(typing)}"]`);
    const rows = labels.map((label) => (edited instanceof HTMLElement && edited.dataset.id === String(label.label_id) ? edited : this.rowOf(label)));
    const ids = new Set(labels.map(({ label_id }) => label_id));
    for (const id of this.rows.keys()) if (!ids.has(id)) this.rows.delete(id);
    if (rows.length !== list.children.length || rows.some((row, i) => row !== list.children[i])) {
      const focused = document.activeElement;
      list.replaceChildren(...rows);
      if (edited && focused instanceof HTMLElement) focused.focus();
    }
    for (const row of rows) row.classList.toggle("chosen", row.dataset.id === String(this.chosen));
    this.arrange();
  }

  /** Says where the labels are saved, or that they are being saved. */
  showPlace() {
    const table = this.file ? this.files.get(this.file) : undefined;
    const how = this.server.saves ? "Saving" : table?.labels.length ? "Saved" : "To be saved";
    write(part("label-place", HTMLElement), table ? `${how} in ${table.path}` : "Open or start a recording, then label its events.");
  }

  /** The row of a label, made again only where it is another. @param {Label} label @returns {HTMLElement} */
  rowOf(label) {
    const made = JSON.stringify([label, timeUnit()]);
    let known = this.rows.get(label.label_id);
    if (known?.made !== made) this.rows.set(label.label_id, (known = { made, row: this.row(label) }));
    return known.row;
  }

  /** @param {Label} label @returns {HTMLElement} */
  row({ label_id, label, t_us, source }) {
    const name = make("input", { type: "text", value: label, "aria-label": `name of the label at ${seconds(t_us)}`, maxlength: 200, list: "label-names" });
    const time = make("input", { type: "text", inputmode: "decimal", value: listedTime(t_us), "aria-label": `time of ${label}, ${timeUnit()}` });
    const go = make("button", { type: "button", class: "small", "aria-label": `go to ${label}, ${seconds(t_us)}` }, "Go");
    const away = make("button", { type: "button", class: "small", "aria-label": `delete ${label}, ${seconds(t_us)}` }, "×");
    // The row is older than a label whose time was just typed.
    const stored = () => this.labels.find((known) => known.label_id === label_id) ?? { label, t_us };
    const [heldName, heldTime] = [() => stored().label, () => listedTime(stored().t_us)];
    name.onchange = () => this.typed(name, label_id, { label: name.value.trim() }, heldName);
    time.onchange = () => {
      const wanted = readTime(time.value);
      if (Number.isFinite(wanted)) this.typed(time, label_id, { t_us: wanted }, heldTime);
      else this.refused(time, heldTime, new Error(`${time.value} is not a number of ${timeUnit()}`));
    };
    go.onclick = () => {
      this.chosen = label_id;
      this.player.seek(stored().t_us);
      this.show();
    };
    away.onclick = () => this.remove(label_id);
    const row = make("li", {}, name, time, make("span", { class: "unit" }, timeUnit() === "seconds" ? "s" : ""), go, away, ...(source ? [make("span", { class: "source" }, source)] : []));
    row.dataset.id = String(label_id);
    paintAs(row, label);
    return row;
  }

  /** Asks for what was typed. @param {HTMLInputElement} input @param {number} label_id @param {Partial<LabelRow>} by @param {() => string} stored */
  async typed(input, label_id, by, stored) {
    try {
      await this.alter(label_id, by);
      if (input.hasAttribute("aria-invalid")) silence();
      this.holds(input, stored());
    } catch (error) {
      this.refused(input, stored, error);
    }
  }

  /** @param {HTMLInputElement} input @param {string} value what the label holds */
  holds(input, value) {
    input.value = value;
    input.removeAttribute("aria-invalid");
    input.onkeydown = null;
  }

  /** @param {HTMLInputElement} input @param {() => string} stored what the label holds @param {unknown} error */
  refused(input, stored, error) {
    this.failed(error);
    input.setAttribute("aria-invalid", "true");
    input.onkeydown = (event) => {
      if (event.key !== "Escape") return;
      this.holds(input, stored());
      event.stopPropagation();
    };
  }

  /** Puts each flag in the window where its time is; its handle on the first level where it covers no other. More than have levels are a count. */
  arrange() {
    const timeline = this.timeline();
    const { clientWidth } = this.lane;
    const handle = HANDLE[matchMedia("(max-width: 860px)").matches ? "touch" : "mouse"];
    const inside = this.labels.flatMap((label) => {
      const t_us = this.dragged?.label_id === label.label_id ? this.dragged.t_us : label.t_us;
      const share = timeline?.share(t_us) ?? null;
      return share === null ? [] : [{ ...label, t_us, x: share * clientWidth }];
    });
    const { single, counts } = collapsed(inside.filter(({ label_id }) => label_id !== this.chosen), handle, LEVELS);
    const flagged = [...single, ...inside.filter(({ label_id }) => label_id === this.chosen)].sort((a, b) => a.x - b.x);
    this.arrangeFlags(flagged, handle, clientWidth);
    while (this.counts.length > counts.length) this.counts.pop()?.remove();
    while (this.counts.length < counts.length) {
      const count = make("button", { type: "button", class: "count" });
      this.counts.push(count);
      this.lane.append(count);
    }
    counts.forEach(({ from, to, marks }, i) => {
      const count = this.counts[i];
      const [first, last] = [marks[0].t_us, marks[marks.length - 1].t_us];
      write(count, integer(marks.length));
      const name = `${counted(marks.length, "label")} from ${seconds(first)} to ${seconds(last)}: zoom in`;
      entitle(count, "aria-label", name);
      entitle(count, "title", name);
      count.style.left = `${from.toFixed(1)}px`;
      count.style.width = `${(to - from + handle).toFixed(1)}px`;
      count.onclick = () => this.closer(first, last);
    });
  }

  /** @param {(Label & { x: number })[]} flagged by time @param {number} handle width of a handle @param {number} wide of the lane, CSS pixels */
  arrangeFlags(flagged, handle, wide) {
    const seen = new Set();
    /** @type {number[]} where the last handle of each level ends */
    const ends = new Array(LEVELS).fill(-Infinity);
    flagged.forEach(({ label_id, label, t_us, x }, i) => {
      seen.add(label_id);
      let flag = this.flags.get(label_id);
      if (!flag) {
        flag = this.flag(label_id);
        this.flags.set(label_id, flag);
        this.lane.append(flag);
      }
      const level = ends.findIndex((end) => end <= x);
      if (level >= 0) ends[level] = x + handle;
      // The name stands where no other handle of its level follows.
      const next = flagged.slice(i + 1, i + 1 + LEVELS).reduce((least, later) => Math.min(least, later.x), wide + handle);
      const named = level === 0 && next - x > handle + LETTER * Math.min(label.length, 14);
      if (named) ends.fill(x + handle + LETTER * Math.min(label.length, 14));
      flag.style.left = `${((100 * x) / wide).toFixed(3)}%`;
      flag.dataset.level = String(level);
      flag.classList.toggle("line", level < 0 && label_id !== this.chosen);
      write(/** @type {HTMLElement} */ (flag.lastElementChild), named ? label : "");
      const name = `label ${label} at ${seconds(t_us)}`;
      entitle(flag, "aria-label", name);
      entitle(flag, "title", name);
      flag.classList.toggle("chosen", label_id === this.chosen);
      paintAs(flag, label);
    });
    for (const [id, flag] of this.flags) {
      if (seen.has(id)) continue;
      flag.remove();
      this.flags.delete(id);
    }
  }

  /** @param {number} label_id @returns {HTMLButtonElement} */
  flag(label_id) {
    const flag = make("button", { type: "button", class: "flag" }, make("i"), make("span"));
    const current = () => this.labels.find((label) => label.label_id === label_id);
    let from = 0;
    // The pointer holds the handle, which stands beside the label's time.
    let beside_us = 0;
    flag.addEventListener("pointerdown", (event) => {
      from = event.clientX;
      beside_us = (current()?.t_us ?? 0) - (this.timeAt(from) ?? 0);
      flag.setPointerCapture(event.pointerId);
    });
    flag.addEventListener("pointermove", (event) => {
      if (!flag.hasPointerCapture(event.pointerId)) return;
      if (!this.dragged && !(Math.abs(event.clientX - from) >= DRAG)) return;
      const t_us = this.timeAt(event.clientX);
      if (t_us === null) return;
      this.dragged = { label_id, t_us: t_us + beside_us };
      this.arrange();
    });
    flag.addEventListener("pointerup", () => {
      const { dragged } = this;
      this.dragged = null;
      this.chosen = label_id;
      if (dragged) this.move(label_id, dragged.t_us);
      else this.shown();
      this.show();
    });
    flag.addEventListener("pointercancel", () => {
      this.dragged = null;
      this.arrange();
    });
    flag.addEventListener("focus", () => {
      this.chosen = label_id;
      this.show();
    });
    flag.addEventListener("keydown", (event) => {
      const label = current();
      if (event.key === "Escape" && this.dragged) {
        // The press goes on, but moves nothing.
        this.dragged = null;
        from = NaN;
        return this.arrange();
      }
      if (!label || event.ctrlKey || event.altKey || event.metaKey) return;
      const far = event.shiftKey ? 100 * STEP_US : STEP_US;
      if (event.key === "ArrowLeft") this.move(label_id, label.t_us - far);
      else if (event.key === "ArrowRight") this.move(label_id, label.t_us + far);
      else if (event.key === "Delete" || event.key === "Backspace") this.remove(label_id);
      else if (event.key === "Enter") {
        this.shown();
        const input = part("label-list", HTMLElement).querySelector(`li[data-id="${label_id}"] input`);
        if (input instanceof HTMLElement) input.focus();
      } else return;
      event.preventDefault();
      event.stopPropagation();
    });
    return flag;
  }
}
