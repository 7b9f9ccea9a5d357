// The header's first words: what is shown, and which board or recording it is; whether anything arrives; and doubts, of which the first
// sentence is seen, and the others where they are asked for.

import { entitle, part, write } from "./dom.js";
import { counted, seconds, short } from "./words.js";

/** @typedef {import("./messages.js").Counters} Counters */
/** @typedef {import("./messages.js").Hello} Hello */
/** @typedef {import("./messages.js").Opened} Opened */
/** @typedef {import("./messages.js").Recorder} Recorder */
/** @typedef {import("./messages.js").Transport} Transport */

/** How long a board may take to send its first datagram, s. */
const FIRST_WITHIN_S = 1;

/**
 * Whether anything arrives from the live source, in words.
 * @param {Counters | null} counters
 * @param {string} address where it should arrive
 * @param {boolean} isBoard whether a board sends it, else a source of lines
 * @param {string} firewall what else may keep a board's datagrams away
 * @returns {{ word: string, text: string } | null} null: it does
 */
function silence(counters, address, isBoard, firewall) {
  if (!counters) return null;
  const { arrival, board_us, seconds: elapsed_s, taring } = counters;
  const since = `for ${short(1e6 * arrival.silent_s)}, since ${seconds(board_us)} by the clock of the ${isBoard ? "board" : "source"}`;
  if (arrival.state === "nothing") {
    const text = isBoard
      ? `Nothing has arrived at ${address} so far. Is the board on, and does it send to this address and port?${firewall}`
      : `Nothing has arrived from ${address} so far. Is the sensor connected, and does it print lines of numbers?`;
    return elapsed_s < FIRST_WITHIN_S ? null : { word: "Nothing arrives", text };
  }
  if (arrival.state === "lost" && !isBoard) return { word: "Silent", text: `The line is silent: nothing has arrived from ${address} ${since}.` };
  if (arrival.state === "lost") return { word: "Silent", text: `The board is silent: nothing has arrived ${since}, although it sends a heartbeat at least every ${short(arrival.heartbeat_us ?? 0)}.` };
  if (taring) return { word: "Tare", text: "Taking a tare: leave the sensor at rest." };
  return arrival.state === "quiet" ? { word: "Quiet", text: `Quiet: nothing has arrived ${since}.` } : null;
}

/** @param {string} text @returns {string} with a capital and a full stop; empty if there is none */
const sentence = (text) => text && `${text[0].toUpperCase()}${text.slice(1)}.`;

/** Values that fall from their rest show nothing. @param {Opened | null} opened @returns {string} what to do about it */
function fall(opened) {
  const sources = opened?.frames?.sources ?? [];
  const falling = sources.filter(({ falls }) => falls).map(({ name }) => name);
  if (!opened || !falling.length) return "";
  const names = falling.length < sources.length ? ` of ${falling.join(", ")}` : "";
  const file = `${opened.name.replace(/\.[^.]+$/, "")}.layout.toml`;
  return `The values${names} fall from their rest, so no pressure is shown. If smaller values mean more pressure, write “falls = true” into ${file} beside the recording, and open it again: every command reads this file.`;
}

/** What lay on a sensor while its rest was taken may hide there. @param {Opened | null} opened @returns {string} */
function preload(opened) {
  const sources = opened?.frames?.sources ?? [{ name: "", preload_at: opened?.preload_at ?? "" }];
  const loads = sources.filter((source) => source.preload_at).map(({ name, preload_at }) => (sources.length > 1 ? `${name}, ${preload_at}` : preload_at));
  return loads.length ? `Something pressed on the sensor while its rest was measured: ${loads.join("; ")}.` : "";
}

/** @param {Opened | null} opened @param {Hello | null} hello @returns {string} how many frames there are, and rows and columns of each sensor */
function shape(opened, hello) {
  const array = opened?.array ?? hello?.array;
  const { count, sources } = opened?.frames ?? { count: 0, sources: [] };
  const sensors = sources.length > 1 ? sources.map(({ name, rows, columns }) => `${name} ${rows} × ${columns}`).join(", ") : array ? `${array.rows} × ${array.columns}` : "";
  return [opened?.frames && counted(count, "frame"), sensors].filter(Boolean).join(", ");
}

/**
 * Writes them.
 * @param {{ connected: boolean, why: string }} connection
 * @param {Transport} transport
 * @param {Hello | null} hello
 * @param {Opened | null} opened
 * @param {Recorder | null} recorder
 * @param {Counters | null} counters
 * @param {string | null} opening the recording that is being read
 * @param {string} refused why the last one was not opened
 */
export function showState({ connected, why }, { source, state }, hello, opened, recorder, counters, opening, refused) {
  const recording = recorder?.state === "recording" ? recorder : null;
  const silent = connected && source === null && hello?.live ? silence(counters, hello.lines ?? `UDP ${hello.udp}`, hello.lines === null, hello.lines === null ? hello.firewall : "") : null;
  const [kind, word] = !connected
    ? ["lost", why ? "No connection" : "Connecting"]
    : source !== null || !hello?.live
      ? ["replay", opening !== null ? "Opening" : source === null ? "No recording" : "Replay"]
      : state !== "following"
        ? ["held", state === "playing" ? "Earlier" : "Held"]
        : silent
          ? ["quiet", silent.word]
          : ["live", "Live"];
  const cannotZero = source !== null || !hello?.live || hello.sensor !== hello.sources[0] || state !== "following";
  part("zero", HTMLButtonElement).hidden = cannotZero;
  part("zero-all", HTMLButtonElement).hidden = cannotZero;
  const pill = part("state", HTMLElement);
  pill.dataset.state = recording && kind !== "lost" ? "recording" : kind;
  write(part("state-word", HTMLElement), recording && kind !== "lost" ? `${word === "Live" ? "" : `${word}, `}Recording ${recording.file ?? ""}` : word);
  const doubt = (connected && (opened ? opened.pace : counters?.pace)?.doubt) || "";
  const nothing = connected && source === null && !hello?.live;
  const banner = part("silence", HTMLElement);
  const doubts = [sentence(doubt), nothing && refused, connected && preload(opened), connected && fall(opened)].filter((text) => typeof text === "string");
  const [first, more] = [0, 1].map((k) => doubts.map((text) => text.split(/(?<=[.?]) (.*)/)[k] ?? ""));
  write(part("silence-text", HTMLElement), [silent?.text, ...first].filter(Boolean).join(" "));
  write(part("silence-more", HTMLElement), more.filter(Boolean).join(" "));
  banner.hidden = !silent && !first.some(Boolean);
  banner.dataset.state = silent ? "silent" : "doubt";
  const subject = !connected ? why : opening !== null ? `reading ${opening} …` : source !== null ? source : hello?.live ? `${hello.udp ?? ""}` : "Open a recording below";
  const about = [subject, connected && source !== null && opening === null && opened?.verdict, shape(opened, hello)].filter(Boolean).join(" · ");
  write(part("source", HTMLElement), about);
  entitle(part("source", HTMLElement), "title", about);
}
