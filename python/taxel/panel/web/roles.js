// The dialog that shows what the columns or axes of a file of another program are, or those of the lines of a sensor, changes
// it, and writes it as a layout file, or connects the sensor.

import { ground, fitted, make, part, themed, write } from "./dom.js";
import { counted } from "./words.js";

/** @typedef {import("./messages.js").Changes} Changes */
/** @typedef {import("./messages.js").Look} Look */
/** @typedef {import("./messages.js").Seen} Seen */
/** @typedef {import("./server.js").Server} Server */

/** Steps between a curve's least and greatest, and between no load and the most of a map. */
const STEPS = 255;

/**
 * A menu whose entries are changes.
 * @param {string} label
 * @param {string} value what is chosen; "" where it is open
 * @param {Record<string, Changes>} choices
 * @param {(changes: Changes) => void} change
 * @returns {HTMLSelectElement}
 */
function menu(label, value, choices, change) {
  const names = Object.keys(choices);
  const open = names.includes(value) ? [] : [make("option", { value: "" }, value || "choose …")];
  const select = make("select", { "aria-label": label }, ...open, ...names.map((name) => make("option", { value: name }, name)));
  select.value = names.includes(value) ? value : "";
  select.onchange = () => select.value && change(choices[select.value]);
  return select;
}

/** @param {HTMLCanvasElement} canvas @param {number[]} curve least and greatest of each part in turn; -1: no value */
function drawCurve(canvas, curve) {
  const { width, height, ratio } = fitted(canvas);
  const context = ground(canvas);
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  context.fillStyle = themed("more");
  const step = (2 * width) / curve.length;
  const at = (/** @type {number} */ value) => (1 - value / STEPS) * (height - 2);
  for (let k = 0; k < curve.length; k += 2) {
    if (curve[k] >= 0) context.fillRect((k / 2) * step, at(curve[k + 1]), Math.max(step, 1), Math.max(at(curve[k]) - at(curve[k + 1]), 1.5));
  }
}

/** @param {HTMLCanvasElement} canvas @param {Seen["sensors"][number]} sensor */
function drawMap(canvas, { rows, columns, levels }) {
  [canvas.width, canvas.height] = [columns, rows];
  const context = ground(canvas);
  context.fillStyle = themed("more");
  levels.forEach((level, k) => {
    context.globalAlpha = level / STEPS;
    context.fillRect(k % columns, Math.floor(k / columns), 1, 1);
  });
}

/** The dialog. */
export class Roles {
  /**
   * @param {Server} server
   * @param {(name: string) => void} show shows a recording
   */
  constructor(server, show) {
    this.server = server;
    this.show = show;
    /** What was said last, and what was asked since. @type {Look | null} */
    this.look = null;
    this.name = "";
    this.dialog = part("roles", HTMLDialogElement);
    this.folder = part("roles-folder", HTMLInputElement);
    this.replace = part("roles-replace", HTMLButtonElement);
    part("roles-close", HTMLButtonElement).onclick = () => this.dialog.close();
    this.replace.onclick = () => this.write(true);
    this.folder.onchange = () => this.settle();
    part("roles-form", HTMLFormElement).onsubmit = (event) => {
      event.preventDefault();
      this.write(false);
    };
  }

  /** Opens the dialog of a file. @param {string} name */
  open(name) {
    this.begin(name, false);
    this.ask({});
  }

  /** @param {string} name of a file, or of a live source @param {boolean} isLive */
  begin(name, isLive) {
    this.name = name;
    this.look = null;
    write(part("roles-title", HTMLElement), `What ${name} ${isLive ? "prints" : "holds"}`);
    write(part("roles-open", HTMLElement), isLive ? "Connect" : "Open");
    part("roles-place", HTMLElement).hidden = isLive;
    for (const id of ["roles-rows", "roles-fields", "roles-seen"]) part(id, HTMLElement).replaceChildren();
    this.settle();
    if (!this.dialog.open) this.dialog.showModal();
  }

  /** @param {Changes} changes */
  async ask(changes) {
    this.say("Reading …");
    try {
      await this.server.request({ type: "look", name: this.name, changes, ...(this.look ? { text: this.look.text } : {}) });
    } catch (error) {
      this.say(error instanceof Error ? error.message : String(error));
      // The menus show again what holds.
      if (this.look) this.take(this.look, false);
    }
  }

  /** @param {string} text what holds, or why something was refused */
  say(text) {
    write(part("roles-about", HTMLElement), ...text.split("\n"));
  }

  /** Hides what belongs to the last answer. */
  settle() {
    this.replace.hidden = true;
    part("roles-text", HTMLElement).hidden = true;
    const [own = "", folder = ""] = this.look?.files ?? [];
    write(part("roles-file", HTMLElement), `Writes ${this.folder.checked ? folder : own}`);
    part("roles-open", HTMLButtonElement).disabled = !this.look || this.look.questions.length > 0;
  }

