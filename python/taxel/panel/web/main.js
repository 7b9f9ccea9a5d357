// The live panel: one page for a board and for recordings. Creates its parts, passes messages to them, and draws.

import { bindActions } from "./actions.js";
import { Board } from "./board.js";
import { writeCounters } from "./counters.js";
import { Cursor } from "./cursor.js";
import { Detections, recorded } from "./detections.js";
import { make, part, write } from "./dom.js";
import { showKeys } from "./keys.js";
import { Labels } from "./labels.js";
import { Lanes } from "./lanes.js";
import { arrangeForWidth, divide } from "./arrangement.js";
import { Maps } from "./maps.js";
import { Mistakes } from "./mistakes.js";
import { Notes } from "./notes.js";
import { failed, notify, silence } from "./notice.js";
import { Picture } from "./picture.js";
import { Player } from "./player.js";
import { readFrame } from "./protocol.js";
import { Pointed } from "./pointed.js";
import { Recorder } from "./recorder.js";
import { Regions } from "./regions.js";
import { Roles } from "./roles.js";
import { Sensor } from "./sensor.js";
import { RefusedError, Server } from "./server.js";
import { Settings } from "./settings.js";
import { showState } from "./state.js";
import { Strip } from "./strip.js";
import { showTab } from "./tabs.js";
import { Timeline } from "./timeline.js";
import { Training } from "./training.js";
import { View } from "./view.js";
import { TimeWindow } from "./window.js";
import { beginning, begun, numbering, short } from "./words.js";

/** @typedef {import("./messages.js").Message} Message */
/** @typedef {import("./messages.js").Hello} Hello */
/** @typedef {import("./messages.js").Counters} Counters */
/** @typedef {import("./messages.js").Opened} Opened */
/** @typedef {import("./messages.js").ArrayInfo} ArrayInfo */

/** How often text is written, and lanes are drawn, ms. */
const TEXT_MS = 125;
const LANES_MS = 33;
/** How often lanes are drawn for users who prefer reduced motion, ms. */
const REDUCED_MS = 1000;
const OVERVIEW_MS = 2000;
/** The curves of frames have a gap where none came for so long, us, and for so many frames. */
const LEAST_GAP_US = 500_000;
const GAP_FRAMES = 3;

const settings = new Settings();
const fragment = new URLSearchParams(location.hash.slice(1));
const server = new Server(fragment.get("token") ?? "", receive, receiveFrame, showConnection);
const player = new Player(server);
const detections = new Detections((t_us) => player.seek(t_us));
const timeWindow = new TimeWindow(server, player, () => timeline, () => hello?.columns_us ?? null, () => {
  lanesDue = true;
});
const cursor = new Cursor(() => timeline, (t_us) => player.seek(t_us), timeWindow, mark);
const pointed = new Pointed(server, () => timeline);
const maps = new Maps(settings, watch);
const picture = new Picture(server, maps, () => timeline, player, () => (mapsDue = true));
// Their curves are drawn at once, while a border is dragged.
const regions = new Regions(server, maps, () => timeline, () => timeline && lanes.draw(timeline, timeWindow.ticks(timeline), "regions"), showLanes);
const lanes = new Lanes(settings, shown);
const labels = new Labels(server, settings, player, () => timeline, () => showTab("labels"), listRecordings);
const notes = new Notes(player, labels);
const mistakes = new Mistakes(player, () => {
  lanesDue = true;
});
const training = new Training(server, player, mistakes, () => showDetections(detections.shown, detections.labels));
divide(settings);
new ResizeObserver(() => (lanesDue = true)).observe(part("lanes", HTMLElement));
const board = new Board(server);
const sensor = new Sensor(server);
const roles = new Roles(server, (name) => ask(name));
part("roles-button", HTMLButtonElement).onclick = () => opened && roles.open(opened.name);
const view = new View(server, settings, (taxel) => maps.point(taxel));
const recorder = new Recorder(server, () => showTab("record"));
const strip = new Strip(player, () => timeline, () => ({ labels: labels.labels, detections: detections.shown, mistakes: mistakes.shown, notes: notes.withTime, cut: view.cut }));

