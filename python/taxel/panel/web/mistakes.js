// What a training missed or detected falsely among the labels that it was scored on: counted in a table, marked over the lanes, walked through.

import { make, part, write } from "./dom.js";
import { putMarks } from "./marks.js";
import { notify } from "./notice.js";
import { integer, seconds, short } from "./words.js";

/** @typedef {import("./messages.js").LabelScore} LabelScore */
/** @typedef {import("./messages.js").Mistake} Mistake */
/** @typedef {import("./messages.js").Trained} Trained */
/** @typedef {import("./timeline.js").Timeline} Timeline */

/** @param {Mistake} mistake @returns {string} */
const described = ({ label, t_us, missed, source }) => `${missed ? "missed" : "false"} ${label} at ${seconds(t_us)}${source ? `, ${source}` : ""}`;

/** The result of the last training of the recording that is shown. */
export class Mistakes {
  /** @param {import("./player.js").Player} player @param {() => void} changed called when the marks are others */
  constructor(player, changed) {
    this.player = player;
    this.changed = changed;
    /** Those of all trials of the recording. @type {Mistake[]} */
    this.found = [];
    /** Whether a training of this recording has ended. */
    this.judged = false;
    /** The trial that is shown, where the file holds several. @type {string | null} */
    this.trial = null;
    part("mistake-next", HTMLButtonElement).onclick = () => this.go(1);
    part("mistake-before", HTMLButtonElement).onclick = () => this.go(-1);
  }

  /** @returns {Mistake[]} those of the trial that is shown, by time */
  get shown() {
    return this.found.filter(({ recording }) => this.trial === null || recording === this.trial).sort((a, b) => a.t_us - b.t_us);
  }

  /** @param {Trained} trained */
  take({ judged_on, scores, mistakes, pictures }) {
    this.found = mistakes;
    this.judged = true;
    write(part("train-judged", HTMLElement), judged_on);
    part("train-rows", HTMLElement).replaceChildren(...scores.map(row));
    part("train-pictures", HTMLElement).replaceChildren(...pictures.map(({ title, svg }) => make("img", { alt: title, title, src: `data:image/svg+xml,${encodeURIComponent(svg)}` })));
    part("train-result", HTMLElement).hidden = false;
    this.show();
  }

  /** Another recording, or another trial of it, is shown. @param {string | null} trial @param {boolean} again whether it is the same recording */
  choose(trial, again) {
    this.trial = trial;
    if (!again) this.clear();
    else this.show();
  }

  clear() {
    this.found = [];
    this.judged = false;
    part("train-result", HTMLElement).hidden = true;
    this.show();
  }

  show() {
    const { shown } = this;
    const missed = shown.filter(({ missed }) => missed).length;
    const counts = this.found.length ? `${integer(missed)} missed, ${integer(shown.length - missed)} false` : "no mistakes";
    write(part("mistake-count", HTMLElement), `${counts}${this.trial === null ? "" : " in this trial"}`);
    for (const id of ["mistake-before", "mistake-next"]) part(id, HTMLButtonElement).disabled = !shown.length;
    this.changed();
  }

  /** @param {number} by 1: the next one after the time shown, -1: the one before */
  go(by) {
    const { shown } = this;
    if (!shown.length) return notify(this.found.length ? "no mistake in this trial" : this.judged ? "the training made no mistakes" : "no mistakes are known: train on labels first");
    const now = this.player.targetTime ?? 0;
    const others = shown.filter(({ t_us }) => (by > 0 ? t_us > now : t_us < now));
    const next = by > 0 ? others[0] : others[others.length - 1];
    if (!next) return notify(by > 0 ? "this is the last mistake" : "this is the first mistake");
    this.player.seek(next.t_us);
    notify(`${described(next)}: ${shown.indexOf(next) + 1} of ${shown.length}`);
  }

  /** Puts the marks over the lanes. @param {Timeline | null} timeline */
  mark(timeline) {
    const marks = this.shown.map((mistake) => ({ t_us: mistake.t_us, kind: mistake.missed ? "missed" : "false", title: described(mistake) }));
    putMarks(part("mistake-marks", HTMLElement), timeline, marks);
  }
}

/** @param {LabelScore} score @returns {HTMLElement} */
function row({ label, is_plain_rule, runs, found, missed, false: wrong, delay_ms }) {
  const cell = (/** @type {number} */ count, bad = false) => make("td", { class: bad && count ? "bad" : "" }, integer(count));
  const known = delay_ms === null ? "–" : `${delay_ms < 0 ? "−" : ""}${short(Math.abs(1000 * delay_ms))}`;
  const head = make("th", { scope: "row" }, label);
  const by = `${is_plain_rule ? "rule" : "neuron"}${runs ? ", runs" : ""}`;
  return make("tr", { class: `${is_plain_rule ? "rule" : "neuron"} ${runs ? "runs" : ""}` }, head, make("td", {}, by), cell(found), cell(missed, true), cell(wrong, true), make("td", {}, known));
}
