// Detections: the list beside the views, and the marks over the lanes.

import { paintAs } from "./colours.js";
import { make, part, write } from "./dom.js";
import { putMarks } from "./marks.js";
import { seconds, short, integer } from "./words.js";

/** @typedef {{ label: string, t_us: number, latency_us: number | null, source: string }} Detection `source`: which of several sensors it is of, else empty */
/** @typedef {import("./timeline.js").Timeline} Timeline */

/** Detections of a recording, in their order. @param {{ label: string, t_us: number, source: string }[]} found @returns {Detection[]} */
export const recorded = (found) => found.map(({ label, t_us, source }) => ({ label, t_us, latency_us: null, source }));

/** What it is, and of which of several sensors. @param {{ label: string, source: string }} detection */
const named = ({ label, source }) => (source ? `${label}, ${source}` : label);

/** Detections of the live source that are stored, and the number of those that are listed. */
const MOST_STORED = 300;
const LISTED = 100;

/** Shapes of the marks, one for each label. */
const SHAPES = 4;

export class Detections {
  /** @param {(t_us: number) => void} seek */
  constructor(seek) {
    this.seek = seek;
    /** Those that are shown: of the live source newest first. @type {Detection[]} */
    this.shown = [];
    /** Those of the live source, newest first. @type {Detection[]} */
    this.live = [];
    /** The labels of the readout: their order gives the shape. @type {string[]} */
    this.labels = [];
    this.listed = -1;
  }

  /** @param {Detection} detection */
  add(detection) {
    // A server that the page has reached again sends those that it had sent before too.
    if (this.live.some(({ label, t_us }) => label === detection.label && t_us === detection.t_us)) return;
    this.live.unshift(detection);
    this.live.length = Math.min(this.live.length, MOST_STORED);
  }

  /** @param {Detection[]} detections of the live source newest first @param {string} none the text where there are none @param {string[]} labels in the order of their readout */
  show(detections, none, labels) {
    this.shown = detections;
    this.labels = labels;
    write(part("detection-count", HTMLElement), detections.length ? `${integer(detections.length)}${detections.length > LISTED ? `, ${LISTED} listed` : ""}` : "");
    const empty = part("detections-none", HTMLElement);
    empty.hidden = detections.length > 0;
    write(empty, none);
    this.listed = -1;
  }

  /** @param {string} label @returns {string} its class */
  shape(label) {
    return `shape shape-${Math.max(0, this.labels.indexOf(label)) % SHAPES}`;
  }

  /** Writes the list, if it has changed. */
  list() {
    if (this.listed === this.shown.length && this.listed < MOST_STORED) return;
    this.listed = this.shown.length;
    const rows = this.shown.slice(0, LISTED).map(({ label, t_us, latency_us, source }) => {
      // A line holds a frame that is over; a recording takes it as known at the time of the next one.
      const late = latency_us === null ? "" : latency_us < 0 ? "at once" : short(latency_us);
      const button = make(
        "button",
        { type: "button", class: "link row", "aria-label": `${named({ label, source })} at ${seconds(t_us)}${late && `, reported ${late === "at once" ? late : `${late} later`}`}` },
        make("span", { class: this.shape(label) }),
        make("span", { class: "what" }, named({ label, source })),
        make("span", { class: "when" }, seconds(t_us)),
        make("span", { class: "late" }, late),
      );
      paintAs(button, label);
      button.onclick = () => this.seek(t_us);
      return make("li", {}, button);
    });
    part("detection-list", HTMLElement).replaceChildren(...rows);
  }

  /** Puts the marks over the lanes. @param {Timeline | null} timeline */
  mark(timeline) {
    const marks = this.shown.map((found) => ({ ...found, kind: this.shape(found.label), title: `${named(found)} at ${seconds(found.t_us)}` }));
    putMarks(part("detection-marks", HTMLElement), timeline, marks);
  }
}
