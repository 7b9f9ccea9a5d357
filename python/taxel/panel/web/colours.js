// Colour maps that can be read with a colour vision deficiency, and the colour of a value in them.

/** @typedef {"dark" | "light"} Theme */
/** @typedef {[number, number, number]} Colour red, green, blue, 0 to 255 */

/**
 * 64 knots of each map, darkest first, six digits a colour. Sources and licences: vendor/colour-maps.LICENSE.
 * @type {Record<string, string>}
 */
const KNOTS = {
  lipari:
    "03132605182d061d3507223c0928440b2d4b0e335313385a183e611e436825486d2f4e733852773f567947587a4d5a7b" +
    "535c7a585d7a5d5d79625e78665e776b5f76705f74745f73795f727e607183606f89606e8e616c94616b9a6169a06268" +
    "a86266ae6364b56363bc6461c36660ca675fd06a5ed76d5edd715fe17660e57b62e88165e98768ea8d6bea926ee99872" +
    "e89d76e7a279e6a77de6ac81e5b186e5b88ce6bd92e7c398e9c99febcfa7edd5aff0dbb7f3e1c0f6e8c9faeed1fdf5da",
  batlow:
    "011959051f5a08255b0b2b5c0d315d0e365e0f3b5f103f60114360124761134b61154f621753621957621c5a621f5d61" +
    "23606027635f2c665d31695b376b583c6d56426f5248714f4f734c5575485b7745627941687b3e6f7d3a767f377d8134" +
    "8683308e852e95872c9d892ba58b2cad8c2db58e30bd8f34c49138cb923ed29343d9954ae09651e69858eb9a60f09c69" +
    "f49f72f8a17bfaa485fca78efdaa97fdaea2fdb1abfdb4b4fdb7bcfdbac4fdbccdfcbfd6fcc3dffbc6e8fbc9f1faccfa",
  cividis:
    "00224e00255400285b002b62002e6a0030700533711235701a386f213b6e273e6e2e416d33446d38476c3c4a6c404c6c" +
    "444f6c48526c4c556c50576c545a6d575d6d5b606e5e636f62656f656870696b716c6e727071737374757777767a7a78" +
    "7e7d788280798683798a86788e8978928c78958f779992779d9576a19975a59c74a99f73ada272b1a570b6a96fbaac6d" +
    "beaf6bc2b369c6b667cbb965cfbd62d4c15fd9c55cddc858e1cc55e6d051ead34cefd748f3db42f8df3cfde334fee838",
  viridis:
    "44015446075a470d6047136548186a481d6f482374482878472d7b46327e453781433d844241864046883e4a893c4f8a" +
    "3a538b38588c365c8d34608d32648e31688e2f6c8e2d708e2c738e2a778e297b8e277f8e26828e24868e238a8d218e8d" +
    "20928c1f968b1f9a8a1f9e891fa18721a58523a98326ad812ab07f2fb47c35b7793bbb7542be714ac16d52c5695ac864" +
    "63cb5f6ccd5a75d0547fd34e89d54895d840a0da39aadc32b5de2bc0df25cae11fd5e21adfe318eae51af4e61efde725",  grey: "000000" + "ffffff",
};

/** The maps by name; in the light theme each is turned round, so that zero is next to the background. */
export const MAPS = Object.freeze(Object.keys(KNOTS));

/** Change, less to more: to either side of the background. Blue and orange differ for every kind of colour blindness. */
/** @type {Record<Theme, Colour[]>} */
const CHANGE = {
  dark: [[207, 228, 255], [91, 157, 255], [29, 66, 140], [13, 16, 23], [122, 51, 12], [240, 128, 48], [255, 222, 190]],
  light: [[6, 41, 102], [20, 92, 196], [144, 187, 240], [238, 241, 246], [243, 178, 132], [194, 82, 16], [92, 31, 4]],
};

/** Names of labels in the order in which they were met: each has one colour on the whole page. @type {string[]} */
const labels = [];
const LABEL_COLOURS = ["label-0", "label-1", "label-2", "label-3", "label-4", "label-5"];

/** @param {string} label @returns {string} the name of its colour in the theme */
export function labelColour(label) {
  if (!labels.includes(label)) labels.push(label);
  return LABEL_COLOURS[labels.indexOf(label) % LABEL_COLOURS.length];
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
 * 256 words from no pressure to the largest.
 * @param {string} name one of MAPS
 * @param {Theme} theme
 * @param {number} gamma values from 0 to 1 are raised to 1 / gamma: above 1 makes weak pressure more visible
 * @returns {Uint32Array}
 */
export function pressureWords(name, theme, gamma) {
  const digits = KNOTS[name];
  /** @type {Colour[]} */
  const knots = [];
  for (let at = 0; at < digits.length; at += 6) {
    const value = parseInt(digits.slice(at, at + 6), 16);
    knots.push([value >> 16, (value >> 8) & 255, value & 255]);
  }
  if (theme === "light") knots.reverse();
  return Uint32Array.from({ length: 256 }, (_, i) => word(mixed(knots, (i / 255) ** (1 / gamma))));
}

/**
 * 256 words from the largest decrease (0) by none (128) to the largest increase (255).
 * @param {Theme} theme
 * @param {number} gamma as of pressure
 * @returns {Uint32Array}
 */
export function changeWords(theme, gamma) {
  return Uint32Array.from({ length: 256 }, (_, i) => {
    const signed = Math.max(-1, (i - 128) / 127);
    return word(mixed(CHANGE[theme], 0.5 + (Math.sign(signed) * Math.abs(signed) ** (1 / gamma)) / 2));
  });
}
