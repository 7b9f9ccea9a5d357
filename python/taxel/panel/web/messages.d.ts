// The messages of the server (taxel/panel) as the page reads them, and the keys of its requests, which taxel/panel/requests.py declares and documents.

/** A sensor. */
export interface ArrayInfo {
  rows: number;
  columns: number;
  /** A number of mm, or a pair for rows and columns; null where it is not known. A pitch of 1 mm is a pair. */
  pitch_mm: number | [number, number] | null;
  name: string;
  /** A digit a taxel, 0 or 1, row by row; null where all exist. */
  exists: string | null;
  /** Only where taxels have names, as the columns of a table: a text a taxel row by row, "" for one without. */
  names?: string[] | null;
  /** Only where they are known instead of a pitch. */
  places?: TaxelPlaces | null;
}

/** Whether datagrams arrive, since when none do, and how long they may be missing. */
export interface Arrival {
  /** Whether they arrive. */
  state: "nothing" | "arriving" | "quiet" | "lost";
  /** When the latest one arrived, ns since 1970. */
  since_ns: number | null;
  /** How long ago that was, s. */
  silent_s: number;
  /** The longest interval between two heartbeats, us. */
  heartbeat_us: number | null;
}

/** A recording of the folder. */
export interface FileInfo {
  name: string;
  bytes: number;
  modified_ns: number;
  /** Number of its labels, once they have been read. */
  labels: number | null;
}

/** A detection in a recording. */
export interface FoundDetection {
  label: string;
  t_us: number;
  /** Which of several sensors it is of; empty of a single one. */
  source: string;
}

/** A recording of frames. */
export interface FrameRecording {
  count: number;
  unit: string;
  /** A value is `(ticks - zero) * step`. */
  step: number;
  zero: number;
  /** Steps above rest up to which a taxel is not loaded. */
  floor: number;
  /** The force of 1 in the sums of the curves, N, where values are in kPa and the area of each taxel is known: each counts by its area; else null, and 1 is a step. */
  newtons: number | null;
  /** A number where the frames have no times: frame k is then at k times that many us, in all messages; show the number, no seconds. Tables of labels hold the numbers. */
  number_us: number | null;
  sources: FrameSourceInfo[];
  /** Taxels that never count as above rest. */
  trial: string | null;
  /** The trials of a file with several. */
  trials: string[];
}

/** A source of frames; sources are side by side in `array`. */
export interface FrameSourceInfo {
  name: string;
  /** Its first column. */
  left: number;
  rows: number;
  columns: number;
  /** `given`: 0, as the unit is one of force or pressure; `quiet`: that of a quiet stretch, tracked from there; `none`: nothing was quiet, the values are above 0. */
  rest: "given" | "quiet" | "none";
  /** Whether values fall from that of a quiet stretch, so that less may mean more pressure. */
  falls: boolean;
  /** Where something lay in that stretch and was taken away later, as text (`rows 2 to 4, columns 5 to 7 (up to 41 above rest)`); empty where nothing did. */
  preload_at: string;
}

/** How a neuron, or the plain rule beside it, detects a label. */
export interface LabelScore {
  /** The label. */
  label: string;
  /** Whether it is the plain rule's. */
  is_plain_rule: boolean;
  /** Whether it is the one that runs. */
  runs: boolean;
  /** Number of labels with a detection. */
  found: number;
  /** Number of labels without one. */
  missed: number;
  /** Number of detections without a label. */
  false: number;
  /** From the label until the detection is known, median, ms; null where none was found. */
  delay_ms: number | null;
}

/** The last recording. */
export interface LastRecording {
  file: string;
  verdict: string;
}

export interface Latency {
  decode: Quantiles;
  /** Of detections, from known to reported. */
  report: Quantiles;
}

/** The values of a live source of frames. */
export interface LiveFrames {
  unit: string;
  /** A value is `(ticks - zero) * step`. */
  step: number;
  zero: number;
  /** Time of the first frame, us: seconds are shown since then where times are those since 1970. */
  begin_us: number;
}

