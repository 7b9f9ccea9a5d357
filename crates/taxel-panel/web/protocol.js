// The messages between server and page: docs/panel-protocol.md, version 1.

export const VERSION = 1;

/** The value of a taxel without any event so far. */
export const UNKNOWN_VALUE = 65535;
/** The area of a picture in which no taxel has a value, and the sum of a source of which none has one. */
export const MISSING = 0xffffffff;

/**
 * @typedef {{ x: number[], y: number[], area?: number[], unit: "mm" | null }} TaxelPlaces
 * @typedef {{ rows: number, columns: number, pitch_mm: number | [number, number] | null, name: string, exists: string | null, places?: TaxelPlaces, names?: string[] }} ArrayInfo
 * @typedef {{ type: "hello", protocol: number, taxel: string, live: boolean, array: ArrayInfo | null, udp: string | null, control: string | null,
 *   folder: string, open: string | null, readout: string[] | null, encoders: string[], most_message_bytes: number, column_us: number, columns_us: [number, number], time_columns: number,
 *   delta_intensity: boolean | null }} Hello
 * @typedef {{ type: "registers", known: boolean, stated: boolean, values: Record<string, number | boolean>, preset: string | null, frame_us: number,
 *   warnings: string[] }} RegistersMessage
 * @typedef {{ type: "presets", built_in: string[], own: Record<string, Record<string, number>>, path: string }} Presets
 * @typedef {{ count: number, p50_us: number | null, p99_us: number | null, max_us: number | null }} Latency
 * @typedef {{ state: "nothing" | "arriving" | "quiet" | "lost", since_ns: number | null, silent_s: number, heartbeat_us: number | null }} Arrival
 * @typedef {{ drift_ppm: number, delay: Latency, doubt: string | null }} Pace
 * @typedef {{ type: "counters", seconds: number, board_us: number | null, events: number, events_per_s: number | null, bytes_per_s: number | null,
 *   frames_per_s: number | null, lost: Record<string, number>, queue: number | null, latency: Record<string, Latency>, detections: number,
 *   wire_version: number | null, taring: boolean, arrival: Arrival, pace: Pace | null, reach_us: [number, number] | null, reach_bytes: number, viewers: number }} Counters
 * @typedef {{ type: "detection", label: string, t_us: number, known_us: number, latency_us: number | null }} Detection
 * @typedef {{ type: "spikes", encoder: string, trains: number, signed: boolean, t_ms: number[], train: number[], value: number[] | null,
 *   left_out: number, latency_ms: number }} Spikes
 * @typedef {{ type: "recorder", state: "idle" | "countdown" | "recording" | "finishing", name: string | null, index: number | null,
 *   file: string | null, label: string | null, advance: boolean, left_s: number | null, seconds: number | null, length_s: number | null,
 *   last: { file: string, verdict: string } | null, error: string | null }} Recorder
 * @typedef {{ name: string, bytes: number, modified_ns: number, labels: number | null }} FileInfo
 * @typedef {{ type: "recordings", folder: string, files: FileInfo[], readouts: string[] }} Recordings
 * @typedef {{ name: string, left: number, rows: number, columns: number, rest: "given" | "quiet" | "none", falls: boolean, on: string }} PictureSource
 * @typedef {{ count: number, unit: string, step: number, zero: number, floor: number, newtons: number | null, picture_us: number | null,
 *   sources: PictureSource[], flickering: Taxel[], trial: string | null, trials: string[], left_s: number | null }} Pictures
 * @typedef {{ t_us: number | null, text: string, source: string }} RecordedNote
 * @typedef {{ type: "loading", name: string, share: number }} Loading
 * @typedef {{ type: "opened", name: string, array: ArrayInfo, start_us: number | null, stop_us: number | null,
 *   touch_us: number | null, events: number, bytes: number, train: string, pictures: Pictures | null,
 *   verdict: string, unfinished: boolean, on: string, pace: Pace | null, registers: Record<string, number | boolean> | null,
 *   frame_us: number | null, markers: { t_us: number, start: boolean }[],
 *   notes: RecordedNote[], zeroed: Zeroing[], detections: { label: string, t_us: number, known_us: number }[] }} Opened
 * @typedef {{ type: "overview", source: string | null, start_us: number, step_us: number, events: number[],
 *   force: number[] }} Overview
 * @typedef {{ type: "transport", source: string | null, state: "following" | "playing" | "paused", speed: number, t_us: number | null }} Transport
 * @typedef {{ label_id: number, label: string, t_us: number, source: string, trial: string, replaces_us: number | null }} Label
 * @typedef {{ label: string, t_us: number, source: string, trial: string, replaces_us: number | null }} ConflictRow without a name: a note that counts no more
 * @typedef {{ conflict_id: number, missing: ConflictRow[], returned: ConflictRow[], new: ConflictRow[] }} Conflict
 * @typedef {{ type: "labels", name: string, path: string, labels: Label[], conflict: Conflict | null }} Labels
 * @typedef {[number, number]} Taxel column and row
 * @typedef {{ type: "health", source: string | null, taxels: number, heard: number, dead: Taxel[], stuck: Taxel[], noisy: Taxel[], untold: number }} Health
 * @typedef {{ taxel: Taxel, t_us: number, rest: number, before: number | null }} Zeroing
 * @typedef {{ type: "zeroed", taxels: Zeroing[] }} Zeroed
 * @typedef {{ type: "trained", name: string, readout: string, text: string }} Trained
 * @typedef {{ type: "training", text: string }} TrainingMessage
 * @typedef {{ type: "detections", source: string, readout: string, labels: string[], detections: { label: string, t_us: number, known_us: number }[] }} DetectionsMessage
 * @typedef {{ type: "board_line", at_ns: number, text: string }} BoardLine
 * @typedef {{ type: "cut", name: string, lost: string[] }} Cut
 * @typedef {{ place: string, kind: string, product: string | null, maker: string | null, serial: string | null }} Port
 * @typedef {{ type: "places", serial: Port[], addresses: { host: string, name: string }[] }} Places
 * @typedef {{ type: "done", id: number }} Done
 * @typedef {{ type: "refused", id?: number, what: string | null, reason: string, field: string | null }} Refused
 * @typedef {{ type: "warning", text: string }} Warning
 * @typedef {Hello | RegistersMessage | Presets | Counters | Detection | Spikes | Recorder | Recordings | Opened | Overview | Transport | Labels |
 *   Health | Zeroed | Trained | TrainingMessage | DetectionsMessage | BoardLine | Cut | Places | Loading | Done | Refused | Warning} Message
 */

