// Regions of a recording: drawn on the pressure map, named, moved and undone, and the curve of each in the lane of regions.

import { drawing, make, part, withChildren, write } from "./dom.js";
import { failed, notify } from "./notice.js";
import { RefusedError, inTurn } from "./server.js";
import { rounded } from "./words.js";

/** @typedef {import("./geometry.js").Taxel} Taxel */
/** @typedef {import("./geometry.js").Place} Corner */
/** @typedef {import("./messages.js").DrawnRegion & { id: number }} Region never changed: what is moved is another one of the same number */
/** @typedef {import("./messages.js").LoadsRequest["measure"]} Measure */
/** @typedef {{ of: Region, measure: Measure, first: number, end: number, column_us: number, columns: ([number, number] | null)[] }} Curve */
/** @typedef {import("./timeline.js").Timeline} Timeline */

/** Colours of regions, in turn, that differ for the colour-blind too (Tol's bright scheme, without its grey). */
const COLOURS = ["#4477aa", "#ee6677", "#228833", "#ccbb44", "#66ccee", "#aa3377"];
/** How near the first corner a click closes a polygon, CSS pixels. */
const NEAR = 10;

const MODES = /** @type {const} */ (["rectangle", "polygon", "taxels"]);
/** @type {Record<string, Corner>} */
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

/** @param {number} k @returns {string} */
export const regionColour = (k) => COLOURS[k % COLOURS.length];

/** @param {Corner[]} corners @returns {boolean} whether they are those of a rectangle along the axes */
const isRectangle = (corners) =>
  corners.length === 4 && corners.every(([x, y], k) => [corners[(k + 1) % 4], corners[(k + 3) % 4]].every(([a, b]) => (a === x) !== (b === y)));

/** @param {Corner} from @param {Corner} to @returns {Corner[]} the rectangle between two opposite corners */
const rectangle = ([a, b], [c, d]) => [[a, b], [c, b], [c, d], [a, d]];

/** The regions, their list, and what draws them on the map. */
export class Regions {
  /**
   * @param {import("./server.js").Server} server
   * @param {import("./maps.js").Maps} maps
   * @param {() => Timeline | null} timeline
   * @param {() => void} drawn called when their curves are to be drawn again
   * @param {() => void} named called when they are others, or have other names
   */
  constructor(server, maps, timeline, drawn, named) {
    this.server = server;
    this.maps = maps;
    this.timeline = timeline;
    this.drawn = drawn;
    this.renamed = named;
    /** @type {Region[]} */
    this.all = [];
    /** What the regions were before each change. @type {Region[][]} */
    this.before = [];
    /** The number of the chosen one. @type {number | null} */
    this.chosen = null;
    /** @type {Map<number, Curve>} */
    this.curves = new Map();
    /** The recording and the file of its regions; "" while it has none. */
    this.source = "";
    this.file = "";
    /** The units of each measure. @type {import("./messages.js").Regions["units"]} */
    this.units = { load: "", peak: "", mean: "", area: "", x: "", y: "", end: "" };
    this.chooses = part("region-measure", HTMLSelectElement);
    this.chooses.onchange = () => this.show(true);
    /** What is drawn now. @type {"" | "rectangle" | "polygon" | "taxels"} */
    this.mode = "";
    /** Corners of the polygon or the rectangle that is being drawn. @type {Corner[]} */
    this.begun = [];
    /** What follows the pointer. @type {{ moves: (to: Corner) => void, ends: (to: Corner) => void } | null} */
    this.drags = null;
    this.next = 0;
    /** Those whose curves were asked for. @type {Region[]} */
    this.asked = [];
    /** Asks for the curves of the window that are not known of a region as it is now. */
    this.ask = inTurn(server, () => this.lacking());
    /** Numbers and names that were shown. */
    this.named = "";
    this.frame = part("pressure-frame", HTMLElement);
    this.shapes = part("pressure-regions", SVGSVGElement);
    /** What is being drawn. */
    this.begins = drawing("polygon", { class: "begun" });
    this.handles = part("pressure-corners", HTMLElement);
    this.list = part("region-list", HTMLElement);
    for (const mode of MODES) part(`region-${mode}`, HTMLButtonElement).onclick = () => this.draw(this.mode === mode ? "" : mode);
    part("region-undo", HTMLButtonElement).onclick = () => this.undo();
    part("region-write", HTMLButtonElement).onclick = () => this.write(false);
    part("region-replace", HTMLButtonElement).onclick = () => this.write(true);
    // Before the crosshair has it.
    this.frame.addEventListener("pointerdown", (event) => this.press(event), true);
    this.frame.addEventListener("pointermove", (event) => this.point(event), true);
    this.frame.addEventListener("lostpointercapture", (event) => this.drop(event), true);
    this.frame.addEventListener("keydown", (event) => this.key(event), true);
  }