/** What was lost or damaged. */
export interface Lost {
  /** Losses of all causes; damage is none. */
  number: number;
  /** Whether the system counts what its kernel drops. */
  by_kernel_known: boolean;
  /** Number and words of each cause that happened. */
  causes: string[];
}

/** A label without a detection of the neuron, or a detection without a label. */
export interface Mistake {
  /** The label. */
  label: string;
  /** Board time, us. */
  t_us: number;
  /** Whether a label was missed; else a detection is false. */
  missed: boolean;
  /** The sensor that it is of, where the recording has several; else empty. */
  source: string;
  /** The trial that it is of, where the file holds several; else empty. */
  recording: string;
}

/** The drift and the delays that arrivals show. */
export interface Pace {
  /** Drift of the host's clock relative to the board's, parts per million. */
  drift_ppm: number;
  /** Delays beyond the shortest, of all datagrams so far. */
  delay: Quantiles;
  /** Why they cannot be, with the likely cause; `None` if they can. */
  doubt: string | null;
}

/** Quantiles of measured latencies, us; none if nothing was measured. */
export interface Quantiles {
  /** Number of measured durations. */
  count: number;
  /** Median. */
  p50_us: number | null;
  /** The 99th percentile. */
  p99_us: number | null;
  /** The maximum. */
  max_us: number | null;
}

/** A note of a recording. */
export interface RecordedNote {
  /** Null where it is about the whole recording. */
  t_us: number | null;
  text: string;
  /** Empty for all sources. */
  source: string;
}

/** The place of each taxel, row by row. */
export interface TaxelPlaces {
  x: number[];
  y: number[];
  /** Where it is known. */
  area: number[] | null;
  /** Null where it is unknown. */
  unit: "mm" | null;
}

/** A taxel that was zeroed. */
export interface Zeroing {
  taxel: [number, number];
  t_us: number;
  /** Its rest now, ticks. */
  rest: number;
  /** The readout's rest of it before; null where it uses none. */
  before: number | null;
}

/** The server and what it shows; sent again when any of it changes (`connect`, `read_out`). */
export interface Hello {
  type: "hello";
  /** 1. */
  protocol: number;
  /** False: no board, recordings only (`taxel view`). */
  live: boolean;
  array: ArrayInfo | null;
  /** Where datagrams are received. */
  udp: string | null;
  /** What else may keep datagrams from the server, in words that are added to why none arrived; empty if nothing. */
  firewall: string;
  /** Where frames of numbers are read; null of a board. */
  lines: string | null;
  /** That source as a text states it, with all of its keys; null of a board. */
  source: string | null;
  /** The names of the live sources: first the one that is read out, then those that are only recorded; empty without a board. */
  sources: string[];
  /** The one of them that this client follows. */
  sensor: string | null;
  /** The values of those frames, after the first one; null of a board, whose values are ticks. */
  frames: LiveFrames | null;
  /** The board's serial line; null: registers cannot be written. */
  control: string | null;
  /** The folder of the recordings. */
  folder: string;
  /** The recording to show first. */
  open: string | null;
  /** The labels of the readout that runs. */
  readout: string[] | null;
  /** Width of a column of time, us. */
  column_us: number;
  /** The narrowest and the widest that `zoom` takes, us. */
  columns_us: [number, number];
}

/** The registers that the board holds, or is assumed to hold; at the beginning and after every change. */
export interface Registers {
  type: "registers";
  /** False: they were not read from the board; they are the preset that was named on the command line, or what the board held before a reset (a new session of version 2, or its greeting on the serial line), until they are read again, which is at once. */
  known: boolean;
  /** Whether they were stated at the start (`--preset`). */
  stated: boolean;
  /** Every field of `presets` in its unit; those of one bit are true or false. */
  values: Record<string, boolean | number>;
  /** The preset that holds the same, the user's or built-in, whatever the version of the wire. */
  preset: string | null;
  /** How long a frame takes, us. */
  frame_us: number;
  warnings: string[];
}

