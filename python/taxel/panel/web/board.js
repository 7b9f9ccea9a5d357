// The board: its registers, presets.

import { make, part, write } from "./dom.js";
import { failed } from "./notice.js";
import { RefusedError } from "./server.js";
import { integer } from "./words.js";

/** @typedef {import("./messages.js").Field} Field */
/** @typedef {import("./messages.js").Registers} RegistersMessage */
/** @typedef {import("./messages.js").Presets} PresetsMessage */
/** @typedef {import("./messages.js").Hello} Hello */
/** @typedef {import("./server.js").Server} Server */

/** Registers of the scan's timing, which are always shown, in the order of the scan. */
const TIMING = ["line_period", "line_read", "step_period", "step_read", "ramp", "noise_floor", "lines"];
/** Set by recordings, or the board's build. */
const NOT_HERE = ["record", "channels"];

/** A register with its number. */
class Control {
  /**
   * @param {Field} field
   * @param {(control: Control) => void} typed
   */
  constructor(field, typed) {
    this.field = field;
    this.held = field.least;
    /** @type {number | null} typed and not held by the board */
    this.wanted = null;
    this.isFlag = field.unit === "flag";
    const isTime = field.unit === "10 ns";
    /** Steps of the register in the unit that is written. */
    this.per = isTime ? 100 : 1;
    this.unit = isTime ? "µs" : this.isFlag ? "" : field.unit;
    const id = `register-${field.name}`;
    const name = field.name.replaceAll("_", " ");
    const label = make("label", { for: id, title: `${field.name} (${field.manual}): ${field.text}` }, `${name[0].toUpperCase()}${name.slice(1)}`);
    this.reason = make("p", { class: "reason", id: `${id}-reason`, role: "alert", hidden: true });
    /** @type {Record<string, string | number>} */
    const kind = this.isFlag ? { type: "checkbox" } : { type: "number", step: 1 / this.per, min: field.least / this.per, max: field.greatest / this.per };
    this.input = make("input", { id, autocomplete: "off", "aria-describedby": `${id}-unit ${this.reason.id}`, ...kind });
    this.row = make("div", { class: "register" }, label, this.input, make("span", { class: "unit", id: `${id}-unit` }, this.unit), this.reason);
    this.input.addEventListener("change", () => {
      const value = this.isFlag ? Number(this.input.checked) : Math.round(this.input.valueAsNumber * this.per);
      this.wanted = value === this.held ? null : value;
      typed(this);
    });
    this.input.addEventListener("keydown", (event) => {
      if (event.key !== "Escape" || (this.wanted === null && this.input.value === this.text)) return;
      this.restore();
      typed(this);
      event.stopPropagation();
      event.preventDefault();
    });
    this.show();
  }

  /** @returns {string} the value that the board holds */
  get text() {
    return (this.held / this.per).toFixed(this.per > 1 ? 2 : 0);
  }

  /** @param {number} value that the board holds */
  take(value) {
    if (this.wanted === value) this.wanted = null;
    const same = this.held === value;
    this.held = value;
    // Text that is being typed stays.
    if (this.wanted === null && !(same && document.activeElement === this.input)) this.show();
  }

  /** Replaces what was typed by the value that the board holds. */
  restore() {
    this.wanted = null;
    this.show();
  }

  /** Shows what the board holds. */
  show() {
    this.refuse(null);
    this.input.checked = Boolean(this.held);
    if (!this.isFlag) this.input.value = this.text;
  }

  /** @param {string | null} reason */
  refuse(reason) {
    this.input.setAttribute("aria-invalid", String(reason !== null));
    this.reason.hidden = reason === null;
    write(this.reason, reason === null ? "" : `${reason}. Press Escape to restore ${this.text} ${this.unit}`.trim());
  }
}

/** The tab of the board. */
export class Board {
  /** @param {Server} server */
  constructor(server) {
    this.server = server;
    this.writable = false;
    /** Whether the live source is a board. */
    this.hasRegisters = true;
    /** @type {PresetsMessage | null} */
    this.presets = null;
    /** @type {Map<string, Control>} */
    this.controls = new Map();
    this.select = part("preset", HTMLSelectElement);
    this.select.onchange = () => {
      this.restoreAll();
      if (!this.select.value) return;
      this.server.request({ type: "preset_apply", name: this.select.value }).catch((error) => {
        // The board still has another version.
        this.showPresets();
        failed(error);
      });
    };
    part("read-back", HTMLButtonElement).onclick = () => server.ask({ type: "read" });
  }