  /** Another recording is shown, or the live source. @param {import("./messages.js").Opened | null} opened */
  choose(opened) {
    part("region-tools", HTMLElement).hidden = true;
    this.source = "";
    [this.all, this.before, this.chosen] = [[], [], null];
    this.draw("");
    this.show(true);
    for (const mode of ["rectangle", "polygon"]) part(`region-${mode}`, HTMLButtonElement).hidden = this.maps.geometry.kind === "channels";
    if (opened?.frames) this.server.ask({ type: "regions" });
  }

  /** @param {import("./messages.js").Regions} message */
  take({ source, file, units, regions }) {
    [this.source, this.file, this.units] = [source, file, units];
    this.all = regions.map((region) => ({ ...region, id: this.next++ }));
    part("region-tools", HTMLElement).hidden = false;
    this.show(true);
  }

  /** @param {import("./messages.js").Loads} message of the curves that were asked for */
  takeLoads({ measure, first, count, column_us, curves }) {
    this.asked.forEach((of, k) => {
      const curve = curves[k];
      if (typeof curve === "string") notify(curve, true);
      this.curves.set(of.id, { of, measure, first, end: first + count, column_us, columns: typeof curve === "string" ? [] : curve });
    });
    this.drawn();
  }

  /** @returns {Measure} that of the curves */
  get measure() {
    return /** @type {Measure} */ (this.chooses.value);
  }

  /** @returns {string} what the curves are, in a word */
  get quantity() {
    return this.measure !== "load" ? this.chooses.selectedOptions[0].text : this.units.load === "N" ? "Force" : "Sum";
  }

  /** @returns {import("./messages.js").LoadsRequest | null} */
  lacking() {
    const { measure } = this;
    const { columns = null, column_us = 0 } = this.timeline() ?? {};
    if (!this.source || !columns) return null;
    const [from, to] = columns;
    this.asked = this.all.filter((region) => {
      const curve = this.curves.get(region.id);
      return curve?.of !== region || curve.measure !== measure || curve.column_us !== column_us || curve.first > from - 1 || curve.end <= to;
    });
    const regions = this.asked.map(({ name, corners, taxels }) => ({ name, corners, taxels }));
    return regions.length ? { type: "loads", regions, measure, first: from - 1, count: to - from + 2, column_us } : null;
  }

  /** @param {Region} region @param {number} number of a column @param {number} column_us @returns {[number, number] | null} */
  at({ id }, number, column_us) {
    const curve = this.curves.get(id);
    return curve?.column_us === column_us && curve.measure === this.measure ? (curve.columns[number - curve.first] ?? null) : null;
  }

  // ---------------------------------------------------------------------------------------------- changes

  /** Changes the regions, so that it can be undone. @param {Region[]} all */
  change(all) {
    this.before = [...this.before, this.all];
    this.all = all;
    this.show(true);
  }

  /** @returns {Region | undefined} the chosen one */
  get region() {
    return this.all.find(({ id }) => id === this.chosen);
  }

  undo() {
    this.all = this.before.pop() ?? this.all;
    this.show(true);
  }

