// The counters in the header, and the losses by place.

import { entitle, make, part, write } from "./dom.js";
import { integer } from "./words.js";

/** @typedef {import("./messages.js").Counters} CountersMessage */

/** @type {Record<string, string>} where data can be lost */
const LOSSES = {
  kernel: "messages dropped because the socket's buffer was full",
  queue: "datagrams dropped because the queue before the decoder was full",
  wire: "datagrams lost or damaged on the way",
  damaged: "bytes that are not valid words",
  outside: "taxels outside the array",
  readout: "events dropped because the queue before the readout was full",
  panel: "events missing in this panel's curves and in its view of the past, but not in the recording",
};

/**
 * Writes the counters.
 * @param {CountersMessage} counters of the live source
 */
export function writeCounters(counters) {
  const number = (/** @type {number | null | undefined} */ value, /** @type {(value: number) => string} */ how) => (value === null || value === undefined ? "–" : how(value));
  const put = (/** @type {string} */ id, /** @type {string} */ text) => write(part(id, HTMLElement), text);
  const { lost, latency } = counters;
  put("events", number(counters.events_per_s, integer));
  put("data", number(counters.bytes_per_s, (bytes) => (bytes / 1e6).toFixed(2)));
  // The rate follows from the registers, so it says nothing of a board that is off.
  const arrives = counters.arrival.state === "arriving";
  put("frames", number(arrives ? counters.frames_per_s : null, integer));
  entitle(part("frames", HTMLElement), "title", counters.frames_per_s === null ? "unknown: give --rate-hz and --bits, or --preset, or connect the control line" : arrives ? "" : `nothing arrives; the registers state ${integer(counters.frames_per_s)}/s`);
  // Events that only the panel lacks are in every recording and in the readout.
  const all = Object.entries(lost).reduce((sum, [stage, count]) => sum + (stage === "panel" ? 0 : count ?? 0), 0);
  // What the kernel does not count may be more.
  put("lost", lost.kernel !== null ? integer(all) : all > 0 ? `${integer(all)} or more` : "unknown");
  part("lost-block", HTMLElement).classList.toggle("bad", all > 0);
  put("queue", number(counters.queue, integer));
  // The latency of detections, where there are any; else that of decoding.
  const shown = latency.report?.count ? latency.report : latency.decode;
  put("latency", shown && shown.p50_us !== null && shown.p99_us !== null ? `${integer(shown.p50_us)} / ${integer(shown.p99_us)}` : "–");
  const list = part("loss-list", HTMLElement);
  for (const [stage, count] of Object.entries(lost)) {
    let row = list.querySelector(`[data-place="${CSS.escape(stage)}"]`);
    if (!row) {
      row = make("tr", { "data-place": stage }, make("th", { scope: "row", title: LOSSES[stage] ?? "" }, stage), make("td"));
      list.append(row);
    }
    write(/** @type {Element} */ (row.lastElementChild), count === null ? "unknown" : integer(count));
  }
  put("reach", counters.reach_us ? `the last ${((counters.reach_us[1] - counters.reach_us[0]) / 1e6).toFixed(0)} s can be viewed` : "");
  put("wire", counters.wire_version ? `wire version ${counters.wire_version}` : "");
}