  /** @param {Hello} hello */
  greet(hello) {
    this.hasRegisters = hello.lines === null;
    this.writable = hello.live && hello.control !== null;
    part("losses", HTMLElement).hidden = !hello.live;
    this.enable();
  }

  enable() {
    for (const control of this.controls.values()) control.input.disabled = !this.writable;
    part("read-back", HTMLButtonElement).disabled = !this.writable;
    this.select.disabled = !this.writable;
  }

  /**
   * @param {Record<string, number | boolean>} values
   * @param {number | null} frame_us
   * @param {string | null} preset
   * @param {boolean} known read from the board, or from the recording
   * @param {boolean} stated given by whoever started the panel
   * @param {string[]} warnings of values that are allowed but probably a mistake
   */
  show(values, frame_us, preset, known, stated, warnings) {
    for (const [name, control] of this.controls) if (values[name] !== undefined) control.take(Number(values[name]));
    this.preset = preset;
    this.showPresets();
    const rate = frame_us ? `${integer(1e6 / frame_us)} frames/s, a frame takes ${frame_us.toFixed(1)} µs` : "";
    const unread = "the registers have not been read";
    write(part("frame-rate", HTMLElement), known ? rate : stated ? `${rate} (as stated at the start; ${unread})` : `Frame rate not known: ${unread}.`);
    const warning = part("registers-warning", HTMLElement);
    warning.hidden = !warnings.length;
    write(warning, warnings.join(". "));
  }

  /**
   * Shows what the registers held in a recording.
   * @param {Record<string, number | boolean> | null} values null of one that is of no board, or that does not keep them
   * @param {number | null} frame_us
   */
  showRecorded(values, frame_us) {
    write(part("registers-why", HTMLElement), values ? "The values of the registers during the recording." : "This recording contains no registers of a board.");
    part("registers-held", HTMLElement).hidden = !values;
    if (values) this.show(values, frame_us, null, true, false, []);
  }

  /** @param {RegistersMessage} message */
  take(message) {
    part("registers-held", HTMLElement).hidden = !this.hasRegisters;
    if (!this.hasRegisters) return write(part("registers-why", HTMLElement), "A sensor that prints numbers has no registers.");
    const assumed = message.known || message.stated ? "" : "; the values below are those of a board at reset";
    write(part("registers-why", HTMLElement), this.writable ? "" : `No control line, so registers cannot be read or set${assumed}. Start taxel live with --control.`);
    this.show(message.values, message.frame_us, message.preset, message.known, message.stated, message.warnings);
  }

  /** @param {PresetsMessage} presets */
  takePresets(presets) {
    this.presets = presets;
    for (const field of presets.fields) {
      if (NOT_HERE.includes(field.name) || this.controls.has(field.name)) continue;
      const control = new Control(field, (changed) => this.send(changed));
      this.controls.set(field.name, control);
      part(TIMING.includes(field.name) ? "timing" : "more-registers", HTMLElement).append(control.row);
    }
    this.enable();
    this.showPresets();
  }

  showPresets() {
    if (!this.presets) return;
    const options = this.presets.built_in.map((name) => make("option", { value: name }, name));
    this.select.replaceChildren(make("option", { value: "" }, "as set below"), ...options);
    this.select.value = this.preset ?? "";
  }

  /**
   * Something was typed: it goes to the board at once, with all that waited for it; what the board's rules refuse stays as
   * it was typed, with the reason.
   * @param {Control} control
   */
  send(control) {
    if (control.wanted === null) control.show();
    const waiting = [...this.controls.values()].filter(({ wanted }) => wanted !== null);
    const spoilt = waiting.filter(({ wanted }) => Number.isNaN(wanted));
    for (const one of spoilt) one.refuse("must be a number");
    if (!waiting.length || !this.writable || spoilt.length) return;
    for (const one of waiting) one.refuse(null);
    const values = Object.fromEntries(waiting.map(({ field, wanted }) => [field.name, Number(wanted)]));
    this.server.request({ type: "set", values }).catch((error) => {
      const field = error instanceof RefusedError ? error.field : null;
      (this.controls.get(field ?? "") ?? control).refuse(error.message);
    });
  }

  restoreAll() {
    for (const control of this.controls.values()) control.restore();
  }
}