  /** @param {Corner[]} corners @param {Taxel[]} taxels */
  add(corners, taxels) {
    const taken = new Set(this.all.map(({ name }) => name));
    let number = this.all.length + 1;
    while (taken.has(`part ${number}`)) number++;
    this.chosen = this.next++;
    this.change([...this.all, { name: `part ${number}`, corners, taxels, id: this.chosen }]);
  }

  /** @param {Region} region @param {Partial<Region>} parts @returns {Region[]} */
  with(region, parts) {
    return this.all.map((one) => (one.id === region.id ? { ...one, ...parts } : one));
  }

  /**
   * Moves a region, or one of its corners; a rectangle stays one.
   * @param {Region} region as it was
   * @param {number} grip the corner; -1: all of it
   * @param {Corner} by
   */
  move(region, grip, by) {
    const shift = (/** @type {Corner} */ [x, y]) => /** @type {Corner} */ ([x + by[0], y + by[1]]);
    const { geometry } = this.maps;
    // Beside taxels at places there are no others.
    if (region.taxels.length && geometry.kind === "places") return;
    const [columns, rows] = by.map((one, k) => Math.round(one / geometry.step[k]));
    const taxels = /** @type {Taxel[]} */ (region.taxels.map(([x, y]) => [x + columns, y + rows]));
    if (!taxels.every((taxel) => geometry.has(...taxel))) return;
    const [from, still] = [region.corners[grip], isRectangle(region.corners)];
    const corners = region.corners.map((corner, k) => {
      if (grip < 0 || grip === k) return shift(corner);
      const [x, y] = shift(corner);
      return /** @type {Corner} */ ([still && corner[0] === from[0] ? x : corner[0], still && corner[1] === from[1] ? y : corner[1]]);
    });
    this.change(this.with(region, { corners, taxels }));
  }

  // ---------------------------------------------------------------------------------------------- drawing

  /** @param {Regions["mode"]} mode */
  draw(mode) {
    this.mode = mode;
    this.begun = [];
    this.begins.setAttribute("points", "");
    if (mode) this.chosen = null;
    this.show(false);
    if (mode) this.frame.focus();
  }

