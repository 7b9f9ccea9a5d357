// Made from registers.toml by tools/registers.py (`make registers`): edit that.

/**
 * @typedef {object} Field
 * @property {string} name
 * @property {string} manual the manual's name
 * @property {number} [register] none: the board's build
 * @property {number} [low] lowest bit
 * @property {number} bits
 * @property {number} offset what is added to the bits
 * @property {string} unit
 * @property {number | boolean} default at reset
 * @property {number} least
 * @property {number} greatest
 * @property {string} text
 *
 * @typedef {Record<string, number>} Values every field by name, in its unit, with steps, driven_lines and sense_lines
 * @typedef {{ rule: number, text: string }} BrokenRule
 */

/** @type {readonly Field[]} */
export const FIELDS = [
  { name: "random_lines", manual: "use_rand_row", register: 0, low: 0, bits: 1, offset: 0, unit: "flag", default: false, least: 0, greatest: 1, text: "Lines are driven in random order." },
  { name: "mechanoreceptor", manual: "comparator_mode", register: 0, low: 1, bits: 1, offset: 0, unit: "flag", default: false, least: 0, greatest: 1, text: "If set, each taxel is an FA-1 afferent (5.4.2): events are its spikes, intensities its integral. Otherwise events are changes." },
  { name: "invert_comparator", manual: "invert_comparator", register: 0, low: 2, bits: 1, offset: 0, unit: "flag", default: false, least: 0, greatest: 1, text: "A falling edge ends a sample." },
  { name: "frame_sync", manual: "use_frame_sync", register: 0, low: 3, bits: 1, offset: 0, unit: "flag", default: true, least: 0, greatest: 1, text: "All events of a frame have the time at which the frame starts." },
  { name: "wire_version", manual: "wire_version", register: 0, low: 4, bits: 2, offset: 1, unit: "version", default: 1, least: 1, greatest: 2, text: "Version of the wire protocol that the board uses (our reading: the manual has only one version)." },
  { name: "pattern", manual: "pattern", register: 0, low: 6, bits: 1, offset: 0, unit: "flag", default: false, least: 0, greatest: 1, text: "The board sends the values of a simulated rolling ball instead of the comparators' values (our reading: the manual has no such bit)." },
  { name: "threshold_jump", manual: "threshold_jump", register: 0, low: 16, bits: 16, offset: 0, unit: "1/256 theta_0", default: 0, least: 0, greatest: 65535, text: "FA-1: how much a spike raises the threshold (T A of Table 5.3)." },
  { name: "line_period", manual: "row_change_period", register: 1, low: 0, bits: 32, offset: 0, unit: "10 ns", default: 300, least: 1, greatest: 4294967295, text: "Time from one driven line to the next." },
  { name: "line_read", manual: "row_read_duration", register: 2, low: 0, bits: 32, offset: 0, unit: "10 ns", default: 300, least: 1, greatest: 4294967295, text: "Part of line_period in which the line is read." },
  { name: "step_period", manual: "col_change_period", register: 3, low: 0, bits: 16, offset: 0, unit: "10 ns", default: 75, least: 1, greatest: 65535, text: "Time from one multiplexer step to the next." },
  { name: "step_read", manual: "col_read_duration", register: 3, low: 16, bits: 16, offset: 0, unit: "10 ns", default: 55, least: 4, greatest: 65535, text: "Part of step_period in which the channels are read." },
  { name: "ramp", manual: "ramp_time", register: 4, low: 0, bits: 16, offset: 0, unit: "ticks", default: 150, least: 1, greatest: 65534, text: "Duration of the ramp." },
  { name: "threshold_rest", manual: "threshold_rest", register: 4, low: 16, bits: 16, offset: 0, unit: "1/1024", default: 0, least: 0, greatest: 65535, text: "FA-1: theta_0, in ticks after the power law." },
  { name: "threshold_decay", manual: "threshold_decay", register: 5, low: 0, bits: 8, offset: 0, unit: "1/1024 theta_0", default: 0, least: 0, greatest: 255, text: "FA-1: how much a frame without a spike lowers the threshold (B of Table 5.3)." },
  { name: "noise_floor", manual: "noise_floor", register: 5, low: 8, bits: 8, offset: 0, unit: "ticks", default: 3, least: 0, greatest: 255, text: "Largest difference that does not cause an event." },
  { name: "lines", manual: "nrows", register: 5, low: 16, bits: 8, offset: 1, unit: "lines", default: 64, least: 1, greatest: 256, text: "Number of driven lines (the register contains one less; the manual's field has 6 bits, our reading: 8)." },
  { name: "record", manual: "record", register: 7, low: 16, bits: 1, offset: 0, unit: "flag", default: false, least: 0, greatest: 1, text: "A recording is running: setting and clearing this bit sends a marker and switches the sync line." },
  { name: "channels", manual: "channels", bits: 8, offset: 0, unit: "channels", default: 16, least: 0, greatest: 255, text: "Channels of the converter, 16 or 64: a property of the board, not a register." },
];

