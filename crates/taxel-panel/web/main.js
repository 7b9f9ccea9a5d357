// The live panel: one page for a board and for recordings. Creates its parts, passes messages to them, and draws.

import { bindActions } from "./actions.js";
import { Board } from "./board.js";
import { writeCounters } from "./counters.js";
import { Cursor } from "./cursor.js";
import { Detections } from "./detections.js";
import { make, part, write } from "./dom.js";
import { showKeys } from "./keys.js";
import { Labels } from "./labels.js";
import { Lanes } from "./lanes.js";
import { Maps } from "./maps.js";
import { failed, notify } from "./notice.js";
import { Player } from "./player.js";
import { readPicture } from "./protocol.js";
import { Raster } from "./raster.js";
import { Recorder } from "./recorder.js";
import { Server } from "./server.js";
import { Settings } from "./settings.js";
import { showState } from "./state.js";
import { Strip } from "./strip.js";
import { showTab } from "./tabs.js";
import { Timeline } from "./timeline.js";
import { View } from "./view.js";
import { counted, seconds } from "./words.js";
import { Zoom } from "./zoom.js";

/** @typedef {import("./protocol.js").Message} Message */
/** @typedef {import("./protocol.js").Hello} Hello */
/** @typedef {import("./protocol.js").Counters} Counters */
/** @typedef {import("./protocol.js").Opened} Opened */
/** @typedef {import("./protocol.js").ArrayInfo} ArrayInfo */

/** How often text is written, and lanes are drawn, ms. */
const TEXT_MS = 125;
const LANES_MS = 33;
/** How often lanes are drawn for users who prefer reduced motion, ms. */
const REDUCED_MS = 1000;
const OVERVIEW_MS = 2000;

const settings = new Settings();
const fragment = new URLSearchParams(location.hash.slice(1));
const server = new Server(fragment.get("token") ?? "", receive, receivePicture, showConnection);
const player = new Player(server, failed);
const detections = new Detections((t_us) => player.seek(t_us));
const zoom = new Zoom(server, player, () => timeline, () => hello?.columns_us ?? null);
const cursor = new Cursor(() => timeline, (t_us) => player.seek(t_us), (by) => zoom.by(by), mark);
const maps = new Maps(settings, watch);
const raster = new Raster(part("raster", HTMLCanvasElement));
const lanes = new Lanes();
const labels = new Labels(server, settings, player, () => timeline, failed, () => showTab("labels"));
const board = new Board(server, settings, failed);
const view = new View(server, settings, failed, (taxel) => maps.point(taxel));
const recorder = new Recorder(server, failed, () => showTab("record"));
const strip = new Strip(player, () => timeline, () => ({ labels: labels.labels, detections: detections.shown, notes: timed(opened?.notes ?? []), cut: view.cut }));

/** @type {Timeline | null} */
let timeline = null;
/** @type {Hello | null} */
let hello = null;
/** @type {Opened | null} */
let opened = null;
/** @type {Counters | null} */
let counters = null;
/** @type {import("./protocol.js").RegistersMessage | null} */
let registers = null;
/** Taxels of the board that the user has zeroed. @type {import("./protocol.js").Zeroing[]} */
let zeroed = [];
/** Whether the server is connected, and why not. */
let connection = { connected: false, why: "" };
/** The lanes begin anew with the next picture: another source, or a new connection. */
let restarts = true;
/** What is to be drawn again: the maps, the lanes, the marks over the lanes. */
let mapsDue = false;
let lanesDue = true;
let marksDue = true;
/** Pictures drawn in the last second. */
let drawn = 0;

// ------------------------------------------------------------------------------------------------ connection

/** @param {"open" | "lost"} state @param {string} why */
function showConnection(state, why) {
  connection = { connected: state === "open", why };
  restarts = true;
  if (state === "open") {
    // The server knows nothing of the view after a new connection.
    if (maps.taxel) watch(maps.taxel);
    view.encode();
    if (timeline && timeline.column_us !== (hello?.column_us ?? timeline.column_us)) server.send({ type: "zoom", column_us: timeline.column_us });
  }
  writeState();
}

function writeState() {
  showState(connection, player.transport, hello, opened, recorder.status);
}

/** @param {[number, number] | null} taxel */
function watch(taxel) {
  server.send({ type: "watch", taxel });
  timeline?.unwatch();
  lanesDue = true;
}

/** @param {ArrayInfo} array */
function resize(array) {
  if (!timeline || timeline.rows !== array.rows || maps.columns !== array.columns) {
    timeline = new Timeline(array.rows, hello?.column_us ?? 4000);
    restarts = true;
  }
  maps.size(array.rows, array.columns, array.exists);
  lanes.size(array.rows, array.columns);
  write(part("raster-rows", HTMLElement), String(array.rows - 1));
}