/** The presets that the board can hold, and the fields of its registers. */
export interface Presets {
  type: "presets";
  built_in: string[];
  fields: Field[];
}

/** A field of the registers. */
export interface Field {
  name: string;
  /** The manual's name. */
  manual: string;
  text: string;
  /** Of one bit: `flag`. */
  unit: string;
  least: number;
  greatest: number;
  /** What a slider reaches: four times what any preset needs; the number takes whatever the register holds. */
  top: number;
}

/** Counts of the live source, 4 times a second; what is not known is null. */
export interface Counters {
  type: "counters";
  /** Since the source began. */
  seconds: number;
  board_us: number | null;
  events: number;
  events_per_s: number | null;
  bytes_per_s: number | null;
  /** Follows from the registers; null where they are neither known nor stated. */
  frames_per_s: number | null;
  /** Whether datagrams arrive. */
  arrival: Arrival;
  /** Null in the first quarter of a second. */
  pace: Pace | null;
  lost: Lost;
  /** Datagrams that wait. */
  queue: number;
  latency: Latency;
  wire_version: number;
  taring: boolean;
  detections: number;
  /** From and to where a live view may seek (60 s, or what 512 MB hold), us; null before the first event. */
  reach_us: [number, number] | null;
  viewers: number;
  /** Whether the source has ended, by an error or its owner. */
  ended: boolean;
}

/** A detection, as it is reported; after the greeting the latest that were reported before. */
export interface Detection {
  type: "detection";
  label: string;
  t_us: number;
  /** From known to reported, us. */
  latency_us: number;
}

/** All taxels of the live source that were zeroed, each as it was last; sent when that has changed. */
export interface Zeroed {
  type: "zeroed";
  taxels: Zeroing[];
}

/** The recorder, on each change and once a second while it counts or records. */
export interface Recorder {
  type: "recorder";
  /** What the recorder does. */
  state: "idle" | "recording" | "finishing";
  file: string | null;
  label: string | null;
  seconds: number | null;
  length_s: number | null;
  last: LastRecording | null;
  /** Why the last one ended or did not begin. */
  error: string | null;
}

/** When asked and when the folder has changed by this server. */
export interface Recordings {
  type: "recordings";
  folder: string;
  /** A ROS 2 bag that is a folder counts as one file. */
  files: FileInfo[];
  /** The folder's readouts and plain rules (`.json`). */
  readouts: string[];
}

/** A training has ended. */
export interface Trained {
  type: "trained";
  name: string;
  readout: string;
  /** How well the readout detects, in words. */
  text: string;
  /** On which labels it was scored: held-out ones, or those that it was trained on. */
  judged_on: string;
  /** The neuron of each label, and the plain rule beside it where there is one. */
  scores: LabelScore[];
  /** The labels that neurons missed, and their false detections, among the labels that `scores` count. */
  mistakes: Mistake[];
  /** The command that detects by it in a shell; empty if it cannot be relied on. */
  next: string;
  /** Each nearest detection minus its label over time, and loads beside the training's: files of SVG. */
  pictures: { title: string; svg: string }[];
}

/** To who trains, at each step: how far the training is, in words. */
export interface Training {
  type: "training";
  text: string;
}

/** When asked: what a readout found in a recording. */
export interface Detections {
  type: "detections";
  source: string;
  readout: string;
  /** The readout's, in its order. */
  labels: string[];
  detections: FoundDetection[];
}

