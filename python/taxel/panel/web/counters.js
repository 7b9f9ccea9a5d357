// The counters in the header, and what was lost or damaged.

import { entitle, part, write } from "./dom.js";
import { integer } from "./words.js";

/** @typedef {import("./messages.js").Counters} CountersMessage */

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
  entitle(part("frames", HTMLElement), "title", counters.frames_per_s === null ? "unknown: give --preset, or connect the control line" : arrives ? "" : `nothing arrives; the registers state ${integer(counters.frames_per_s)}/s`);
  // What the kernel does not count may be more.
  put("lost", lost.by_kernel_known ? integer(lost.number) : lost.number > 0 ? `${integer(lost.number)} or more` : "unknown");
  part("lost-block", HTMLElement).classList.toggle("bad", lost.number > 0);
  put("queue", number(counters.queue, integer));
  // The latency of detections, where there are any; else that of decoding.
  const shown = latency.report?.count ? latency.report : latency.decode;
  put("latency", shown && shown.p50_us !== null && shown.p99_us !== null ? `${integer(shown.p50_us)} / ${integer(shown.p99_us)}` : "–");
  write(part("loss-list", HTMLElement), ...(lost.causes.length ? lost.causes : ["Nothing was lost or damaged."]));
  put("reach", counters.reach_us ? `The last ${((counters.reach_us[1] - counters.reach_us[0]) / 1e6).toFixed(0)} s can be viewed.` : "");
  put("wire", counters.wire_version ? `Wire version ${counters.wire_version}.` : "");
}