/** @type {Timeline | null} */
let timeline = null;
/** @type {Hello | null} */
let hello = null;
/** @type {Opened | null} */
let opened = null;
/** @type {Counters | null} */
let counters = null;
/** @type {import("./messages.js").Registers | null} */
let registers = null;
/** Taxels of the board that the user has zeroed. @type {import("./messages.js").Zeroing[]} */
let zeroed = [];
/** The recording that is being opened. @type {string | null} */
let opening = null;
/** Why the last one was not opened. */
let refused = "";
/** Whether the server is connected, and why not. */
let connection = { connected: false, why: "" };
/** @type {import("./messages.js").Recordings | null} */
let recordings = null;
/** What is to be drawn again: the maps; the lanes, with the marks over them. */
let mapsDue = false;
let lanesDue = true;
/** Only the line at the time shown is to be drawn again. */
let timeDue = true;

// ------------------------------------------------------------------------------------------------ connection

/** @param {"open" | "lost"} state @param {string} why */
function showConnection(state, why) {
  connection = { connected: state === "open", why };
  if (state === "open") {
    // The server knows nothing of the view after a new connection.
    if (maps.taxel) watch(maps.taxel);
    timeWindow.forget();
    timeWindow.ask();
  }
  writeState();
}

function writeState() {
  showState(connection, player.transport, hello, opened, recorder.status, counters, opening, refused);
}

/** Shows values and times as the source has them: ticks and seconds, or a unit and the numbers of frames. */
function showUnits() {
  const frames = opened?.frames;
  const live = opened ? null : hello?.frames;
  const { unit, step, zero } = frames ?? live ?? { unit: "ticks", step: 1, zero: 0 };
  maps.values = { unit, step, zero, frames: frames !== null && frames !== undefined, isBoard: opened ? !frames : !hello?.lines };
  maps.name();
  numbering.number_us = frames?.number_us ?? null;
  numbering.begin_us = beginning(opened?.start_us ?? live?.begin_us ?? null);
  write(part("begun", HTMLElement), begun() && `0 s: ${begun()}`);
  const parts = part("parts", HTMLSelectElement);
  const sensors = !opened && hello && hello.sources.length > 1 ? hello.sources : [];
  const names = frames?.trials ?? sensors;
  parts.hidden = !names.length;
  parts.replaceChildren(...names.map((name) => make("option", { value: name }, name)));
  parts.value = (opened ? frames?.trial : hello?.sensor) ?? "";
  showLanes();
}

/** @returns {number | null} how long frames of the live source may be away, us; null of a board, which sends nothing at rest */
function gapOfFrames() {
  const frame_us = counters?.arrival.heartbeat_us ?? null;
  return opened || !hello?.lines || frame_us === null ? null : Math.max(LEAST_GAP_US, GAP_FRAMES * frame_us);
}

/** @returns {import("./lanes.js").Shown} */
function shown() {
  const { geometry: sensor, taxel, values } = maps;
  const newtons = opened?.frames?.newtons ?? null;
  // The sum of the values is a force where they are in N, or where it is known of a pressure.
  const sums = newtons === null ? { unit: values.unit, step: values.step } : { unit: "N", step: newtons };
  return { sensor, taxel, named: maps.named(), values, sums, gap_us: gapOfFrames(), top: timeline?.channelTop() ?? 1, regions };
}

/** Lists the recordings, with the labels as the page knows them. */
function listRecordings() {
  if (recordings) recorder.list(recordings, player.transport.source, (file) => labels.count(file));
}

/** @param {[number, number] | null} taxel */
function watch(taxel) {
  server.send({ type: "watch", taxel });
  timeline?.unwatch();
  showLanes();
}

/** @param {ArrayInfo} array */
function resize(array) {
  if (!timeline || timeline.rows !== array.rows || maps.columns !== array.columns) {
    timeline = new Timeline(array.rows, hello?.column_us ?? 4000);
    timeWindow.forget();
  }
  maps.size(array, opened?.frames?.sources ?? []);
  showLanes();
}

