// Colours of values that can be read with a colour vision deficiency, and those of labels.

/** @typedef {"dark" | "light"} Theme */
/** @typedef {[number, number, number]} Colour red, green, blue, 0 to 255 */

/** 64 knots of the map lipari, darkest first, six digits a colour. Source and licence: vendor/colour-maps.LICENSE. */
const KNOTS =
  "03132605182d061d3507223c0928440b2d4b0e335313385a183e611e436825486d2f4e733852773f567947587a4d5a7b" +
  "535c7a585d7a5d5d79625e78665e776b5f76705f74745f73795f727e607183606f89606e8e616c94616b9a6169a06268" +
  "a86266ae6364b56363bc6461c36660ca675fd06a5ed76d5edd715fe17660e57b62e88165e98768ea8d6bea926ee99872" +
  "e89d76e7a279e6a77de6ac81e5b186e5b88ce6bd92e7c398e9c99febcfa7edd5aff0dbb7f3e1c0f6e8c9faeed1fdf5da";

/** Change, less to more: to either side of the background. Blue and orange differ for every kind of colour blindness. */
/** @type {Record<Theme, Colour[]>} */
const CHANGE = {
  dark: [[207, 228, 255], [91, 157, 255], [29, 66, 140], [13, 16, 23], [122, 51, 12], [240, 128, 48], [255, 222, 190]],
  light: [[6, 41, 102], [20, 92, 196], [144, 187, 240], [238, 241, 246], [243, 178, 132], [194, 82, 16], [92, 31, 4]],
};

const LABEL_COLOURS = 6;
/** The number of the colour of each label that was met. @type {Map<string, number>} */
const labels = new Map();

/**
 * A label has the same colour in every window, live and in replay: one that its letters choose, or the next that is free.
 * @param {string} label
 * @returns {string} the name of its colour in the theme
 */
export function labelColour(label) {
  let number = labels.get(label);
  if (number === undefined) {
    const taken = new Set(labels.values());
    number = [...label].reduce((sum, letter) => (sum * 31 + letter.charCodeAt(0)) % 65_521, 0) % LABEL_COLOURS;
    for (let i = 0; i < LABEL_COLOURS && taken.has(number); i++) number = (number + 1) % LABEL_COLOURS;
    labels.set(label, number);
  }
  return `label-${number}`;
}

/** Gives an element the colour of a label. @param {HTMLElement} element @param {string} label */
export function paintAs(element, label) {
  element.style.setProperty("--label", `var(--${labelColour(label)})`);
}

/** Colours of a taxel without any event so far: a chequered ground of two tones. */
/** @type {Record<Theme, [Colour, Colour]>} */
export const UNKNOWN = {
  dark: [[29, 33, 42], [41, 46, 57]],
  light: [[226, 229, 235], [210, 214, 222]],
};

/**
 * Mixes along evenly spaced knots.
 * @param {Colour[]} knots
 * @param {number} at 0 to 1
 * @returns {Colour}
 */
function mixed(knots, at) {
  const position = Math.min(1, Math.max(0, at)) * (knots.length - 1);
  const low = Math.min(knots.length - 2, Math.floor(position));
  const share = position - low;
  const [a, b] = [knots[low], knots[low + 1]];
  const channel = (/** @type {0 | 1 | 2} */ i) => Math.round(a[i] + (b[i] - a[i]) * share);
  return [channel(0), channel(1), channel(2)];
}

/**
 * A colour as a word of ImageData, as little-endian machines have it (all that run browsers).
 * @param {Colour} colour
 * @returns {number}
 */
export function word([red, green, blue]) {
  return ((255 << 24) | (blue << 16) | (green << 8) | red) >>> 0;
}

/**
 * 256 words from no pressure to the largest; in the light theme the map is turned round, so that zero is next to the background.
 * @param {Theme} theme
 * @returns {Uint32Array}
 */
export function pressureWords(theme) {
  /** @type {Colour[]} */
  const knots = [];
  for (let at = 0; at < KNOTS.length; at += 6) {
    const value = parseInt(KNOTS.slice(at, at + 6), 16);
    knots.push([value >> 16, (value >> 8) & 255, value & 255]);
  }
  if (theme === "light") knots.reverse();
  return Uint32Array.from({ length: 256 }, (_, i) => word(mixed(knots, i / 255)));
}

/**
 * 256 words from the largest decrease (0) by none (128) to the largest increase (255).
 * @param {Theme} theme
 * @returns {Uint32Array}
 */
export function changeWords(theme) {
  return Uint32Array.from({ length: 256 }, (_, i) => word(mixed(CHANGE[theme], 0.5 + Math.max(-1, (i - 128) / 127) / 2)));
}