/** The answer to `open`, before its first frame; `labels` and `transport` follow. */
export interface Opened {
  type: "opened";
  name: string;
  array: ArrayInfo;
  /** Null where it holds no events, as `stop_us`. */
  start_us: number | null;
  stop_us: number | null;
  /** The time of the greatest force in the first touch; null where there is no force. */
  touch_us: number | null;
  /** 0 of frames. */
  events: number;
  bytes: number;
  frames: FrameRecording | null;
  /** What was lost; empty where a file of frames does not say. */
  verdict: string;
  /** Of events, where something lay in the quiet stretch that the rest is first taken from, as of a source of frames. */
  preload_at: string;
  /** The pace of the recorded arrivals, where the recording holds them. */
  pace: Pace | null;
  registers: Record<string, boolean | number> | null;
  /** How long a frame takes, where the recording holds the registers. */
  frame_us: number | null;
  notes: RecordedNote[];
  zeroed: Zeroing[];
  detections: FoundDetection[];
  /** Whether it is a file of another program, of which `look` says what it holds. */
  has_roles: boolean;
}

/** What an answer changes in a layout: its keys, null for those that it states no more. */
export type Changes = Record<string, unknown>;

/** A column, an axis or an array of a file: `role`, and what each other role would change. */
export interface ShownRole {
  name: string;
  first: string[];
  role: string;
  why: string;
  certainty: "sure" | "likely" | "open";
  unit: string;
  menu: Record<string, Changes>;
  units: Record<string, Changes>;
  /** As in `Seen`. */
  curve: number[];
}

/** What is said of a whole file: one of some choices, or the value of a key. */
export type ShownField =
  | { label: string; value: string | null; choices: Record<string, Changes> }
  | { label: string; key: string; value: unknown; number: boolean };

/** What a file of another program, or a live source, holds by a layout, `text`; `seen` follows where it can be read. */
export interface Look {
  type: "look";
  name: string;
  text: string;
  roles: ShownRole[];
  /** How many columns are not listed. */
  more: number;
  /** What is open. */
  questions: { why: string; choices: Record<string, Changes> }[];
  fields: ShownField[];
  said: string[];
  /** The layout file of this recording, and that of its folder; none of the first lines of a live source, which `guess` asks for. */
  files: [string, string] | [];
}

/** The sensors of a file as a layout reads it, open questions answered by their first choices. */
export interface Seen {
  type: "seen";
  name: string;
  /** `levels`: 0 to 255, row by row, of the loaded moment; `curve`: least and greatest of each part of the time in turn, -1: no value. */
  sensors: { name: string; rows: number; columns: number; levels: number[]; curve: number[]; about: string }[];
  said: string[];
  refused: boolean;
}

/** Events, and the greatest sum of ticks above rest, over time, for the strip: 1000 bins at most. */
export interface Overview {
  type: "overview";
  /** Null for the live one. */
  source: string | null;
  start_us: number;
  step_us: number;
  /** Empty of frames. */
  events: number[];
  /** Empty where the recording is too long for its curves to be stored. */
  force: number[];
}

/** When a view's state changes by itself or by request. */
export interface Transport {
  type: "transport";
  source: string | null;
  /** What a view does. */
  state: "playing" | "paused" | "following";
  speed: number;
  t_us: number | null;
}

/** With `opened`, and to all clients that show that recording when they change. */
export interface Labels {
  type: "labels";
  name: string;
  /** The table beside the recording. */
  path: string;
  labels: LabelRow[];
}

/** By the rules of `taxel.Recording` health (`taxel info`). A taxel is reported dead or stuck only where its neighbours were touched three times or more, or are known to rest above 0 and it is known to hold 0; or stuck where it holds the greatest value of all while its neighbours move. */
export interface Health {
  type: "health";
  source: string | null;
  taxels: number;
  /** That did nothing while they were touched, and hold 0 as far as is known. */
  dead: [number, number][];
  /** That did nothing while they were touched, and hold another value. */
  stuck: [number, number][];
  /** That change by themselves. */
  noisy: [number, number][];
  /** Number of taxels that were not touched enough to say. */
  untested: number;
}

/** `lost` is what the new file's kind cannot hold. */
export interface Cut {
  type: "cut";
  name: string;
  lost: string[];
}

