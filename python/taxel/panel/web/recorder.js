// Recording: name with a number that moves on, length, label of the trial.

import { make, part, write } from "./dom.js";
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
   * @param {(error: unknown) => void} failed
   * @param {() => void} shown called to bring the tab to the front
   */
  constructor(server, failed, shown) {
    this.server = server;
    this.failed = failed;
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
    for (const id of ["record-name", "record-index"]) part(id, HTMLElement).addEventListener("input", () => this.preview());
    this.preview();
  }

  /** @returns {number | null} */
  number(/** @type {string} */ id) {
    const text = part(id, HTMLInputElement).value.trim().replace(",", ".");
    return text === "" ? null : Number(text);
  }

  /** @returns {string} the name of the next recording, without its ending */
  get name() {
    return part("record-name", HTMLInputElement).value.trim() + part("record-index", HTMLInputElement).value.trim();
  }

  preview() {
    write(part("record-file", HTMLElement), this.name && `${this.name}.mcap`);
  }

  get busy() {
    return this.status !== null && this.status.state !== "idle";
  }

  /** Starts, or ends what runs. */
  toggle() {
    if (!this.able) return;
    if (this.busy) {
      this.server.request({ type: "stop" }).catch(this.failed);
      return;
    }
    part("record-reason", HTMLElement).hidden = true;
    for (const [id, field] of /** @type {const} */ ([["record-index", "number"], ["record-length", "length"]])) {
      if (Number.isNaN(this.number(id))) return this.refuse(`${field}: ${part(id, HTMLInputElement).value.trim()} is not a number`);
    }
    const label = part("record-label", HTMLInputElement).value.trim();
    /** @type {import("./messages.js").RecordRequest} */
    const message = { type: "record", name: this.name, length_s: this.number("record-length"), label: label || null };
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
    // The number moves on by itself; one that a person is typing stays.
    const index = part("record-index", HTMLInputElement);
    if (before?.state === "finishing" && state === "idle" && !error && index.value.trim() && document.activeElement !== index) {
      index.value = String(Number(index.value) + 1);
      this.preview();
    }
    this.button.classList.toggle("on", this.busy);
    write(part("record-word", HTMLElement), { idle: "Record", recording: "Stop", finishing: "Saving" }[state]);
    write(part("record-start", HTMLButtonElement), this.busy ? "Stop (R)" : "Record (R)");
    const reason = part("record-reason", HTMLElement);
    if (error || this.busy) {
      reason.hidden = !error;
      write(reason, error ?? "");
    }
    for (const id of ["note-form"]) part(id, HTMLElement).hidden = state !== "recording";
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