/** @param {ArrayBuffer} buffer */
function receiveFrame(buffer) {
  const frame = readFrame(buffer);
  if (!timeline || frame.rows !== timeline.rows || frame.columns !== maps.columns) {
    resize({ rows: frame.rows, columns: frame.columns, pitch_mm: null, name: "", exists: null });
  }
  if (!timeline) return;
  const followed = timeline.following;
  timeline.put(frame);
  timeWindow.follow(frame);
  if (followed !== frame.following) timeWindow.ask();
  maps.frame = frame;
  player.t_us = frame.t_us;
  if (frame.following && player.transport.state !== "following" && player.transport.source === null) move({ ...player.transport, source: null, state: "following" });
  mapsDue = timeDue = true;
  // The columns of a window that does not follow the newest change only where the server sends all of them, or where the window moves.
  if (frame.following || frame.restart) lanesDue = true;
}

// ------------------------------------------------------------------------------------------------ messages

/** @param {Message} message */
function receive(message) {
  switch (message.type) {
    case "hello":
      return greet(message);
    case "registers":
      registers = message;
      showAssumed();
      return showRegisters();
    case "presets":
      return board.takePresets(message);
    case "counters":
      counters = message;
      if (player.transport.source === null) player.reach = message.reach_us;
      return writeState();
    case "detection":
      // Of several sources the first is read out.
      detections.add({ ...message, source: (hello?.sources.length ?? 0) > 1 ? hello?.sources[0] ?? "" : "" });
      lanesDue = true;
      if (player.transport.source === null) showDetections(detections.live, hello?.readout ?? []);
      return;
    case "recorder":
      recorder.take(message);
      if (player.transport.source === null) labels.choose(recorder.file);
      return writeState();
    case "recordings":
      recordings = message;
      training.list(message);
      return listRecordings();
    case "trained":
      return training.take(message);
    case "training":
      return training.progress(message.text);
    case "detections":
      if (message.source === player.transport.source) {
        training.reads = message.readout;
        showDetections(recorded(message.detections), message.labels);
      }
      return;
    case "opened":
      return open(message);
    case "overview":
      if (message.source === player.transport.source) strip.overview = message;
      return;
    case "transport":
      return move(message);
    case "labels":
      labels.take(message);
      notes.show();
      labels.offer(hello?.readout ?? []);
      return;
    case "health":
      maps.health = message;
      maps.mark();
      return view.takeHealth(message);
    case "zeroed":
      zeroed = message.taxels;
      return showZeroed();
    case "values":
      pointed.take(message);
      return lanes.write(timeline);
    case "ports":
      return sensor.offer(message);
    case "look":
      return roles.take(message);
    case "seen":
      return roles.see(message);
    case "regions":
      return regions.take(message);
    case "picture":
      return picture.take(message);
    case "loads":
      return regions.takeLoads(message);
    case "cut":
      return notify(`wrote ${message.name}${message.lost.length ? `; left out: ${message.lost.join(", ")}` : ""}`);
    case "warning":
      return notify(message.text, true);
    case "refused":
      return notify(message.reason, true);
  }
}

/** Marks the taxels that were zeroed: of the board, or of the recording that is shown. */
function showZeroed() {
  maps.zeroed = opened ? opened.zeroed : zeroed;
  maps.mark();
}

/** @param {Hello} message */
function greet(message) {
  const first = hello === null;
  hello = message;
  player.live = message.live;
  if (message.array && player.transport.source === null) resize(message.array);
  board.greet(message);
  if (!opened) showUnits();
  labels.offer(message.readout ?? []);
  showAssumed();
  showRegisters();
  recorder.able = message.live;
  recorder.write();
  part("record", HTMLButtonElement).hidden = !message.live;
  part("record-start", HTMLButtonElement).disabled = !message.live;
  part("counters", HTMLElement).hidden = part("sensor-open", HTMLElement).hidden = !message.live;
  if (first && !message.live) showTab("labels");
  showDetections(detections.shown, opened ? detections.labels : (message.readout ?? []));
  document.title = message.live ? "taxel · live" : "taxel · view";
  if (maps.taxel) watch(maps.taxel);
  server.send({ type: "recordings" });
  if (message.live) server.send({ type: "overview" });
  const name = fragment.get("open") ?? message.open;
  if (name && (first || !message.live)) ask(name, fragment.get("trial") ?? undefined);
  player.show();
  writeState();
}