/**
 * A picture, its sections as views of its bytes (little-endian, as every machine that runs browsers); null: not there.
 * @typedef {object} Picture
 * @property {boolean} live
 * @property {boolean} moves
 * @property {boolean} restart
 * @property {boolean} recording
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
 * @property {Uint32Array | null} sums four words a column: ticks, taxels, and the centre that `centres` reads
 * @property {Float32Array | null} centres the same words as floats: x at 2, y at 3
 * @property {Uint16Array | null} history least, greatest, last
 * @property {Uint16Array | null} rest
 * @property {"given" | "quiet" | "none"} restFrom where the rest comes from
 * @property {Uint8Array | null} spikes of the encoder, as the raster
 * @property {Uint16Array | null} channels ticks above rest of each channel, column after column
 * @property {Uint32Array | null} sources sum of each of several sources, column after column
 * @property {Float32Array | null} sourceCentres centre of each of them, x and y, column after column
 */

/**
 * Reads a picture.
 * @param {ArrayBuffer} buffer
 * @returns {Picture}
 */
export function readPicture(buffer) {
  const view = new DataView(buffer);
  if (view.getUint32(0) !== 0x54585031) throw new Error("a picture that does not begin with TXP1");
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
    const place = section(number);
    return place && new kind(buffer, place[0], place[1] / kind.BYTES_PER_ELEMENT);
  };
  return {
    live: (flags & 1) !== 0,
    moves: (flags & 2) !== 0,
    restart: (flags & 4) !== 0,
    recording: (flags & 8) !== 0,
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
    spikes: words(6, Uint8Array),
    channels: words(7, Uint16Array),
    sources: words(8, Uint32Array),
    sourceCentres: words(9, Float32Array),
  };
}
