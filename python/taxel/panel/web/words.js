// Numbers as people read them.

/** Times from here on are taken to count from 1970, as those of ROS bags do, us: it is 2001-09-09. */
const SINCE_1970_US = 1e15;

/**
 * How times are written: in seconds, from `begin_us` on; of frames without times, by their numbers, which are so many us apart.
 */
export const numbering = { number_us: /** @type {number | null} */ (null), begin_us: 0 };

/** @param {number | null} start_us of a recording @returns {number} where its times are counted from, us: at its begin, if they count from 1970 */
export const beginning = (start_us) => (start_us !== null && start_us >= SINCE_1970_US ? start_us : 0);

/** @returns {string} date and time at 0 s; "" where times do not count from 1970 */
export const begun = () => (numbering.begin_us ? `${new Date(numbering.begin_us / 1000).toISOString().replace("T", " ").replace("Z", "")} UTC` : "");

/** @param {number} us @param {number} [decimals] @returns {string} the number that is written: seconds, or that of a frame */
export const writtenTime = (us, decimals = 3) =>
  numbering.number_us ? String(Math.floor(us / numbering.number_us)) : ((us - numbering.begin_us) / 1e6).toFixed(decimals);

/** @param {number} t_us @returns {string} to the microsecond, without zeros behind the millisecond */
export const listedTime = (t_us) => writtenTime(t_us, 6).replace(/(\.\d{3}\d*?)0{1,3}$/, "$1");

/** @param {string} written @returns {number} us; not a number for other text */
export const readTime = (written) => {
  const number = written.trim() ? Number(written.replace(",", ".")) : NaN;
  return numbering.number_us ? Math.round(number) * numbering.number_us : Math.round(number * 1e6) + numbering.begin_us;
};

/** @returns {"frames" | "seconds"} what a time is a number of */
export const timeUnit = () => (numbering.number_us ? "frames" : "seconds");

/** @param {number | null} us @param {number} [decimals] @returns {string} seconds, or the number of a frame */
export const seconds = (us, decimals = 3) =>
  us === null ? "–" : numbering.number_us ? `frame ${integer(Math.floor(us / numbering.number_us))}` : `${writtenTime(us, decimals)} s`;

/** @param {number} value @returns {string} in three digits, as many as a curve or a map shows */
export const rounded = (value) => (Math.abs(value) >= 100 ? integer(value) : String(Number(value.toPrecision(3))));

/** @param {number} value @returns {string} a whole number, in groups of three */
export const integer = (value) => (Math.round(value) || 0).toLocaleString("en");

/**
 * @param {number} count
 * @param {string} singular
 * @param {string} [plural]
 * @returns {string}
 */
export const counted = (count, singular, plural = `${singular}s`) => `${integer(count)} ${count === 1 ? singular : plural}`;

/** @param {string} unit @returns {string} the quantity that is measured in a unit; the ticks of a board are pressure */
export function quantity(unit) {
  if (unit === "counts") return "Counts";
  if (unit.includes("events")) return "Events";
  if (/^(m|k)?N$|^k?gf?$/.test(unit)) return "Force";
  if (/^(ticks|[hkM]?Pa|m?bar|psi|mmHg|N\/(cm|mm|m)[²2])$/.test(unit)) return "Pressure";
  return "Values";
}

/** @param {number} us @returns {string} a short time in the unit that suits */
export function short(us) {
  if (numbering.number_us) return counted(us / numbering.number_us, "frame");
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