/**
 * Another recording is shown, or the live source: a reload of the page shows it again, and messages about the last one go.
 * @param {Opened | null} shown
 */
function turnTo(shown) {
  const kept = { open: shown?.name, trial: shown?.frames?.trial };
  for (const [key, value] of Object.entries(kept)) {
    if (value) fragment.set(key, value);
    else fragment.delete(key);
  }
  history.replaceState(null, "", `#${fragment}`);
  silence();
  maps.forget();
  regions.choose(shown);
  picture.choose(shown?.frames != null);
}

/** Asks for a recording, or for a trial of it; says so while it is read. @param {string} name @param {string} [trial] */
async function ask(name, trial) {
  opening = name;
  refused = "";
  writeState();
  try {
    await server.request({ type: "open", name, ...(trial === undefined ? {} : { trial }) });
  } catch (error) {
    const why = error instanceof Error ? error.message : String(error);
    // Below the first line are layouts to copy, which the dialog of roles has as menus.
    [refused] = (why.includes(name) ? why : `${name}: ${why}`).split("\n");
    // What is open stays open, so that the same file can be chosen again once it is mended.
    if (opening === name) part("files", HTMLSelectElement).value = opened?.name ?? "";
    if (error instanceof RefusedError && error.field === "roles") roles.open(name);
    // Where nothing is shown it stands above the maps.
    else if (player.transport.source !== null || hello?.live) notify(refused, true);
  }
  if (opening === name) opening = null;
  writeState();
}

/** A readout that runs live assumes a frame, where the registers were neither stated nor read. */
function showAssumed() {
  const assumes = hello?.readout && !hello.lines && registers && !registers.known && !registers.stated && !opened;
  write(part("assumed", HTMLElement), assumes ? `The readout assumes frames of ${short(registers?.frame_us ?? 0)}: the registers are not known.` : "");
}

/** Shows the registers of the board, or of the recording that is shown. */
function showRegisters() {
  const values = opened ? opened.registers : (registers?.values ?? null);
  maps.floor = Number(opened?.frames?.floor ?? values?.noise_floor ?? 0);
  if (opened) {
    if (!hello?.live) board.showRecorded(opened.registers, opened.frame_us);
  } else if (registers && hello?.live) board.take(registers);
}

/** @param {Opened} message */
function open(message) {
  part("roles-button", HTMLButtonElement).hidden = !message.has_roles;
  const again = opened?.name === message.name && opened.frames?.trial === message.frames?.trial;
  opened = message;
  player.transport = { ...player.transport, source: message.name, state: "paused" };
  player.reach = message.start_us === null || message.stop_us === null ? null : [message.start_us, message.stop_us];
  player.t_us = message.start_us;
  resize(message.array);
  timeWindow.forget();
  if (!again) cursor.second_us = null;
  if (timeline && !again) {
    timeline.following = false;
    timeWindow.showBeginning(message.touch_us);
    // It opens on something: the first touch.
    if (message.touch_us !== null) player.seek(message.touch_us);
  }
  showSource(again);
  player.show();
  writeState();
}

/** @param {import("./messages.js").Transport} transport */
function move(transport) {
  const changed = transport.source !== player.transport.source;
  player.take(transport);
  if (transport.source === null && (opened || changed)) {
    opened = null;
    timeline = null;
    player.reach = counters?.reach_us ?? null;
    if (hello?.array) resize(hello.array);
    showSource(false);
  }
  writeState();
}

/** Shows the recording that is open, or the live source. @param {boolean} again whether it was shown before */
function showSource(again) {
  const trial = opened?.frames?.trial;
  strip.overview = null;
  showUnits();
  if (!again) turnTo(opened);
  training.choose(opened?.name ?? null, trial);
  maps.health = null;
  showZeroed();
  part("files", HTMLSelectElement).value = opened?.name ?? "";
  labels.choose(opened ? opened.name : recorder.file, trial);
  view.choose(opened?.name ?? null);
  notes.choose(opened?.notes ?? []);
  if (opened) showDetections(recorded(opened.detections), [...new Set(opened.detections.map(({ label }) => label))].sort());
  else showDetections(detections.live, hello?.readout ?? []);
  showRegisters();
  server.send({ type: "overview" });
}