  /** @param {PointerEvent} event @returns {Corner} */
  placeOf(event) {
    const box = this.maps.pressure.canvas.getBoundingClientRect();
    return this.maps.geometry.where((event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height);
  }

  /** @param {Event} event @returns {number | null} the corner of the chosen region that it is at; -1: the region; null: neither */
  gripOf({ target }) {
    const grip = target instanceof Element ? target.getAttribute("data-grip") : null;
    return grip === null ? null : Number(grip);
  }

  /** @param {PointerEvent} event */
  press(event) {
    const [grip, { mode, region, before, all }] = [this.gripOf(event), this];
    if (!mode && grip === null) return;
    event.stopPropagation();
    event.preventDefault();
    const from = this.placeOf(event);
    if (mode === "polygon") return this.corner(from);
    if (mode === "rectangle") {
      this.begun = [from];
      return this.drag(event, (to) => this.trace(to), (to) => this.corner(to));
    }
    if (mode === "taxels") return this.toggle(this.maps.geometry.at(...this.maps.geometry.seen(from)));
    const moves = (/** @type {Corner} */ [x, y]) => region && grip !== null && this.move(region, grip, [x - from[0], y - from[1]]);
    this.drag(event, moves, () => {
      // A drag is undone as a whole.
      if (this.all !== all) this.before = [...before, all];
      this.show(false);
    });
  }

  /** Follows a pointer until it is up. @param {PointerEvent} event @param {(to: Corner) => void} moves @param {(to: Corner) => void} ends */
  drag({ pointerId }, moves, ends) {
    this.frame.setPointerCapture(pointerId);
    this.drags = { moves, ends };
  }

  /** @param {PointerEvent} event */
  drop(event) {
    this.drags?.ends(this.placeOf(event));
    this.drags = null;
  }

  /** Adds a corner; a rectangle has two, and a polygon ends at its first one. @param {Corner} at */
  corner(at) {
    const [first] = this.begun;
    if (this.mode === "rectangle" && first) {
      this.draw("");
      if (first[0] !== at[0] && first[1] !== at[1]) this.add(rectangle(first, at), []);
      return;
    }
    const [[x, y], [a, b]] = [at, first ?? at].map((corner) => this.maps.geometry.seen(corner));
    const isNear = first && Math.hypot((x - a) * this.frame.clientWidth, (y - b) * this.frame.clientHeight) < NEAR;
    if (isNear && this.begun.length > 2) {
      const corners = this.begun;
      this.draw("");
      return this.add(corners, []);
    }
    if (!isNear) this.begun.push(at);
    this.trace(at);
  }

  /** @param {Taxel} taxel of the set that is drawn, of which the last one stays; or the first of a new one */
  toggle(taxel) {
    const { region } = this;
    if (!region) return this.add([], [taxel]);
    const others = region.taxels.filter((one) => String(one) !== String(taxel));
    const taxels = others.length === region.taxels.length ? [...others, taxel] : others;
    if (taxels.length) this.change(this.with(region, { taxels }));
  }

  /** @param {PointerEvent} event */
  point(event) {
    if (!this.mode && !this.drags) return;
    event.stopPropagation();
    if (this.drags) this.drags.moves(this.placeOf(event));
    else if (this.begun.length) this.trace(this.placeOf(event));
  }

  /** Shows what is begun, up to a place. @param {Corner} to */
  trace(to) {
    const corners = this.mode === "rectangle" ? rectangle(this.begun[0], to) : [...this.begun, to];
    this.begins.setAttribute("points", this.points(corners));
  }

  /** @param {KeyboardEvent} event */
  key(event) {
    const { key } = event;
    const { region } = this;
    const grip = this.gripOf(event);
    if ((event.ctrlKey || event.metaKey) && key === "z" && this.before.length) this.undo();
    else if (event.ctrlKey || event.altKey || event.metaKey) return;
    else if (region && grip !== null && ARROWS[key]) {
      const far = event.shiftKey ? 8 : 1;
      const [x, y] = this.maps.geometry.step;
      this.move(region, grip, [ARROWS[key][0] * x * far, ARROWS[key][1] * y * far]);
    } else if (region && grip !== null && key === "Delete") this.remove(region);
    else if (key === "Escape" && (this.mode || this.chosen !== null)) {
      this.chosen = null;
      this.draw("");
    } else if (key === "Enter" && this.mode && this.maps.taxel) {
      if (this.mode === "taxels") this.toggle(this.maps.taxel);
      else this.corner(this.maps.geometry.where(...this.maps.geometry.place(this.maps.taxel)));
    } else return;
    event.preventDefault();
    event.stopPropagation();
  }

  /** @param {Region} region */
  remove(region) {
    this.chosen = null;
    this.change(this.all.filter((one) => one !== region));
    this.list.focus();
  }

  // ---------------------------------------------------------------------------------------------- the page

  /** @param {Corner[]} corners @returns {string} */
  points(corners) {
    return corners.map((corner) => this.maps.geometry.seen(corner).map((share) => (1000 * share).toFixed(2)).join(",")).join(" ");
  }

  /** Shows the regions on the map and in the list. @param {boolean} curves whether their curves may have changed */
  show(curves) {
    for (const mode of MODES) part(`region-${mode}`, HTMLButtonElement).setAttribute("aria-pressed", String(this.mode === mode));
    const shapes = this.all.map((region, k) => {
      const colour = { "data-grip": -1, class: region.id === this.chosen && !this.mode ? "chosen" : "", stroke: regionColour(k), fill: regionColour(k) };
      if (region.corners.length) return drawing("polygon", { ...colour, points: this.points(region.corners) });
      return drawing("path", { ...colour, d: region.taxels.map((taxel) => `M${this.points(this.maps.geometry.cell(taxel))}z`).join("") });
    });
    this.shapes.replaceChildren(...shapes, this.begins);
    this.showHandles();
    this.showList();
    part("region-undo", HTMLButtonElement).disabled = !this.before.length;
    part("region-replace", HTMLButtonElement).hidden = true;
    write(part("region-file", HTMLElement), this.file && `Written as ${this.file}, beside the recording.`);
    if (!curves) return;
    const before = this.named;
    this.named = JSON.stringify([this.units, this.measure, this.all.map(({ id, name }) => [id, name])]);
    if (before !== this.named) this.renamed();
    this.ask();
  }

  /** A handle in the middle of the chosen region, and one at each of its corners; those that are there stay, and keep the focus. */
  showHandles() {
    const region = this.mode ? undefined : this.region;
    const corners = region?.corners ?? [];
    const seen = corners.length ? corners.map((corner) => this.maps.geometry.seen(corner)) : (region?.taxels ?? []).map((taxel) => this.maps.geometry.place(taxel));
    const middle = /** @type {[number, number]} */ ([0, 1].map((axis) => seen.reduce((sum, at) => sum + at[axis], 0) / seen.length));
    const places = region ? [middle, ...(corners.length ? seen : [])] : [];
    withChildren(this.handles, places.length, () => make("button", { type: "button" })).forEach((handle, k) => {
      handle.dataset.grip = String(k - 1);
      handle.setAttribute("aria-label", `${region?.name}${k ? `, corner ${k}` : ""}: arrow keys move it`);
      [handle.style.left, handle.style.top] = places[k].map((share) => `${100 * share}%`);
    });
  }

  /** The list: a field for each name, in the colour of its curve. */
  showList() {
    const known = [...this.list.children].map((item) => item.getAttribute("data-id")).join();
    if (known !== this.all.map(({ id }) => id).join()) this.list.replaceChildren(...this.all.map((region, k) => this.item(region.id, k)));
    this.all.forEach((region, k) => {
      const item = this.list.children[k];
      item.classList.toggle("chosen", region.id === this.chosen);
      const name = /** @type {HTMLInputElement} */ (item.querySelector("input"));
      if (name.value !== region.name) name.value = region.name;
    });
  }

  /** @param {number} id @param {number} k its place in the list */
  item(id, k) {
    const region = () => /** @type {Region} */ (this.all.find((one) => one.id === id));
    const name = make("input", { type: "text", required: true, maxlength: 100, "aria-label": `Name of region ${k + 1}`, autocomplete: "off" });
    name.onfocus = () => {
      this.draw("");
      this.chosen = id;
      this.show(false);
    };
    name.onchange = () => {
      const text = name.value.trim();
      const taken = this.all.some((one) => one.id !== id && one.name === text);
      if (!text || taken) {
        notify(taken ? `another region is called ${text}` : "a region needs a name", true);
        name.value = region().name;
      } else this.change(this.with(region(), { name: text }));
    };
    const away = make("button", { type: "button", class: "small", "aria-label": `Delete region ${k + 1}` }, "×");
    away.onclick = () => this.remove(region());
    const swatch = make("span", { class: "swatch" });
    swatch.style.background = regionColour(k);
    return make("li", { class: "row", "data-id": String(id) }, swatch, name, away);
  }

  /** @param {Region} region @returns {string} its load at the cursor, or at the time shown */
  says(region) {
    const { cursor_us = null, t_us = null, column_us = 1 } = this.timeline() ?? {};
    const load = this.at(region, Math.floor((cursor_us ?? t_us ?? NaN) / column_us), column_us);
    return load ? `${rounded(load[1])} ${this.units[this.measure]}` : "";
  }

  /** @param {boolean} replace over a file that is there */
  async write(replace) {
    const regions = this.all.map(({ name, corners, taxels }) => ({ name, corners, taxels }));
    try {
      await this.server.request({ type: "write_regions", regions, replace });
      part("region-replace", HTMLButtonElement).hidden = true;
      notify(`wrote ${this.file}`);
    } catch (error) {
      part("region-replace", HTMLButtonElement).hidden = !(error instanceof RefusedError && error.field === "replace");
      failed(error);
    }
  }
}
