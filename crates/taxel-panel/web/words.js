// Numbers as people read them.

/** How times are written: in seconds; of pictures without times, by their numbers, which are so many us apart. */
export const numbering = { picture_us: /** @type {number | null} */ (null) };

/** @param {number | null} us @param {number} [places] @returns {string} seconds, or the number of a picture */
export const seconds = (us, places = 3) =>
  us === null ? "–" : numbering.picture_us ? `picture ${whole(Math.floor(us / numbering.picture_us))}` : `${(us / 1e6).toFixed(places)} s`;

/** @param {number} value @returns {string} in three digits, as many as a curve or a map shows */
export const rounded = (value) => (Math.abs(value) >= 100 ? whole(value) : String(Number(value.toPrecision(3))));

/** @param {number} value @returns {string} a whole number, in groups of three */
export const whole = (value) => Math.round(value).toLocaleString("en");

/**
 * @param {number} count
 * @param {string} one
 * @param {string} [many]
 * @returns {string}
 */
export const counted = (count, one, many = `${one}s`) => `${whole(count)} ${count === 1 ? one : many}`;

/** @param {number} us @returns {string} a short time in the unit that suits */
export function short(us) {
  if (numbering.picture_us) return counted(us / numbering.picture_us, "picture");
  if (us < 1000) return `${us.toFixed(us < 10 ? 1 : 0)} µs`;
  if (us < 1e6) return `${(us / 1000).toFixed(us < 1e5 ? 1 : 0)} ms`;
  return `${(us / 1e6).toFixed(1)} s`;
}

/** @param {number} bytes @returns {string} */
export function size(bytes) {
  if (bytes < 1000) return `${bytes} B`;
  if (bytes < 1e6) return `${(bytes / 1e3).toFixed(0)} kB`;
  return bytes < 1e9 ? `${(bytes / 1e6).toFixed(1)} MB` : `${(bytes / 1e9).toFixed(2)} GB`;
}