/** @param {import("./detections.js").Detection[]} shown of the live source newest first @param {string[]} labels in the order of their readout */
function showDetections(shown, labels) {
  const chosen = training.readout.value;
  const ofRecording = !chosen
    ? "No detections in this recording: train on labels, or choose a readout."
    : chosen === training.reads ? `${chosen} detected nothing in this recording.` : `No detections yet: ${chosen} is reading this recording.`;
  const none = opened ? ofRecording : hello?.readout ? "None yet." : "No readout is running: start taxel live with a readout, or choose a readout here.";
  detections.show(shown, none, labels);
  lanesDue = true;
}

// ------------------------------------------------------------------------------------------------ drawing

/** Draws what lies over the lanes. */
function mark() {
  cursor.draw();
  detections.mark(timeline);
  mistakes.mark(timeline);
}

const reducedMotion = matchMedia("(prefers-reduced-motion: reduce)");
let lanesAt = 0;
let textAt = 0;
let overviewAt = 0;

/** @param {number} now_ms */
function drawFrame(now_ms) {
  requestAnimationFrame(drawFrame);
  if (mapsDue) {
    mapsDue = false;
    maps.draw(now_ms);
  }
  const moving = player.transport.state !== "paused";
  if ((lanesDue || timeDue) && now_ms - lanesAt >= (reducedMotion.matches && moving ? REDUCED_MS : LANES_MS)) {
    lanesAt = now_ms;
    if (lanesDue) {
      if (timeline) {
        // Grid and numbers are of one picture.
        const ticks = timeWindow.ticks(timeline);
        lanes.draw(timeline, ticks);
        regions.ask();
        picture.ask();
        timeWindow.writeAxis(ticks);
      }
      labels.arrange();
      mark();
    } else cursor.draw();
    lanesDue = timeDue = false;
  }
  if (now_ms - textAt >= TEXT_MS) {
    textAt = now_ms;
    writeText();
  }
  if (connection.connected && player.transport.source === null && hello?.live && now_ms - overviewAt >= OVERVIEW_MS) {
    overviewAt = now_ms;
    server.send({ type: "overview" });
  }
}

function writeText() {
  maps.write();
  if (counters) writeCounters(counters);
  timeWindow.write();
  if (training.since !== null) training.write();
  pointed.ask();
  lanes.write(timeline);
  player.write();
  strip.draw();
  strip.write();
  detections.list();
}

/** Applies the colours of the theme. */
function applyTheme() {
  document.documentElement.dataset.theme = settings.theme;
  maps.colour();
  lanes.renew();
  mapsDue = lanesDue = true;
}

function showLanes() {
  // Of frames there are no events, and of channels no map, only their values.
  const both = !opened?.frames && maps.geometry.kind !== "channels";
  part("change-figure", HTMLElement).hidden = !both;
  part("maps", HTMLElement).style.setProperty("--count", both ? "2" : "1");
  lanes.show();
  lanesDue = true;
}

settings.watch((name) => {
  if (name === "theme") applyTheme();
  mapsDue = true;
});
matchMedia("(prefers-color-scheme: light)").addEventListener("change", applyTheme);

// ------------------------------------------------------------------------------------------------ start

bindActions({ server, player, settings, recorder, labels, mistakes, view, maps, cursor, window: timeWindow }, () => timeline);
part("files", HTMLSelectElement).onchange = ({ target }) => {
  const { value } = /** @type {HTMLSelectElement} */ (target);
  if (value) ask(value);
  else player.follow();
};
part("parts", HTMLSelectElement).onchange = ({ target }) => {
  const { value } = /** @type {HTMLSelectElement} */ (target);
  if (opened) ask(opened.name, value);
  else server.request({ type: "sensor", name: value }).catch(failed);
};

arrangeForWidth();
showKeys();
showTab("board");
labels.show();
view.showCut();
applyTheme();
showLanes();
requestAnimationFrame(drawFrame);
if (fragment.get("token")) server.open();
else {
  connection.why = "the token is missing in the address: copy the whole line that taxel printed";
  writeState();
  failed(new Error(connection.why));
}
