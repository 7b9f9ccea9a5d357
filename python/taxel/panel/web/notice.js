// The notice in the header: results and errors for the user.

import { part, write } from "./dom.js";

/** How long a notice is shown, ms. */
const SHOWN_MS = 8000;

/** @type {number | undefined} */
let timer;

/**
 * @param {string} text
 * @param {boolean} [bad]
 * @param {{ text: string, action: () => void }} [offer] a button beside the text
 */
export function notify(text, bad = false, offer) {
  const button = part("notice-offer", HTMLButtonElement);
  button.hidden = !offer;
  write(button, offer?.text ?? "");
  button.onclick = () => {
    silence();
    offer?.action();
  };
  const notice = part("notice", HTMLElement);
  notice.hidden = false;
  notice.classList.toggle("bad", bad);
  write(part("notice-text", HTMLElement), ...text.split("\n"));
  clearTimeout(timer);
  // Lines to be copied stay until they are closed.
  if (text.includes("\n")) return;
  timer = setTimeout(() => silence(), SHOWN_MS);
}

/** Takes the notice away. @param {string} [text] only if this is its text */
export function silence(text) {
  if (text !== undefined && part("notice-text", HTMLElement).textContent !== text) return;
  part("notice", HTMLElement).hidden = true;
  write(part("notice-text", HTMLElement), "");
}

/** @param {unknown} error shown to the user whose request failed */
export function failed(error) {
  notify(error instanceof Error ? error.message : String(error), true);
}

part("notice-close", HTMLButtonElement).onclick = () => silence();