  /** @param {Look} look @param {boolean} [isNew] */
  take(look, isNew = true) {
    // The lines of a sensor come as they were asked for in another dialog.
    if (!look.files.length && !this.dialog.open) this.begin(look.name, true);
    if (look.name !== this.name) return;
    this.look = look;
    const change = (/** @type {Changes} */ changes) => this.ask(changes);
    const rows = look.roles.map((role) => {
      // What is open is chosen, also where it is what was assumed.
      const chosen = role.certainty === "open" && role.why !== "stated" ? "" : role.role;
      const canvas = make("canvas", { "aria-hidden": "true" });
      const units = Object.keys(role.units).length ? menu(`Unit of ${role.name}`, role.unit, role.units, change) : make("span", {}, role.unit);
      const row = make(
        "tr",
        { class: role.certainty },
        make("th", { scope: "row" }, role.name),
        make("td", { class: "first" }, role.first.join("  ")),
        make("td", {}, menu(`Role of ${role.name}`, chosen, role.menu, change)),
        make("td", {}, units),
        make("td", {}, ...(role.curve.length ? [canvas] : [])),
        make("td", { class: "hint" }, role.certainty === "sure" ? role.why : [role.certainty, role.why].filter(Boolean).join(": ")),
      );
      return { row, canvas, curve: role.curve };
    });
    part("roles-rows", HTMLElement).replaceChildren(...rows.map(({ row }) => row));
    for (const { canvas, curve } of rows) if (curve.length) drawCurve(canvas, curve);
    part("roles-fields", HTMLElement).replaceChildren(...look.fields.map((field) => this.field(field, change)));
    if (!isNew) return this.settle();
    const more = look.more ? [`${counted(look.more, "column")} more, taxels like these`] : [];
    const asks = look.questions.map(({ why, choices }) => `Open: ${why} (${Object.keys(choices).join(", ")})`);
    this.say([...asks, ...look.said, ...more].join("\n") || "All is known.");
    if (look.questions.length) part("roles-seen", HTMLElement).replaceChildren();
    this.settle();
  }

  /** @param {Look["fields"][number]} field @param {(changes: Changes) => void} change @returns {HTMLElement} */
  field(field, change) {
    if ("choices" in field) return make("label", { class: "field" }, field.label, menu(field.label, field.value ?? "", field.choices, change));
    const value = field.value === null || field.value === undefined ? "" : String(field.value);
    const input = make("input", { type: "text", value, ...(field.number ? { inputmode: "decimal" } : {}) });
    input.onchange = () => {
      const text = input.value.trim();
      const number = Number(text.replace(",", "."));
      change({ [field.key]: text === "" ? null : field.number && !Number.isNaN(number) ? number : text });
    };
    return make("label", { class: "field" }, field.label, input);
  }

  /** @param {Seen} seen */
  see({ name, sensors, said, refused }) {
    if (name !== this.name || !this.look) return;
    part("roles-seen", HTMLElement).replaceChildren(
      ...sensors.map((sensor) => {
        const [map, curve] = [make("canvas", { class: "seen-map" }), make("canvas", { class: "seen-curve" })];
        drawMap(map, sensor);
        map.style.aspectRatio = `${sensor.columns} / ${sensor.rows}`;
        requestAnimationFrame(() => drawCurve(curve, sensor.curve));
        const caption = [sensor.name, `${sensor.rows} × ${sensor.columns} taxels`, sensor.about].filter(Boolean).join(", ");
        return make("figure", {}, make("figcaption", {}, caption), map, curve);
      }),
    );
    if (said.length) this.say([part("roles-about", HTMLElement).textContent ?? "", ...said].join("\n"));
    if (refused) part("roles-open", HTMLButtonElement).disabled = true;
  }

  /** Writes the layout file, and shows the recording; or connects the sensor. @param {boolean} replace over one that is there */
  async write(replace) {
    if (!this.look) return;
    const { text, name, files } = this.look;
    try {
      const lay = { type: /** @type {const} */ ("lay"), name, text, folder: this.folder.checked, replace };
      await this.server.request(files.length ? lay : { type: "connect", source: name, text });
    } catch (error) {
      const [reason, field] = error instanceof Error ? [error.message, /** @type {{ field?: string | null }} */ (error).field] : [String(error), null];
      this.say(reason);
      this.settle();
      this.replace.hidden = field !== "replace";
      if (!files.length) return;
      // Where it cannot be written it can be copied.
      part("roles-text", HTMLElement).hidden = field === "replace";
      write(part("roles-text", HTMLElement), ...text.split("\n"));
      return;
    }
    this.dialog.close();
    if (files.length) this.show(name);
  }
}
