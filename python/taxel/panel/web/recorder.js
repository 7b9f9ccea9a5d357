// Recording: name whose number moves on, length, label of the trial.

import { make, part, write } from "./dom.js";
import { failed } from "./notice.js";
import { counted, size } from "./words.js";

/** @typedef {import("./messages.js").Recorder} RecorderMessage */
/** @typedef {import("./messages.js").Recordings} Recordings */
/** @typedef {import("./server.js").Server} Server */

/** @param {number | null} labels @returns {string[]} */
const labelled = (labels) => (labels ? [counted(labels, "label")] : []);

/** The tab of recordings, and the button at the foot of the page. */
export class Recorder {
  /**
   * @param {Server} server
   * @param {() => void} shown called to bring the tab to the front
   */
  constructor(server, shown) {
    this.server = server;
    this.shown = shown;
    this.able = false;
    /** @type {RecorderMessage | null} */
    this.status = null;
    this.button = part("record", HTMLButtonElement);
    this.button.onclick = () => this.toggle();
    part("record-form", HTMLFormElement).onsubmit = (event) => {
      event.preventDefault();
      this.toggle();
    };
    part("note-form", HTMLFormElement).onsubmit = (event) => {
      event.preventDefault();
      const text = part("note", HTMLInputElement);
      server.request({ type: "note", text: text.value.trim() }).then(() => {
        text.value = "";
      }, failed);
    };
  }

  /** @returns {string | null} the file that is being recorded */
  get file() {
    return this.status !== null && this.busy ? this.status.file : null;
  }

  get busy() {
    return this.status !== null && this.status.state !== "idle";
  }

  /** Starts, or ends what runs. */
  toggle() {
    if (!this.able) return;
    if (this.busy) return this.server.ask({ type: "stop" });
    part("record-reason", HTMLElement).hidden = true;
    const [name, label, length] = ["record-name", "record-label", "record-length"].map((id) => part(id, HTMLInputElement).value.trim());
    const length_s = length ? Number(length.replace(",", ".")) : null;
    if (Number.isNaN(length_s)) return this.refuse(`length: ${length} is not a number`);
    /** @type {import("./messages.js").RecordRequest} */
    const message = { type: "record", name, length_s, label: label || null };
    this.server.request(message).catch((error) => this.refuse(error.message));
  }

  /** @param {string} reason why nothing is recorded */
  refuse(reason) {
    this.shown();
    const output = part("record-reason", HTMLElement);
    output.hidden = false;
    write(output, reason);
  }

  /** @param {RecorderMessage} status */
  take(status) {
    const before = this.status;
    this.status = status;
    const { state, error } = status;
    // The number moves on by itself; a name that a person is typing stays.
    const name = part("record-name", HTMLInputElement);
    if (before?.state === "finishing" && state === "idle" && !error && document.activeElement !== name) {
      name.value = name.value.trim().replace(/\d+$/, (number) => String(Number(number) + 1).padStart(number.length, "0"));
    }
    this.button.dataset.state = state;
    write(part("record-word", HTMLElement), { idle: "Record", recording: "Stop", finishing: "Saving" }[state]);
    write(part("record-start", HTMLButtonElement), this.busy ? "Stop (R)" : "Record (R)");
    const reason = part("record-reason", HTMLElement);
    if (error || this.busy) {
      reason.hidden = !error;
      write(reason, error ?? "");
    }
    part("note-form", HTMLElement).hidden = state !== "recording";
    const last = part("record-last", HTMLElement);
    last.hidden = !status.last;
    if (status.last) {
      write(part("record-last-file", HTMLElement), status.last.file);
      write(part("record-last-verdict", HTMLElement), status.last.verdict);
    }
    this.write();
    const info = part("recorder-info", HTMLElement);
    if (before?.state !== state) write(info, state === "recording" ? `recording ${status.file ?? ""}` : state === "idle" && before ? "stopped, saved" : "");
  }

  /** Writes what runs. */
  write() {
    const { status } = this;
    const big = part("record-state", HTMLElement);
    const more = part("record-more", HTMLElement);
    const bar = part("record-bar", HTMLProgressElement);
    part("record-form", HTMLElement).hidden = !this.able;
    if (!status || status.state === "idle") {
      write(big, this.able ? "Ready" : "No board");
      write(more, this.able ? "" : "is connected: start taxel live --panel to record");
      bar.hidden = true;
      return;
    }
    const { state, seconds, length_s, file } = status;
    write(big, state === "recording" ? `${(seconds ?? 0).toFixed(0)} s` : "Saving");
    write(more, [file, status.label].filter(Boolean).join(" · "));
    bar.hidden = !(state === "recording" && length_s);
    if (length_s && seconds !== null) bar.value = Math.min(1, seconds / length_s);
  }

  /** @param {Recordings} message @param {string | null} open @param {(file: string) => number | null} count labels that the page knows */
  list(message, open, count) {
    const select = part("files", HTMLSelectElement);
    const files = [...message.files].sort((a, b) => b.modified_ns - a.modified_ns);
    const option = (/** @type {typeof files[0]} */ { name, bytes, labels }) =>
      make("option", { value: name }, `${name} (${[size(bytes), ...labelled(count(name) ?? labels)].join(", ")})`);
    const first = make("option", { value: "" }, files.length ? "Open a recording…" : "No recordings yet");
    select.replaceChildren(first, ...files.map(option));
    select.value = open ?? "";
    write(part("folder", HTMLElement), message.folder);
  }
}