/** @param {ArrayBuffer} buffer */
function receivePicture(buffer) {
  const picture = readPicture(buffer);
  if (!timeline || picture.rows !== timeline.rows || picture.columns !== maps.columns) {
    resize({ rows: picture.rows, columns: picture.columns, pitch_mm: null, name: "", exists: null });
  }
  if (!timeline) return;
  const ends = zoom.endsAt(picture);
  // A restart of a view that follows is a board that began anew; any other follows a seek of this page, and the window stays.
  timeline.put(picture, restarts || (picture.restart && picture.following), ends);
  if (ends) zoom.awaited?.arrived();
  restarts = false;
  zoom.show(picture.column_us);
  maps.take(picture);
  player.t_us = picture.t_us;
  if (picture.following && player.transport.state !== "following" && player.transport.source === null) move({ ...player.transport, source: null, state: "following" });
  mapsDue = lanesDue = marksDue = true;
}

// ------------------------------------------------------------------------------------------------ messages

/** @param {Message} message */
function receive(message) {
  switch (message.type) {
    case "hello":
      return greet(message);
    case "registers":
      registers = message;
      return showRegisters();
    case "presets":
      return board.takePresets(message);
    case "counters":
      counters = message;
      if (player.transport.source === null) player.reach = message.reach_us;
      return;
    case "detection":
      detections.add(message);
      marksDue = true;
      if (player.transport.source === null) showDetections(detections.live);
      return;
    case "spikes":
      return write(part("spikes-info", HTMLElement), spikesInfo(message));
    case "recorder":
      recorder.take(message);
      if (player.transport.source === null) labels.choose(message.state === "recording" || message.state === "finishing" ? message.file : null);
      return writeState();
    case "recordings":
      return recorder.list(message, player.transport.source);
    case "opened":
      return open(message);
    case "overview":
      if (message.source === player.transport.source) strip.overview = message;
      return;
    case "transport":
      return move(message);
    case "labels":
      labels.take(message);
      labels.offer(hello?.readout ?? []);
      return;
    case "health":
      maps.health = message;
      maps.mark();
      return view.takeHealth(message);
    case "zeroed":
      zeroed = message.taxels;
      return showZeroed();
    case "board_line":
      return board.connection.log(message.text);
    case "places":
      return board.connection.offer(message);
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

/** @param {import("./protocol.js").Spikes} spikes @returns {string} */
function spikesInfo({ encoder, latency_ms, left_out }) {
  return `${encoder.replaceAll("_", " ")}, latency ${latency_ms.toFixed(1)} ms${left_out ? `, ${counted(left_out, "spike")} not shown` : ""}`;
}

/** @param {Hello} message */
function greet(message) {
  const first = hello === null;
  hello = message;
  player.live = message.live;
  if (message.array && player.transport.source === null) resize(message.array);
  board.greet(message);
  view.greet(message);
  labels.offer(message.readout ?? []);
  recorder.able = message.live;
  for (const id of ["record", "record-start"]) part(id, HTMLButtonElement).disabled = !message.live;
  part("live-counters", HTMLElement).hidden = !message.live;
  showDetections(detections.shown);
  document.title = message.live ? "taxel · live" : "taxel · view";
  if (maps.taxel) watch(maps.taxel);
  else if (message.array) maps.point([message.array.columns >> 1, message.array.rows >> 1]);
  server.send({ type: "recordings" });
  if (message.live) server.send({ type: "overview" });
  const asked = fragment.get("open") ?? message.open;
  if (asked && (first || !message.live)) server.request({ type: "open", name: asked }).catch(failed);
  player.show();
  writeState();
}

/** Shows the registers of the board, or of the recording that is shown. */
function showRegisters() {
  const values = opened ? opened.registers : (registers?.values ?? null);
  maps.floor = Number(values?.noise_floor ?? 0);
  if (opened) {
    if (!hello?.live) board.show(opened.registers ?? {}, opened.frame_us, null, true);
  } else if (registers && hello?.live) board.take(registers);
}

/** @param {Opened} message */
function open(message) {
  opened = message;
  restarts = true;
  player.transport = { ...player.transport, source: message.name, state: "paused" };
  player.reach = message.start_us === null || message.stop_us === null ? null : [message.start_us, message.stop_us];
  player.t_us = message.start_us;
  strip.overview = null;
  resize(message.array);
  if (!maps.taxel) maps.point([message.array.columns >> 1, message.array.rows >> 1]);
  board.array = message.array;
  maps.health = null;
  showZeroed();
  part("files", HTMLSelectElement).value = message.name;
  labels.choose(message.name);
  view.choose(message.name);
  showDetections(message.detections.map(({ label, t_us }) => ({ label, t_us, latency_us: null })).reverse());
  part("notes-block", HTMLElement).hidden = !message.notes.length;
  part("note-list", HTMLElement).replaceChildren(
    ...message.notes.map(({ t_us, text }) => {
      // A note without a time is about the whole recording.
      if (t_us === null) return make("li", {}, text);
      const button = make("button", { type: "button", class: "link" }, `${seconds(t_us)}  ${text}`);
      button.onclick = () => player.seek(t_us);
      return make("li", {}, button);
    }),
  );
  server.send({ type: "overview" });
  showRegisters();
  player.show();
  writeState();
}

/**
 * The notes that have a time.
 *
 * @param {import("./protocol.js").Opened["notes"]} notes
 */
function timed(notes) {
  return notes.flatMap(({ t_us }) => (t_us === null ? [] : [{ t_us }]));
}

/** @param {import("./protocol.js").Transport} transport */
function move(transport) {
  const changed = transport.source !== player.transport.source;
  player.take(transport);
  if (transport.source === null && (opened || changed)) {
    opened = null;
    restarts = true;
    strip.overview = null;
    if (hello?.array) resize(hello.array);
    maps.health = null;
    showZeroed();
    part("files", HTMLSelectElement).value = "";
    part("notes-block", HTMLElement).hidden = true;
    player.reach = counters?.reach_us ?? null;
    labels.choose(recorder.status?.state === "recording" ? recorder.status.file : null);
    view.choose(null);
    showDetections(detections.live);
    showRegisters();
    server.send({ type: "overview" });
  }
  writeState();
}

/** @param {import("./detections.js").Detection[]} shown newest first */
function showDetections(shown) {
  detections.show(shown, opened ? "None in this recording." : hello?.readout ? "None yet." : "No readout runs: start taxel live with one to see its detections.");
}

// ------------------------------------------------------------------------------------------------ drawing

/** Draws what lies over the lanes. */
function mark() {
  cursor.draw();
  detections.mark(timeline);
}

const reducedMotion = matchMedia("(prefers-reduced-motion: reduce)");
let lanesAt = 0;
let textAt = 0;
let overviewAt = 0;
let drawnAt = 0;
let frames = 0;

/** @param {number} now_ms */
function frame(now_ms) {
  requestAnimationFrame(frame);
  if (mapsDue) {
    mapsDue = false;
    frames++;
    maps.draw(now_ms);
  }
  if (now_ms - drawnAt >= 1000) {
    drawn = Math.round((frames * 1000) / (now_ms - drawnAt));
    [drawnAt, frames] = [now_ms, 0];
  }
  const moving = player.transport.state !== "paused";
  if (timeline && lanesDue && now_ms - lanesAt >= (reducedMotion.matches && moving ? REDUCED_MS : LANES_MS)) {
    lanesDue = false;
    lanesAt = now_ms;
    drawLanes(timeline);
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

/** @param {Timeline} shown */
function drawLanes(shown) {
  const { values } = settings;
  if (values.showRaster) raster.draw(shown, values.raster === "spikes" ? "spikes" : "changes");
  lanes.draw(shown);
  labels.place();
  mark();
}

function writeText() {
  maps.write();
  writeCounters(counters, registers?.known === false, drawn);
  cursor.write();
  player.write();
  strip.draw();
  strip.write();
  detections.list();
  if (marksDue) {
    marksDue = false;
    mark();
  }
}

/** Applies the colours of the theme. */
function applyTheme() {
  document.documentElement.dataset.theme = settings.theme;
  maps.colour();
  raster.colour();
  lanes.make();
  mapsDue = lanesDue = true;
}

function showLanes() {
  const { values } = settings;
  for (const [id, shown] of Object.entries({ raster: values.showRaster, taxel: values.showTaxel, force: values.showForce, centre: values.showCentre })) {
    part(`${id}-block`, HTMLElement).hidden = !shown;
  }
  part("raster-changes", HTMLElement).hidden = values.raster === "spikes";
  part("raster-spikes", HTMLElement).hidden = values.raster !== "spikes";
  lanes.fit();
  lanesDue = true;
}

settings.watch((name) => {
  if (name === "theme") applyTheme();
  if (name === "map" || name === "gamma") maps.colour();
  if (name === "flipX" || name === "flipY") maps.mark();
  if (name === "tones") recorder.tones.on = settings.values.tones;
  if (name.startsWith("show") || name === "raster") showLanes();
  mapsDue = true;
});
matchMedia("(prefers-color-scheme: light)").addEventListener("change", applyTheme);

// ------------------------------------------------------------------------------------------------ start

bindActions({ server, player, settings, recorder, labels, view, maps, zoom }, () => timeline);
part("files", HTMLSelectElement).onchange = ({ target }) => {
  const { value } = /** @type {HTMLSelectElement} */ (target);
  if (value) server.request({ type: "open", name: value }).catch(failed);
  else player.follow();
};

// A narrow page has the choice of recordings above the maps, so that its footer stays low.
const narrow = matchMedia("(max-width: 860px)");
const arrange = () => {
  if (narrow.matches) part("opening", HTMLElement).append(part("files", HTMLElement), part("speed", HTMLElement));
  else {
    part("record", HTMLElement).after(part("files", HTMLElement));
    part("step-on", HTMLElement).after(part("speed", HTMLElement));
  }
};
narrow.addEventListener("change", arrange);
arrange();

recorder.tones.on = settings.values.tones;
showKeys();
showTab("board");
labels.show();
view.showCut();
showLanes();
applyTheme();
requestAnimationFrame(frame);
if (fragment.get("token")) server.open();
else {
  connection.why = "the address lacks its token: copy the whole line that taxel printed";
  writeState();
  failed(new Error(connection.why));
}
