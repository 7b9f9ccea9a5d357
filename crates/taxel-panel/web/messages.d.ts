// Made from the structs of crates/taxel-panel by tools/messages.py (`make messages`): edit those.

/** A label at one time or more. */
export interface MarkedTimes {
  label: string;
  t_us: number[];
  replaces_us?: number[] | null;
  source?: string | null;
}

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

/** A field of a topic of a ROS bag that holds numbers. */
export interface BagTopic {
  /** The topic. */
  topic: string;
  /** The field; empty for a topic of images. */
  field: string;
  /** Numbers in a message: rows and columns where the message states them. */
  shape: number[];
  /** Number of messages. */
  messages: number;
  /** Why it cannot be read; empty where it can. */
  trouble: string;
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
  known_us: number;
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
  flickering: [number, number][];
  trial: string | null;
  /** The trials of a file with several. */
  trials: string[];
  /** These are only the frames at the beginning of a large text table, and reading it all takes about so many seconds; `loading` follows each second, and then `opened` again, with all of it, at the same time of the view. */
  left_s: number | null;
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

/** An IPv4 address and its network interface. */
export interface InterfaceAddress {
  host: string;
  name: string;
}

/** A label of a recording. */
export interface Label {
  /** Valid as long as the server runs. */
  label_id: number;
  /** Its text; empty where a note of the recording is to count no more, and no label does in its place. */
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

/** How a neuron, or the plain rule beside it, detects a label. */
export interface LabelScore {
  /** The label. */
  label: string;
  /** Whether it is the plain rule's. */
  is_plain_rule: boolean;
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

/** Counts of lost data, by cause. */
export interface Lost {
  /** Messages; `null` where the system does not count them. */
  kernel: number | null;
  /** Datagrams. */
  queue: number;
  /** Datagrams of version 2 that never arrived intact. */
  wire: number;
  /** Bytes that were not valid words. */
  damaged: number;
  /** Taxels outside the array. */
  outside: number;
  /** Events that found no room before the readout. */
  readout: number;
  /** Events that only the panel's curves and its past lack: its held values are right again within 0.1 s. */
  panel: number;
}

/** A marker of the board's own recording. */
export interface Marker {
  t_us: number;
  start: boolean;
}

/** A label without a detection of the neuron, or a detection without a label. */
export interface Mistake {
  /** The label. */
  label: string;
  /** Board time, us. */
  t_us: number;
  /** Whether a label was missed; else a detection is false. */
  is_missed: boolean;
  /** The sensor that it is of, where the recording has several; else empty. */
  source: string;
  /** The trial that it is of, where the file holds several; else empty. */
  trial: string;
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

/** A serial port. */
export interface Port {
  /** Name of the port, as "COM3" or "/dev/ttyACM0". */
  place: string;
  /** "usb", "pci", "bluetooth" or "other". */
  kind: string;
  /** The product name of a USB device, if it reports it. */
  product: string | null;
  /** The manufacturer of a USB device, if it reports it. */
  maker: string | null;
  /** The serial number of a USB device, if it reports it. */
  serial: string | null;
  /** Vendor and product numbers of a USB device. */
  usb: [number, number] | null;
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

/** The server and what it shows; sent again when any of it changes (`listen`, `delta_intensity`, `control`). */
export interface Hello {
  type: "hello";
  /** 1. */
  protocol: number;
  /** taxel's version. */
  taxel: string;
  /** False: no board, recordings only (`taxel view`). */
  live: boolean;
  array: ArrayInfo | null;
  /** The options of the session by their names in Python, except sensor, registers, readout and tare; null without a board. */
  options: Record<string, unknown> | null;
  /** Where datagrams are received. */
  udp: string | null;
  /** What else may keep datagrams from the server, in words that are added to why none arrived; empty if nothing. */
  firewall: string;
  /** Where frames of numbers are read; null of a board. */
  lines: string | null;
  /** That source as a text states it, with all of its keys; null of a board. */
  source: string | null;
  /** The names of the live sources: first the one that is shown and read out, then those that are only recorded; empty without a board. */
  sources: string[];
  /** The values of those frames, after the first one; null of a board, whose values are ticks. */
  frames: LiveFrames | null;
  /** Whether intensities are differences; null without a board. */
  delta_intensity: boolean | null;
  /** The board's serial line; null: registers cannot be written. */
  control: string | null;
  /** The folder of the recordings. */
  folder: string;
  /** The recording to show first. */
  open: string | null;
  /** The labels of the readout that runs. */
  readout: string[] | null;
  /** The names of its encoders; empty without a readout, and of a plain rule. */
  readout_encoders: string[];
  /** The names of the encoders. */
  encoders: string[];
  /** Width of a column of time, us. */
  column_us: number;
  /** The narrowest and the widest that `zoom` takes, us. */
  columns_us: [number, number];
  /** Columns of time in a frame, at most. */
  time_columns: number;
  /** Bytes of a request, at most. */
  most_message_bytes: number;
  /** Credits that the server counts, at most. */
  most_credits: number;
}

/** The registers that the board holds, or is assumed to hold; at the beginning and after every change. */
export interface Registers {
  type: "registers";
  /** False: they were not read from the board; they are the preset that was named on the command line, or what the board held before a reset (a new session of version 2, or its greeting on the serial line), until they are read again, which is at once. */
  known: boolean;
  /** Whether they were stated at the start (`--preset`, or `--rate-hz` with `--bits`). */
  stated: boolean;
  /** Every field of `registers.js` in its unit; those of one bit are true or false. */
  values: Record<string, boolean | number>;
  /** The preset that holds the same, the user's or built-in, whatever the version of the wire. */
  preset: string | null;
  /** How long a frame takes, us. */
  frame_us: number;
  warnings: string[];
}

/** The presets that the board can hold. */
export interface Presets {
  type: "presets";
  built_in: string[];
  /** Those of the user, which hold every field. */
  user: Record<string, Record<string, boolean | number>>;
  /** The file of the user's: a table a preset, which can be edited by hand. */
  path: string;
}

/** Counts of the live source, 4 times a second; what is not known is null. */
export interface Counters {
  type: "counters";
  at_ns: number;
  /** Since the source began. */
  seconds: number;
  board_us: number | null;
  events: number;
  events_per_s: number | null;
  bytes_per_s: number | null;
  datagrams_per_s: number | null;
  /** Follows from the registers; null where they are neither known nor stated. */
  frames_per_s: number | null;
  /** Whether datagrams arrive. */
  arrival: Arrival;
  /** Null in the first quarter of a second. */
  pace: Pace | null;
  /** What is wrong if, after a gap, the rest of the taxels of frames differs from the tare. */
  rest_shift: string | null;
  /** Whether the values of frames fall under touch, so that no pressure is shown. */
  falls: boolean;
  lost: Lost;
  /** Datagrams that wait. */
  queue: number;
  latency: Latency;
  wire_version: number;
  marked_start: boolean | null;
  taring: boolean;
  detections: number;
  /** From and to where a live view may seek (60 s, or what 512 MB hold), us; null before the first event. */
  reach_us: [number, number] | null;
  reach_bytes: number;
  viewers: number;
  /** Frames sent to this client. */
  sent_frames_per_s: number;
  /** Whether the source has ended, by an error or its owner. */
  ended: boolean;
}

/** A detection, as it is reported; after the greeting the latest that were reported before. */
export interface Detection {
  type: "detection";
  label: string;
  t_us: number;
  known_us: number;
  reported_us: number;
  /** From known to reported, us. */
  latency_us: number;
  /** How steeply the potential crosses the threshold; null for a rule. */
  slope_mv_per_ms: number | null;
}

/** At most 60 times a second, after `encode`: the spikes since the last message; after a seek those of the stretch that is shown. An encoder that begins in the middle begins with the held values. */
export interface Spikes {
  type: "spikes";
  encoder: string;
  /** Whether its parameters are those of the readout that reads what is shown; else they are those of the request, and the defaults. */
  of_readout: boolean;
  trains: number;
  signed: boolean;
  latency_ms: number;
  t_ms: number[];
  train: number[];
  value: number[];
  /** Number of the others, where there are more than the 4096 newest. */
  left_out: number;
}

/** All taxels of the live source that were zeroed, each as it was last; sent when that has changed. */
export interface Zeroed {
  type: "zeroed";
  taxels: Zeroing[];
}

/** A line from the board's serial line. */
export interface BoardLine {
  type: "board_line";
  at_ns: number;
  text: string;
}

/** Where a board can be, when asked. Pseudo-terminals are in no list: type their name. */
export interface Places {
  type: "places";
  /** Serial ports that the system knows, USB devices first. */
  serial: Port[];
  /** The IPv4 addresses of the machine. */
  addresses: InterfaceAddress[];
}

/** The lines that arrive from a source, on request. */
export interface SourcePreview {
  type: "source_preview";
  /** The last lines that arrived. */
  lines: string[];
  /** The source with what the lines show added to it: array, lines of a frame, time. */
  source: string;
  /** What the lines seem to be, in words. */
  about: string;
}

/** A layout file was written. */
export interface LayoutSaved {
  type: "layout_saved";
  name: string;
  /** The command that reads the source in a shell. */
  command: string;
}

/** When asked: the fields with numbers of the topics of a ROS bag; empty of any other file. */
export interface Topics {
  type: "topics";
  name: string;
  topics: BagTopic[];
}

/** The recorder, on each change and once a second while it counts or records. */
export interface Recorder {
  type: "recorder";
  /** What the recorder does. */
  state: "idle" | "countdown" | "recording" | "finishing";
  name: string | null;
  /** The one in use, or the next when idle. */
  index: number | null;
  file: string | null;
  label: string | null;
  advance: boolean;
  /** To the start of a countdown, or to the end of a recording. */
  left_s: number | null;
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
}

/** When asked: the latest progress of the training that runs, first after 2 s; empty before, and where none runs. */
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
  /** The names of the readout's encoders; empty of a plain rule. */
  encoders: string[];
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
  /** The command that trains on its labels. */
  train: string;
  frames: FrameRecording | null;
  /** What was lost; empty where a file of frames does not say. */
  verdict: string;
  unfinished: boolean;
  /** Of events, where something lay in the quiet stretch that the rest is first taken from, as of a source of frames. */
  preload_at: string;
  /** The pace of the recorded arrivals, where the recording holds them. */
  pace: Pace | null;
  registers: Record<string, boolean | number> | null;
  /** How long a frame takes, where the recording holds the registers. */
  frame_us: number | null;
  markers: Marker[];
  notes: RecordedNote[];
  zeroed: Zeroing[];
  detections: FoundDetection[];
  /** How long reading it took. */
  index_ms: number;
}

/** How much of a large text table is read, 0 to 1, as its first lines let expect. */
export interface Loading {
  type: "loading";
  name: string;
  share: number;
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
  labels: Label[];
}

/** By the rules of `taxel.Recording` health (`taxel info`). A taxel is reported dead or stuck only where its neighbours were touched three times or more, or are known to rest above 0 and it is known to hold 0; or stuck where it holds the greatest value of all while its neighbours move. */
export interface Health {
  type: "health";
  source: string | null;
  taxels: number;
  /** Taxels with events. */
  active: number;
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

/** Credits for `n` more frames. */
export interface CreditRequest {
  type: "credit";
  id?: number;
  n: number;
}

/** Send this taxel's history; `null` for none. */
export interface WatchRequest {
  type: "watch";
  id?: number;
  taxel?: [number, number] | null;
}

/** The held values are the rest from now on (`now`, "reset intensity"), or find it again (`lowest`): that of the next quiet half second, tracked from there. The live source changes for all clients. */
export interface RestRequest {
  type: "rest";
  id?: number;
  /** How a rest is found. */
  how: "now" | "lowest";
}

/** The values that these taxels hold now are their rest from now on, for the readout's encoder, the frames of the recording and this panel; all or none. The recording notes the time and the rests before and after. Refused for a taxel without events, while a tare is taken, and while a `.lsa` is recorded. Answered at once; `zeroed` follows. */
export interface ZeroRequest {
  type: "zero";
  id?: number;
  taxels: [number, number][];
}

/** Spikes of this encoder (JSON as `Encoder.to_json` writes it) of what this view shows, live or in a recording; `null` for none. A name without parameters is that of the encoder of the readout that reads what is shown, with its parameters and its tare, where the readout has one of this name; else the parameters are the defaults. */
export interface EncodeRequest {
  type: "encode";
  id?: number;
  encoder?: Record<string, unknown> | null;
}

/** Columns of time of this width, for this view: 125 us times a power of two, up to 131 072 000 (0.16 s to 45 hours in 1250 columns). Counts of several narrow columns add up, to 15 at most. With `end_us`, in a view that does not follow the newest, the 1250 columns end there, wherever the view's time is, and stay until the next `zoom`; a view that plays beyond takes them along. Without it they end at the view's time. */
export interface ZoomRequest {
  type: "zoom";
  id?: number;
  column_us: number;
  end_us?: number | null;
}

/** Show this time: of the recording, or while live within the reach; stops playing. */
export interface SeekRequest {
  type: "seek";
  id?: number;
  t_us: number;
}

/** Play from there at this speed (board time over real time; the last one where left out), from the end of a recording from its beginning; live: from an earlier time at a fixed delay, refused while following. */
export interface PlayRequest {
  type: "play";
  id?: number;
  speed?: number | null;
}

/** Pause the view. Acquisition continues. */
export interface PauseRequest {
  type: "pause";
  id?: number;
}

/** Forward or back (negative) by this number of time stamps with events; time without events is skipped. Stops playing. */
export interface StepRequest {
  type: "step";
  id?: number;
  frames: number;
}

/** Follow the live source; leaves a recording. */
export interface LiveRequest {
  type: "live";
  id?: number;
}

/** Show a recording of the folder, at its beginning, paused: any file that `taxel.open` reads; of a file with several trials the one that `trial` names, or the first. */
export interface OpenRequest {
  type: "open";
  id?: number;
  name: string;
  trial?: string | null;
}

/** Requests `recordings`. */
export interface RecordingsRequest {
  type: "recordings";
  id?: number;
}

/** Requests `overview` of what this view shows. */
export interface OverviewRequest {
  type: "overview";
  id?: number;
}

/** Write registers, by taxel's names or the manual's, in the registers' own units (as `registers.js` has them); all or none. */
export interface SetRequest {
  type: "set";
  id?: number;
  values: Record<string, boolean | number>;
}

/** Read all registers back from the board. */
export interface ReadRequest {
  type: "read";
  id?: number;
}

/** Write every register again ("change (send all again)"). */
export interface SendAllRequest {
  type: "send_all";
  id?: number;
}

/** Write a preset's registers: a built-in one does not change the version of the wire, one of the user holds every register. */
export interface PresetApplyRequest {
  type: "preset_apply";
  id?: number;
  name: string;
}

/** Save the registers under a new name; a name that exists is refused. */
export interface PresetSaveRequest {
  type: "preset_save";
  id?: number;
  name: string;
}

/** A preset of the user only. */
export interface PresetDeleteRequest {
  type: "preset_delete";
  id?: number;
  name: string;
}

/** Begin: after the countdown (none where left out) record to `NAME.mcap`, or with an `index` of 1 to `NAME1.mcap`, for `length_s`, or else until `stop`. With `advance` the index moves on by itself after each recording, and the next countdown begins until `stop`. `label` is written into the recording as a note without a time: it is about the whole recording, and is not an event. `format` is `mcap` where left out; `lsa` holds raw bytes and no label. */
export interface RecordRequest {
  type: "record";
  id?: number;
  name: string;
  advance?: boolean | null;
  countdown_s?: number | null;
  format?: "mcap" | "lsa" | null;
  index?: number | null;
  label?: string | null;
  length_s?: number | null;
}

/** End the recording, or its countdown; and the advance. */
export interface StopRequest {
  type: "stop";
  id?: number;
}

/** Write a note into the recording that runs, with the time of now. */
export interface NoteRequest {
  type: "note";
  id?: number;
  text: string;
}

/** A label at this time of the recording shown. A live view: at this time of the recording that runs. With `source` it is of this source alone. One of the same name, time, source and trial is not made twice. With `replaces_us` it replaces the recording's own note of that time (and source), which counts no more. Refused outside the recording: of events more than a second before the first or after the last one, of frames more than one frame. */
export interface MarkRequest {
  type: "mark";
  id?: number;
  label: string;
  t_us: number;
  replaces_us?: number | null;
  source?: string | null;
}

/** Several labels, all or none: each entry is a label at one time or more, its keys as of `mark`; `replaces_us` has as many times as `t_us`. At most 5000 labels. */
export interface MarksRequest {
  type: "marks";
  id?: number;
  labels: MarkedTimes[];
}

/** Another name for a label. */
export interface RenameRequest {
  type: "rename";
  id?: number;
  label_id: number;
  label: string;
}

/** Another time, as for `mark`. */
export interface MoveRequest {
  type: "move";
  id?: number;
  label_id: number;
  t_us: number;
}

/** If the label replaces a note, that note no longer counts either, until a `mark` with the same `replaces_us`. */
export interface DeleteRequest {
  type: "delete";
  id?: number;
  label_id: number;
}

/** Take back the last change of labels that this client made in the recording that it shows or that is recorded, whole or not at all; refused where there is none, or where another window or program has changed such a label since. */
export interface UndoRequest {
  type: "undo";
  id?: number;
}

/** Requests `health` of what this view shows. */
export interface HealthRequest {
  type: "health";
  id?: number;
}

/** Train a readout on the labels of the recording shown, as `taxel train --labels notes` does; of a file with several trials, on the trials that have labels. The readout replaces `NAME.readout.json` beside the recording. Answered when the training has ended; `trained` comes before. One training runs at a time. */
export interface TrainRequest {
  type: "train";
  id?: number;
}

/** Requests `training`: how far the training that runs is. */
export interface TrainingRequest {
  type: "training";
  id?: number;
}

/** End the training that runs: it is refused, and writes nothing. */
export interface TrainStopRequest {
  type: "train_stop";
  id?: number;
}

/** Read what this view shows with a readout or a plain rule of the folder. A recording: answered by `detections`. The board: from now on, for all clients; the source begins again, as with `delta_intensity`. A readout that needs a tare uses that of the command, else what the taxels hold now. */
export interface ReadOutRequest {
  type: "read_out";
  id?: number;
  readout: string;
}

/** Write the stretch of the recording shown to a new file of the folder; what `taxel cut` does, so any of its endings. */
export interface CutRequest {
  type: "cut";
  id?: number;
  start_us: number;
  stop_us: number;
  name: string;
}

/** Receive the board's datagrams there instead. Refused while a recording runs. */
export interface ListenRequest {
  type: "listen";
  id?: number;
  host: string;
  port: number;
}

/** Receive another source instead, as `taxel live --source` names it. Time, values and the past that can be viewed begin again. Refused while a recording runs. */
export interface ReadSourceRequest {
  type: "read_source";
  id?: number;
  source: string;
}

/** Requests `source_preview`: what arrives from a source of lines, for two seconds at most. */
export interface PreviewSourceRequest {
  type: "preview_source";
  id?: number;
  source: string;
}

/** Write a source of lines, with all that its text states, to the new layout file NAME.layout.toml of the folder; `layout_saved` follows. An existing file is never overwritten. */
export interface SaveLayoutRequest {
  type: "save_layout";
  id?: number;
  source: string;
  name: string;
}

/** Requests `topics`: those of a ROS bag of the folder. */
export interface TopicsRequest {
  type: "topics";
  id?: number;
  name: string;
}

/** Write what is stated here into the layout file beside a recording of the folder, NAME.layout.toml, as its keys `falls`, `rate_hz`, `rows` and `columns`, and in `[ros]` `topic` and `field`; what it holds already stays. The next `open` reads the recording by it. Refused where options of the command say the same, and for a file that no layout file describes. */
export interface DescribeRequest {
  type: "describe";
  id?: number;
  name: string;
  falls?: boolean | null;
  field?: string | null;
  rate_hz?: number | null;
  /** Rows and columns. */
  size?: [number, number] | null;
  topic?: string | null;
}

/** Whether the board sends differences from the value before, not values. Earlier events were decoded with the other meaning, so the source begins again: time, values, the past that can be viewed, a readout with its tare. Refused while a recording runs. */
export interface DeltaIntensityRequest {
  type: "delta_intensity";
  id?: number;
  on: boolean;
}

/** Requests `places`: where a board can be. */
export interface PlacesRequest {
  type: "places";
  id?: number;
}

/** The board's serial line: a port of this machine, or host:port; `null` disconnects it. */
export interface ControlRequest {
  type: "control";
  id?: number;
  place?: string | null;
}

export type Message =
  | Hello
  | Registers
  | Presets
  | Counters
  | Detection
  | Spikes
  | Zeroed
  | BoardLine
  | Places
  | SourcePreview
  | LayoutSaved
  | Topics
  | Recorder
  | Recordings
  | Trained
  | Training
  | Detections
  | Opened
  | Loading
  | Overview
  | Transport
  | Labels
  | Health
  | Cut
  | Done
  | Refused
  | Warning;

export type Request =
  | CreditRequest
  | WatchRequest
  | RestRequest
  | ZeroRequest
  | EncodeRequest
  | ZoomRequest
  | SeekRequest
  | PlayRequest
  | PauseRequest
  | StepRequest
  | LiveRequest
  | OpenRequest
  | RecordingsRequest
  | OverviewRequest
  | SetRequest
  | ReadRequest
  | SendAllRequest
  | PresetApplyRequest
  | PresetSaveRequest
  | PresetDeleteRequest
  | RecordRequest
  | StopRequest
  | NoteRequest
  | MarkRequest
  | MarksRequest
  | RenameRequest
  | MoveRequest
  | DeleteRequest
  | UndoRequest
  | HealthRequest
  | TrainRequest
  | TrainingRequest
  | TrainStopRequest
  | ReadOutRequest
  | CutRequest
  | ListenRequest
  | ReadSourceRequest
  | PreviewSourceRequest
  | SaveLayoutRequest
  | TopicsRequest
  | DescribeRequest
  | DeltaIntensityRequest
  | PlacesRequest
  | ControlRequest;