/** A region: corners in the unit of the array's centre, or column and row of each taxel. */
export interface DrawnRegion {
  name: string;
  corners: [number, number][];
  taxels: [number, number][];
}

/** The regions of the file beside a recording, its name, and the units of their curves by measure. */
export interface Regions {
  type: "regions";
  source: string;
  file: string;
  units: Record<"load" | "peak" | "mean" | "area" | "x" | "y" | "end", string>;
  regions: DrawnRegion[];
}

/** Least and greatest of a measure of each region that was asked for in columns of time; null where there is no frame. A text says why a region has none. */
export interface Loads {
  type: "loads";
  source: string;
  measure: "load" | "peak" | "mean" | "area" | "x" | "y" | "end";
  first: number;
  count: number;
  column_us: number;
  curves: (([number, number] | null)[] | string)[];
}

/**
 * Largest or mean values of a time above rest, row after row, in the unit of the frames; corners of isobars at 20, 40, 60 and 80 % of their largest;
 * and the path of the centre of each sensor: time (us), x and y, null where nothing is loaded.
 */
export interface Picture {
  type: "picture";
  source: string;
  kind: "maximum" | "mean";
  start_us: number;
  stop_us: number;
  values: number[];
  isobars: [number, number][][];
  paths: ([number, number, number] | null)[][];
}

/** After the messages about everything that the request changed. */
export interface Done {
  type: "done";
  id: number | string;
}

/** Nothing has changed. */
export interface Refused {
  type: "refused";
  id: number | string | null;
  /** The `type` of the request. */
  what: string;
  reason: string;
  /** The register or key at fault. */
  field: string | null;
}

/** Text for the user; the client need not do anything. */
export interface Warning {
  type: "warning";
  text: string;
}

export interface CreditRequest {
  type: "credit";
  id?: number;
  n: number;
}

export interface WatchRequest {
  type: "watch";
  id?: number;
  taxel: [number, number] | null;
}

export interface ZeroRequest {
  type: "zero";
  id?: number;
  taxels: [number, number][];
}

export interface ZoomRequest {
  type: "zoom";
  id?: number;
  column_us: number;
  end_us?: number | null;
}

export interface SeekRequest {
  type: "seek";
  id?: number;
  t_us: number;
}

export interface PlayRequest {
  type: "play";
  id?: number;
  speed?: number | null;
}

export interface PauseRequest {
  type: "pause";
  id?: number;
}

export interface StepRequest {
  type: "step";
  id?: number;
  frames: number;
}

export interface LiveRequest {
  type: "live";
  id?: number;
}

export interface OpenRequest {
  type: "open";
  id?: number;
  name: string;
  trial?: string | null;
}

export interface LookRequest {
  type: "look";
  id?: number;
  name: string;
  text?: string | null;
  changes?: Changes | null;
}

export interface LayRequest {
  type: "lay";
  id?: number;
  name: string;
  text: string;
  folder?: boolean;
  replace?: boolean;
}

export interface RecordingsRequest {
  type: "recordings";
  id?: number;
}

export interface OverviewRequest {
  type: "overview";
  id?: number;
}

export interface SetRequest {
  type: "set";
  id?: number;
  values: Record<string, boolean | number>;
}

export interface ReadRequest {
  type: "read";
  id?: number;
}

export interface PresetApplyRequest {
  type: "preset_apply";
  id?: number;
  name: string;
}

export interface RecordRequest {
  type: "record";
  id?: number;
  name: string;
  label?: string | null;
  length_s?: number | null;
}

export interface StopRequest {
  type: "stop";
  id?: number;
}

export interface NoteRequest {
  type: "note";
  id?: number;
  text: string;
}

export interface UndoRequest {
  type: "undo";
  id?: number;
}

export interface HealthRequest {
  type: "health";
  id?: number;
}

