// The board: its registers as sliders, presets.

import { make, part, write } from "./dom.js";
import { RefusedError } from "./server.js";
import { integer } from "./words.js";

/** @typedef {import("./messages.js").Field} Field */
/** @typedef {import("./messages.js").Registers} RegistersMessage */
/** @typedef {import("./messages.js").Presets} PresetsMessage */
/** @typedef {import("./messages.js").Hello} Hello */
/** @typedef {import("./messages.js").Counters} Counters */
/** @typedef {import("./server.js").Server} Server */

/** Registers of the scan's timing, which are always shown, in the order of the scan. */
const TIMING = ["line_period", "line_read", "step_period", "step_read", "ramp", "noise_floor", "lines"];
/** Labels of the sliders; the names of the registers are their titles. */
/** @type {Record<string, string>} */
const SPOKEN = {
  line_period: "Line period",
  line_read: "Line read",
  step_period: "Step period",
  step_read: "Step read",
  ramp: "Ramp",
  noise_floor: "Noise floor",
  lines: "Lines",
  random_lines: "Random line order",
  mechanoreceptor: "FA-1 mode",
  invert_comparator: "Invert comparator",
  frame_sync: "One stamp per frame",
  wire_version: "Wire version",
  pattern: "Test pattern",
  threshold_jump: "FA-1 jump",
  threshold_rest: "FA-1 threshold",
  threshold_decay: "FA-1 decay",
};
/** Set by recordings, or the board's build. */
const NOT_HERE = ["record", "channels"];
const SLIDER = 1000;
/** Sliders that reach less far have even steps; all others even ratios. */
const LINEAR = 300;

/** A register with its number, and its slider where it has one. */
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
    this.unit = field.unit === "10 ns" ? { name: "µs", spoken: "microseconds", per: 100, decimals: 2 } : { name: field.unit, spoken: field.unit, per: 1, decimals: 0 };
    const id = `register-${field.name}`;
    const label = make("label", { for: id, title: `${field.name} (${field.manual}): ${field.text}` }, SPOKEN[field.name] ?? field.name);
    this.reason = make("p", { class: "reason", id: `${id}-reason`, role: "alert", hidden: true });
    this.row = make("div", { class: "register" }, label);
    if (field.unit === "flag") {
      this.input = make("input", { type: "checkbox", id, "aria-describedby": this.reason.id });
      this.row.classList.add("switch");
      this.row.append(this.input, this.reason);
      this.input.addEventListener("change", () => this.setTarget(Number(this.input.checked)));
    } else {
      this.input = make("input", { type: "text", inputmode: "decimal", id, autocomplete: "off", "aria-describedby": `${id}-unit ${this.reason.id}` });
      if (TIMING.includes(field.name)) {
        this.slider = make("input", { type: "range", min: 0, max: SLIDER, step: 1, "aria-label": `${SPOKEN[field.name]}, slider` });
        this.row.append(this.slider);
        this.slider.addEventListener("input", () => {
          this.setTarget(this.valueAt(Number(this.slider?.value)), false);
          this.showWanted();
        });
        this.slider.addEventListener("change", () => this.notify());
      }
      this.row.append(this.input, make("span", { class: "unit", id: `${id}-unit` }, shortUnit(this.unit.name)), this.reason);
      this.input.addEventListener("change", () => this.setTarget(this.read()));
      this.input.addEventListener("keydown", (event) => this.key(event));
    }
    this.notify = () => typed(this);
    this.show();
  }

  /** @param {KeyboardEvent} event */
  key(event) {
    if (event.key === "Escape") {
      if (this.wanted === null && this.input.value === this.text(this.held)) return;
      this.restore();
      this.notify();
      event.stopPropagation();
      event.preventDefault();
    } else if ((event.key === "ArrowUp" || event.key === "ArrowDown") && this.field.unit !== "flag") {
      const by = (event.key === "ArrowUp" ? 1 : -1) * (event.shiftKey ? 10 : 1);
      this.setTarget(Math.max(this.field.least, Math.min(this.field.greatest, (this.wanted ?? this.held) + by)));
      this.showWanted();
      event.preventDefault();
    }
  }

  /** @returns {number} the number in the field, in the register's unit; NaN if it is not a number */
  read() {
    const text = this.input.value.trim().replace(",", ".");
    return text === "" ? NaN : Math.round(Number(text) * this.unit.per);
  }

  /** @param {number} value @param {boolean} [notify] */
  setTarget(value, notify = true) {
    this.wanted = value === this.held ? null : value;
    if (notify) this.notify();
  }

  /** @param {number} position of the slider @returns {number} even steps in ratio, as what is sensible spans decades */
  valueAt(position) {
    const { least } = this.field;
    const low = Math.max(1, least);
    const { top } = this.field;
    if (top < LINEAR) return Math.round(least + (position / SLIDER) * (top - least));
    return Math.round(low * (top / low) ** (position / SLIDER));
  }

  /** @param {number} value @returns {number} the slider's position */
  positionOf(value) {
    const { least, top } = this.field;
    const low = Math.max(1, least);
    const share = top < LINEAR ? (value - least) / (top - least) : Math.log(Math.max(low, value) / low) / Math.log(top / low);
    return Math.round(SLIDER * Math.max(0, Math.min(1, share)));
  }

  /** @param {number} value */
  text(value) {
    return (value / this.unit.per).toFixed(this.unit.decimals);
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
    if (this.field.unit !== "flag") this.input.value = this.text(this.held);
    this.slide(this.held);
  }

  /** Shows a wanted number, from the slider or the arrow keys. */
  showWanted() {
    const value = this.wanted ?? this.held;
    this.input.value = this.text(value);
    this.slide(value);
  }

  /** @param {number} value */
  slide(value) {
    if (!this.slider || Number.isNaN(value)) return;
    this.slider.value = String(this.positionOf(value));
    this.slider.setAttribute("aria-valuetext", `${this.text(value)} ${this.unit.spoken}`);
  }

  /** @param {string | null} reason */
  refuse(reason) {
    this.row.classList.toggle("refused", reason !== null);
    this.input.setAttribute("aria-invalid", String(reason !== null));
    this.reason.hidden = reason === null;
    write(this.reason, reason === null ? "" : `${reason}. Press Escape to restore ${this.text(this.held)} ${this.unit.name === "flag" ? "" : this.unit.name}`.trim());
  }

  /** @param {boolean} disabled */
  disable(disabled) {
    this.input.disabled = disabled;
    if (this.slider) this.slider.disabled = disabled;
  }
}