/** @type {readonly { name: string, sense_lines: number, values: Record<string, number> }[]} */
export const PRESETS = [
  { name: "5.2 kHz", sense_lines: 64, values: {} },
  { name: "2 kHz", sense_lines: 64, values: { line_period: 781, line_read: 780, step_period: 195, step_read: 175, ramp: 510, noise_floor: 10 } },
  { name: "20.8 kHz", sense_lines: 64, values: { line_period: 75, line_read: 75, channels: 64 } },
  { name: "5.2 kHz, 64 channels", sense_lines: 64, values: { step_period: 300, step_read: 280, ramp: 825, noise_floor: 16, channels: 64 } },
  { name: "5.2 kHz, FA-1", sense_lines: 64, values: { mechanoreceptor: 1, threshold_rest: 33, threshold_jump: 983, threshold_decay: 51 } },
  { name: "128 x 128, 1 kHz", sense_lines: 128, values: { line_period: 781, line_read: 780, step_period: 390, step_read: 370, ramp: 1095, noise_floor: 22, lines: 128, channels: 64, wire_version: 2 } },
  { name: "128 x 128, 2 kHz", sense_lines: 128, values: { line_period: 390, line_read: 390, step_period: 195, step_read: 175, ramp: 510, noise_floor: 10, lines: 128, channels: 64, wire_version: 2 } },
  { name: "128 x 128, 5.2 kHz", sense_lines: 128, values: { line_period: 150, line_read: 150, lines: 128, channels: 64, wire_version: 2 } },
  { name: "128 x 128, 1.3 kHz", sense_lines: 128, values: { line_period: 600, line_read: 600, lines: 128, wire_version: 2 } },
];

/**
 * 10 ns units as us, with two decimals.
 * @param {number} units
 * @returns {string}
 */
const us = (units) => (units / 100).toFixed(2);

/**
 * All rules that these registers break, in the order in which the board checks them; the board reports the first.
 * @param {Values} v
 * @returns {BrokenRule[]}
 */
export function refused(v) {
  /** @type {BrokenRule[]} */
  const broken = [];
  for (const { name, least, greatest, unit } of FIELDS) {
    if (unit !== "flag" && (v[name] < least || v[name] > greatest)) {
      broken.push({ rule: 4, text: `${name} is ${v[name]}: must be from ${least} to ${greatest} (rule 4)` });
    }
  }
  const { random_lines, wire_version, line_period, line_read, step_period, step_read, ramp, lines, channels, steps, driven_lines, sense_lines } = v;
  if (lines > driven_lines) broken.push({ rule: 4, text: `lines is ${lines}: must be at most ${driven_lines}, the number of the array's columns (rule 4)` });
  if (line_read > line_period) broken.push({ rule: 1, text: `line_read ${us(line_read)} us is longer than line_period ${us(line_period)} us (rule 1)` });
  if (step_read > step_period) broken.push({ rule: 1, text: `step_read ${us(step_read)} us is longer than step_period ${us(step_period)} us (rule 1)` });
  if (steps * step_period > line_read) broken.push({ rule: 2, text: `step_period ${us(step_period)} us is too long for line_read ${us(line_read)} us: ${steps} steps take ${us(steps * step_period)} us (rule 2)` });
  if (ramp + 5 > 3 * step_read) broken.push({ rule: 3, text: `ramp ${ramp} ticks is too long for step_read ${us(step_read)} us = ${3 * step_read} ticks: the ramp must be at least 5 ticks shorter (rule 3)` });
  if (random_lines !== 0 && 16 * lines > line_period) broken.push({ rule: 5, text: `random_lines: moving to any of ${lines} lines takes up to ${us(16 * lines)} us, longer than line_period ${us(line_period)} us (rule 5)` });
  if (channels + 10 > step_period) broken.push({ rule: 7, text: `step_period ${us(step_period)} us is too short for ${channels} channels: the logic compares one channel per clock and needs ${us(channels + 10)} us (rule 7)` });
  if (wire_version !== 2 && (driven_lines > 64 || sense_lines > 64)) broken.push({ rule: 8, text: `wire_version ${wire_version} can address only 64 x 64 taxels, but the array has ${sense_lines} x ${driven_lines}: choose version 2 (rule 8)` });
  return broken;
}

/**
 * Rules that only warn: settings that are allowed but hardly intended.
 * @param {Values} v
 * @returns {BrokenRule[]}
 */
export function warned(v) {
  /** @type {BrokenRule[]} */
  const broken = [];
  const { random_lines, step_period, step_read, ramp, noise_floor, lines } = v;
  if (step_period - step_read < 20) broken.push({ rule: 5, text: `step_period ${us(step_period)} us leaves only ${us(step_period - step_read)} us before step_read ${us(step_read)} us: taxels need ${us(20)} us to settle (rule 5)` });
  if (random_lines !== 0 && 16 * lines + 20 > step_period - step_read) broken.push({ rule: 5, text: `random_lines: only ${us(step_period - step_read)} us are left before step_read: with ${lines} lines, taxels need ${us(16 * lines + 20)} us to settle (rule 5)` });
  if (noise_floor >= ramp) broken.push({ rule: 6, text: `noise_floor ${noise_floor} ticks must be below ramp ${ramp} ticks: otherwise the board sends no events (rule 6)` });
  return broken;
}
