// Frames, the binary messages of the server: docs/panel-protocol.md, version 1. Those that are text are in messages.d.ts.

export const VERSION = 1;

/** The value of a taxel without any event so far. */
export const UNKNOWN_VALUE = 65535;
/** The area where no taxel has a value. */
export const MISSING = 0xffffffff;

/**
 * A frame, its sections as views of its bytes (little-endian, as every machine that runs browsers); null: not there.
 * @typedef {object} Frame
 * @property {boolean} moves
 * @property {boolean} restart
 * @property {boolean} following
 * @property {number} rows
 * @property {number} columns
 * @property {number | null} t_us
 * @property {number} events
 * @property {number | null} watched
 * @property {number} column_us
 * @property {number} first number of the first column of time
 * @property {number} count
 * @property {Uint16Array | null} pressure
 * @property {Int8Array | null} change
 * @property {Uint8Array | null} raster
 * @property {Uint32Array | null} sums eight words a column: least and greatest ticks and taxels, and of the centre what `centres` reads
 * @property {Float32Array | null} centres the same words as floats: least and greatest x at 4, y at 6
 * @property {Uint16Array | null} history least, greatest, last
 * @property {Uint16Array | null} rest
 * @property {"given" | "quiet" | "none"} restFrom where the rest comes from
 * @property {Uint16Array | null} channels least and greatest ticks above rest of each channel, column after column
 * @property {Uint32Array | null} sources as `sums`, of each of several sources, column after column
 * @property {Float32Array | null} sourceCentres the same words as floats
 * @property {Uint32Array | null} now four words of all taxels, and then of each of several sources, at the time of the frame: ticks, taxels, and the centre
 * @property {Float32Array | null} nowCentres the same words as floats: x at 2, y at 3
 */

/**
 * Reads a frame.
 * @param {ArrayBuffer} buffer
 * @returns {Frame}
 */
export function readFrame(buffer) {
  const view = new DataView(buffer);
  if (view.getUint32(0) !== 0x54584631) throw new Error("the message's first bytes are not TXF1");
  const flags = view.getUint16(6, true);
  const t = view.getBigInt64(16, true);
  const watched = view.getUint32(40, true);
  /** @param {number} number @returns {[number, number] | null} */
  const section = (number) => {
    const [start, bytes] = [view.getUint32(64 + 8 * number, true), view.getUint32(68 + 8 * number, true)];
    return bytes ? [start, bytes] : null;
  };
  /**
   * @template T
   * @param {number} number
   * @param {{ new (buffer: ArrayBuffer, start: number, length: number): T, BYTES_PER_ELEMENT: number }} kind
   * @returns {T | null}
   */
  const words = (number, kind) => {
    const bounds = section(number);
    return bounds && new kind(buffer, bounds[0], bounds[1] / kind.BYTES_PER_ELEMENT);
  };
  return {
    moves: (flags & 2) !== 0,
    restart: (flags & 4) !== 0,
    following: (flags & 16) !== 0,
    restFrom: flags & 32 ? "given" : flags & 64 ? "quiet" : "none",
    rows: view.getUint16(12, true),
    columns: view.getUint16(14, true),
    t_us: t === -(2n ** 63n) ? null : Number(t),
    events: Number(view.getBigUint64(32, true)),
    watched: watched === 0xffffffff ? null : watched,
    column_us: view.getUint32(44, true),
    first: Number(view.getBigInt64(48, true)),
    count: view.getUint32(56, true),
    pressure: words(0, Uint16Array),
    change: words(1, Int8Array),
    raster: words(2, Uint8Array),
    sums: words(3, Uint32Array),
    centres: words(3, Float32Array),
    history: words(4, Uint16Array),
    rest: words(5, Uint16Array),
    now: words(6, Uint32Array),
    nowCentres: words(6, Float32Array),
    channels: words(7, Uint16Array),
    sources: words(8, Uint32Array),
    sourceCentres: words(8, Float32Array),
  };
}