/** @param {string} name @returns {string} */
function shortUnit(name) {
  /** @type {Record<string, string>} */
  const known = { lines: "", version: "", "1/256 theta_0": "/256 θ", "1/1024": "/1024", "1/1024 theta_0": "/1024 θ" };
  return known[name] ?? name;
}

/** The tab of the board. */
export class Board {
  /**
   * @param {Server} server
   * @param {(error: unknown) => void} failed
   */
  constructor(server, failed) {
    this.server = server;
    this.failed = failed;
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
        this.failed(error);
      });
    };
    part("read-back", HTMLButtonElement).onclick = () => this.ask({ type: "read" });
  }

  /** @param {import("./messages.js").Request} message */
  ask(message) {
    return this.server.request(message).catch(this.failed);
  }

  /** @param {Hello} hello */
  greet(hello) {
    this.hasRegisters = hello.lines === null;
    this.writable = hello.live && hello.control !== null;
    part("losses", HTMLElement).hidden = !hello.live;
    this.enable();
  }

  enable() {
    for (const control of this.controls.values()) control.disable(!this.writable);
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
    for (const one of spoilt) one.refuse(`${one.input.value.trim() || "nothing"} is not a number`);
    if (!waiting.length || !this.writable || spoilt.length) return;
    for (const one of waiting) one.refuse(null);
    const values = Object.fromEntries(waiting.map(({ field, wanted }) => [field.name, field.unit === "flag" ? Boolean(wanted) : Number(wanted)]));
    this.server.request({ type: "set", values }).catch((error) => {
      const field = error instanceof RefusedError ? error.field : null;
      (this.controls.get(field ?? "") ?? control).refuse(error.message);
    });
  }

  restoreAll() {
    for (const control of this.controls.values()) control.restore();
  }
}
