// Every key of the page, in one table, from which the help is made; a test compares the documentation with it.

import { make, part } from "./dom.js";

/** @typedef {{ keys: string[], shown: string, text: string, action: string }} Key */

/** @type {readonly Key[]} */
export const KEYS = [
  { keys: ["r"], shown: "R", text: "record, or stop", action: "record" },
  { keys: [" "], shown: "Space", text: "play or pause", action: "play" },
  { keys: ["."], shown: ".", text: "step to the next time with events", action: "stepOn" },
  { keys: [","], shown: ",", text: "step back", action: "stepBack" },
  { keys: ["ArrowRight"], shown: "→", text: "go forward by 0.1 s; with Shift by 1 s", action: "on" },
  { keys: ["ArrowLeft"], shown: "←", text: "go back by 0.1 s; with Shift by 1 s", action: "back" },
  { keys: ["Home"], shown: "Home", text: "go to the beginning", action: "first" },
  { keys: ["End"], shown: "End", text: "go to the end", action: "last" },
  { keys: ["+", "="], shown: "+", text: "faster", action: "faster" },
  { keys: ["-"], shown: "-", text: "slower", action: "slower" },
  { keys: ["z"], shown: "Z", text: "lanes: show half the time, around the cursor", action: "zoomIn" },
  { keys: ["x"], shown: "X", text: "lanes: show twice the time", action: "zoomOut" },
  { keys: ["a"], shown: "A", text: "lanes: show all of the time", action: "showAll" },
  { keys: ["s"], shown: "S", text: "put a second cursor at the cursor, or take it away: the time between both is shown", action: "second" },
  { keys: ["l"], shown: "L", text: "follow the board live", action: "live" },
  { keys: ["m"], shown: "M", text: "add a label at the cursor, or without a cursor at the time shown", action: "mark" },
  { keys: ["n"], shown: "N", text: "go to the next label; then arrow keys move it", action: "nextLabel" },
  { keys: ["p"], shown: "P", text: "go to the previous label", action: "labelBefore" },
  { keys: ["k"], shown: "K", text: "go to the next mistake of the readout: a missed label or a false detection", action: "nextMistake" },
  { keys: ["j"], shown: "J", text: "go to the previous mistake", action: "mistakeBefore" },
  { keys: ["Delete"], shown: "Delete", text: "delete the chosen label", action: "deleteLabel" },
  { keys: ["Ctrl z"], shown: "Ctrl Z", text: "undo the last change of labels", action: "undo" },
  { keys: ["["], shown: "[", text: "the part to cut begins here", action: "cutFrom" },
  { keys: ["]"], shown: "]", text: "the part to cut ends here", action: "cutTo" },
  { keys: ["o"], shown: "O", text: "choose a recording to open", action: "open" },
  { keys: ["c"], shown: "C", text: "go to the pressure map: arrow keys move the crosshair, Escape hides it", action: "crosshair" },
  { keys: ["0"], shown: "0", text: "zero all: use the present values as the rest", action: "zeroAll" },
  { keys: ["d"], shown: "D", text: "look for dead, stuck and noisy taxels", action: "health" },
  { keys: ["1", "2", "3", "4", "5"], shown: "1 to 5", text: "tab Board, Record, Labels, Train or View", action: "tab" },
  { keys: ["t"], shown: "T", text: "theme: dark, light or the system’s", action: "theme" },
  { keys: ["?"], shown: "?", text: "show this list", action: "help" },
];

/**
 * Calls the action of a key, unless the user types text or the focused element uses the key itself.
 * @param {Record<string, (event: KeyboardEvent) => void>} actions by name
 */
export function bindKeys(actions) {
  /** @type {Map<string, string>} */
  const byKey = new Map(KEYS.flatMap(({ keys, action }) => keys.map((key) => [key, action])));
  for (const action of byKey.values()) if (!actions[action]) throw new Error(`no action for key ${action}`);
  document.addEventListener("keydown", (event) => {
    if (event.altKey || event.defaultPrevented) return;
    const { target } = event;
    if (!(target instanceof Element)) return;
    const types = target instanceof HTMLInputElement && target.type !== "checkbox";
    if (types || target instanceof HTMLTextAreaElement || document.querySelector("dialog[open]")) return;
    const letter = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    // On a Mac it is the command key.
    const key = event.ctrlKey || event.metaKey ? `Ctrl ${event.shiftKey ? "Shift " : ""}${letter}` : letter;
    const action = byKey.get(key);
    if (!action || (event.repeat && ["record", "play", "mark", "theme"].includes(action))) return;
    // Elements with keys of their own: lists and sliders use arrows and letters, buttons and boxes the space bar.
    const moves = key.startsWith("Arrow") || key === "Home" || key === "End";
    if (target instanceof HTMLSelectElement || (moves && target.matches("input, [role=tab]"))) return;
    if (key === " " && target.matches("button, input, summary, a")) return;
    event.preventDefault();
    actions[action](event);
  });
}

/** Writes the table into the help. */
export function showKeys() {
  part("key-list", HTMLElement).replaceChildren(
    ...KEYS.map(({ shown, text }) => make("tr", {}, make("th", { scope: "row" }, make("kbd", {}, shown)), make("td", {}, text))),
  );
}
