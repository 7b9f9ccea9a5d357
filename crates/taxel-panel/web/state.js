// The header's first words: what is shown, and which board or recording it is.

import { part, write } from "./dom.js";

/** @typedef {import("./protocol.js").Hello} Hello */
/** @typedef {import("./protocol.js").Opened} Opened */
/** @typedef {import("./protocol.js").Recorder} Recorder */
/** @typedef {import("./protocol.js").Transport} Transport */

/**
 * Writes them.
 * @param {{ connected: boolean, why: string }} connection
 * @param {Transport} transport
 * @param {Hello | null} hello
 * @param {Opened | null} opened
 * @param {Recorder | null} recorder
 */
export function showState({ connected, why }, { source, state }, hello, opened, recorder) {
  const recording = recorder?.state === "recording" ? recorder : null;
  const [kind, word] = !connected
    ? ["lost", why ? "No connection" : "Connecting"]
    : source !== null || !hello?.live
      ? ["replay", source === null ? "No recording" : "Replay"]
      : state === "following"
        ? ["live", "Live"]
        : ["held", state === "playing" ? "Earlier" : "Held"];
  part("zero", HTMLButtonElement).hidden = kind !== "live";
  const pill = part("state", HTMLElement);
  pill.dataset.kind = recording && kind !== "lost" ? "rec" : kind;
  write(part("state-word", HTMLElement), recording && kind !== "lost" ? `${word === "Live" ? "" : `${word}, `}Recording ${recording.file ?? ""}` : word);
  const array = opened?.array ?? hello?.array;
  const shape = array ? `${array.rows} × ${array.columns}` : "";
  const place = !connected ? why : source !== null ? `${source} · ${opened?.verdict ?? ""}` : hello?.live ? `${hello.udp ?? ""}` : "Open a recording below";
  const text = [place, shape].filter(Boolean).join(" · ");
  write(part("source", HTMLElement), text);
  part("source", HTMLElement).title = text;
  document.documentElement.classList.toggle("recording", recording !== null);
}