export interface TrainRequest {
  type: "train";
  id?: number;
}

export interface TrainStopRequest {
  type: "train_stop";
  id?: number;
}

export interface ReadOutRequest {
  type: "read_out";
  id?: number;
  readout: string;
  use?: string;
}

export interface CutRequest {
  type: "cut";
  id?: number;
  start_us: number;
  stop_us: number;
  name: string;
}

export interface RegionsRequest {
  type: "regions";
  id?: number;
}

export interface LoadsRequest {
  type: "loads";
  id?: number;
  regions: DrawnRegion[];
  measure: "load" | "peak" | "mean" | "area" | "x" | "y" | "end";
  first: number;
  count: number;
  column_us: number;
}

export interface PictureRequest {
  type: "picture";
  id?: number;
  kind: "maximum" | "mean";
  start_us: number;
  stop_us: number;
}

export interface WriteRegionsRequest {
  type: "write_regions";
  id?: number;
  regions: DrawnRegion[];
  replace?: boolean;
}

/** A label of a recording. */
export interface LabelRow {
  label: string;
  /** Board time, us. */
  t_us: number;
  /** The source that it is of; empty for all of them. */
  source: string;
  /** The trial that it is of, where the file holds several; empty for all of them. */
  trial: string;
  /** Time of the recording's own note that it replaces, us. */
  replaces_us: number | null;
}

/** When asked: the serial ports that the system knows. */
export interface Ports {
  type: "ports";
  ports: { place: string, about: string }[];
}

/** When asked: what the curves are at a time, of all taxels and then of each of several sources; null where none has a value. */
export interface Values {
  type: "values";
  t_us: number;
  /** Ticks, taxels, column and row; the centre is null where nothing is pressed. */
  curves: ({ sum: number, area: number, x: number | null, y: number | null } | null)[];
  /** What the watched taxel holds, ticks; null where that is not known, or none is watched. */
  taxel: number | null;
}

export interface ValuesRequest {
  type: "values";
  id?: number;
  t_us: number;
}

export interface ChangeRequest {
  type: "change";
  id?: number;
  changes: { old?: LabelRow | null, new?: LabelRow | null }[];
}

export interface PortsRequest {
  type: "ports";
  id?: number;
}

export interface GuessRequest {
  type: "guess";
  id?: number;
  place: string;
  baud: number;
}

export interface ConnectRequest {
  type: "connect";
  id?: number;
  source: string;
  text?: string | null;
}

export interface SensorRequest {
  type: "sensor";
  id?: number;
  name: string;
}

export interface DisconnectRequest {
  type: "disconnect";
  id?: number;
}

export type Message =
  | Hello
  | Registers
  | Presets
  | Counters
  | Detection
  | Zeroed
  | Recorder
  | Recordings
  | Trained
  | Training
  | Detections
  | Opened
  | Look
  | Seen
  | Overview
  | Transport
  | Labels
  | Health
  | Cut
  | Regions
  | Loads
  | Picture
  | Done
  | Refused
  | Warning
  | Values
  | Ports;

export type Request =
  | CreditRequest
  | WatchRequest
  | ZeroRequest
  | ZoomRequest
  | SeekRequest
  | ValuesRequest
  | PlayRequest
  | PauseRequest
  | StepRequest
  | LiveRequest
  | OpenRequest
  | LookRequest
  | LayRequest
  | RecordingsRequest
  | OverviewRequest
  | SetRequest
  | ReadRequest
  | PresetApplyRequest
  | RecordRequest
  | StopRequest
  | NoteRequest
  | UndoRequest
  | HealthRequest
  | TrainRequest
  | TrainStopRequest
  | ReadOutRequest
  | CutRequest
  | RegionsRequest
  | LoadsRequest
  | PictureRequest
  | WriteRegionsRequest
  | ChangeRequest
  | PortsRequest
  | GuessRequest
  | ConnectRequest
  | SensorRequest
  | DisconnectRequest;
