// The live panel: one page for a board and for recordings. Puts the parts together and draws once a frame of the screen.

import { Board } from "./board.js";
import { make, part, write } from "./dom.js";
import { savePicture } from "./image.js";
import { hearKeys, showKeys } from "./keys.js";
import { Labels } from "./labels.js";
import { Lanes } from "./lanes.js";
import { Maps } from "./maps.js";
import { Player } from "./player.js";
import { readPicture } from "./protocol.js";
import { Raster } from "./raster.js";
import { Recorder } from "./recorder.js";
import { Server } from "./server.js";
import { Settings } from "./settings.js";
import { Strip } from "./strip.js";
import { SPAN, Timeline } from "./timeline.js";
import { View } from "./view.js";
import { counted, seconds, short, whole } from "./words.js";

/** @typedef {import("./protocol.js").Message} Message */
/** @typedef {import("./protocol.js").Hello} Hello */
/** @typedef {import("./protocol.js").Counters} Counters */
/** @typedef {import("./protocol.js").Opened} Opened */
/** @typedef {import("./protocol.js").ArrayTold} ArrayTold */
/** @typedef {{ label: string, t_us: number, latency_us: number | null }} Heard */

/** How often text is written, and lanes are drawn, ms. */
const TEXT_MS = 125;
const LANES_MS = 33;
/** Where a person wants less motion, lanes go on in steps. */
const CALM_MS = 1000;
const OVERVIEW_MS = 2000;
/** Detections that the list keeps. */
const KEPT = 300;
const SAID_MS = 8000;

const TABS = /** @type {const} */ (["board", "record", "labels", "view"]);
/** @typedef {(typeof TABS)[number]} Tab */

const settings = new Settings();
const fragment = new URLSearchParams(location.hash.slice(1));
const server = new Server(fragment.get("token") ?? "", hear, takePicture, connection);
const player = new Player(server, failed);
const maps = new Maps(settings, watch);
const raster = new Raster(part("raster", HTMLCanvasElement));
const lanes = new Lanes();
const labels = new Labels(server, settings, player, () => timeline, failed, () => showTab("labels"));
const board = new Board(server, settings, failed);
const view = new View(server, settings, failed, (taxel) => maps.point(taxel));
const recorder = new Recorder(server, failed, () => showTab("record"));
const strip = new Strip(player, () => timeline, () => ({ labels: labels.labels, detections, notes: timed(opened?.notes ?? []), cut: view.cut }));

/** @type {Timeline | null} */
let timeline = null;
/** @type {Hello | null} */
let hello = null;
/** @type {Opened | null} */
let opened = null;
/** @type {Counters | null} */
let counters = null;
/** @type {import("./protocol.js").RegistersTold | null} */
let registers = null;
/** Taxels of the board that a person zeroed. @type {import("./protocol.js").Zeroing[]} */
let zeroed = [];
/** @type {Heard[]} */
let detections = [];
/** @type {Heard[]} kept while a recording is looked at */
let liveDetections = [];
let connected = false;
let why = "";
/** Another source, or a server that began anew: what the lanes hold is of no more use. */
let anew = true;
let fresh = false;
let lanesDue = true;
let labelsDue = true;
let drawn = 0;
let listed = 0;

/** @param {unknown} error told to the person who asked */
function failed(error) {
  say(error instanceof Error ? error.message : String(error), true);
}

/** @type {number | undefined} */
let saying;

/** @param {string} text @param {boolean} [bad] */
function say(text, bad = false) {
  const place = part("said", HTMLElement);
  place.hidden = false;
  place.classList.toggle("bad", bad);
  write(part("said-text", HTMLElement), text);
  clearTimeout(saying);
  saying = setTimeout(() => {
    place.hidden = true;
    write(part("said-text", HTMLElement), "");
  }, SAID_MS);
}

/** @param {"open" | "lost"} state @param {string} reason */
function connection(state, reason) {
  connected = state === "open";
  why = reason;
  anew = true;
  // A server that was away knows nothing of this view.
  if (connected && maps.taxel) watch(maps.taxel);
  if (connected) view.encode();
  if (connected && timeline && timeline.column_us !== (hello?.column_us ?? timeline.column_us)) server.say({ type: "zoom", column_us: timeline.column_us });
  showState();
}

/** @param {[number, number] | null} taxel */
function watch(taxel) {
  server.say({ type: "watch", taxel });
  timeline?.unwatch();
  lanesDue = true;
}

/** @param {ArrayTold} array */
function size(array) {
  if (!timeline || timeline.rows !== array.rows || maps.columns !== array.columns) {
    timeline = new Timeline(array.rows, hello?.column_us ?? 4000);
    anew = true;
  }
  maps.size(array.rows, array.columns, array.exists);
  lanes.size(array.rows, array.columns);
  write(part("raster-rows", HTMLElement), String(array.rows - 1));
}

/** Of which columns the axis is written. */
let axisOf = 0;

/** @param {number} column_us */
function showAxis(column_us) {
  axisOf = column_us;
  const span_us = SPAN * column_us;
  const places = part("axis", HTMLElement).children;
  [...places].forEach((place, i) => write(place, i + 1 < places.length ? `−${short((span_us * (places.length - 1 - i)) / (places.length - 1))}` : "0"));
  write(part("span", HTMLElement), short(span_us));
  const [least, most] = hello?.columns_us ?? [column_us, column_us];
  part("zoom-in", HTMLButtonElement).disabled = column_us <= least;
  part("zoom-out", HTMLButtonElement).disabled = column_us >= most;
}

/** When the last zoom is done: the next reckons with the window that it leaves. */
let zoomed = Promise.resolve();

/**
 * Shows half or twice the stretch of time, after those asked for before; where the view holds, the time at the cursor
 * stays where it is.
 * @param {1 | -1} by 1: half, -1: twice
 */
function zoom(by) {
  zoomed = zoomed.then(() => zoomOnce(by));
  return zoomed;
}

/** @param {1 | -1} by */
async function zoomOnce(by) {
  const [least, most] = hello?.columns_us ?? [0, 0];
  if (!timeline) return;
  const column_us = by > 0 ? timeline.column_us / 2 : timeline.column_us * 2;
  if (column_us < least || column_us > most) return;
  const held = player.transport.state === "paused";
  const { t_us, end_us } = timeline;
  const cursor = timeline.cursor_us ?? t_us;
  await server.ask({ type: "zoom", column_us }).catch(failed);
  if (!held || t_us === null || end_us === null || cursor === null) return;
  const end = cursor + (end_us - cursor) * (by > 0 ? 0.5 : 2);
  // The window first, by a picture at its end, then the time in it; the server leaves out pictures that are overtaken.
  player.seek(end);
  await ended(player.goal ?? end);
  player.seek(t_us <= end && t_us > end - SPAN * column_us ? t_us : cursor);
  await player.settled();
}

/** Of a picture at which the window is to end, us, and what waits for it. @type {{ t_us: number, come: () => void } | null} */
let ending = null;

/**
 * @param {number} t_us
 * @returns {Promise<void>} fulfilled when the picture of that time has come and ends the window, or none has for 5 s
 */
function ended(t_us) {
  return new Promise((resolve) => {
    const asked = { t_us, come: () => {
      if (ending === asked) ending = null;
      resolve();
    } };
    ending = asked;
    setTimeout(asked.come, 5000);
  });
}

/** @param {ArrayBuffer} buffer */
function takePicture(buffer) {
  const picture = readPicture(buffer);
  if (!timeline || picture.rows !== timeline.rows || picture.columns !== maps.columns) {
    size({ rows: picture.rows, columns: picture.columns, pitch_mm: 0, name: "", exists: null });
  }
  if (!timeline) return;
  const ends = ending !== null && picture.t_us !== null && Math.abs(picture.t_us - ending.t_us) <= picture.column_us;
  // A restart of a view that follows is a board that began anew; any other comes of our own seek, and the window stays.
  timeline.put(picture, anew || (picture.restart && picture.following), ends);
  if (ends) ending?.come();
  anew = false;
  if (picture.column_us !== axisOf) showAxis(picture.column_us);
  maps.take(picture);
  player.t_us = picture.t_us;
  if (picture.following && player.transport.state !== "following" && player.transport.source === null) move({ ...player.transport, source: null, state: "following" });
  fresh = true;
  lanesDue = true;
  labelsDue = true;
}

/** @param {Message} message */
function hear(message) {
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
      liveDetections.unshift(message);
      liveDetections.length = Math.min(liveDetections.length, KEPT);
      labelsDue = true;
      if (player.transport.source === null) showDetections(liveDetections);
      return;
    case "spikes":
      return write(part("spikes-said", HTMLElement), spikesSaid(message));
    case "recorder":
      recorder.take(message);
      if (player.transport.source === null) labels.choose(message.state === "recording" || message.state === "finishing" ? message.file : null);
      return showState();
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
      return board.connection.hear(message.text);
    case "places":
      return board.connection.offer(message);
    case "cut":
      return say(`wrote ${message.name}${message.lost.length ? `; left out: ${message.lost.join(", ")}` : ""}`);
    case "warning":
      return say(message.text, true);
    case "refused":
      return say(message.reason, true);
  }
}

/** Marks the taxels that were zeroed: of the board, or of the recording that is looked at. */
function showZeroed() {
  maps.zeroed = opened ? opened.zeroed : zeroed;
  maps.mark();
}

/** Takes what the taxel under the crosshair holds for its rest, for the readout too. */
function zero() {
  const { taxel } = maps;
  if (!taxel) return say("point at a taxel first: click a map, or use its arrow keys", true);
  server.ask({ type: "zero", taxels: [taxel] }).then(() => say(`zeroed row ${taxel[1]}, column ${taxel[0]}`), failed);
}

/** @param {import("./protocol.js").Spikes} spikes @returns {string} */
function spikesSaid({ encoder, latency_ms, left_out }) {
  return `${encoder.replaceAll("_", " ")}, latency ${latency_ms.toFixed(1)} ms${left_out ? `, ${counted(left_out, "spike")} not shown` : ""}`;
}

/** @param {Hello} told */
function greet(told) {
  const first = hello === null;
  hello = told;
  player.live = told.live;
  if (told.array && player.transport.source === null) size(told.array);
  board.greet(told);
  view.greet(told);
  labels.offer(told.readout ?? []);
  recorder.able = told.live;
  for (const id of ["record", "record-start"]) part(id, HTMLButtonElement).disabled = !told.live;
  part("live-counters", HTMLElement).hidden = !told.live;
  showDetections(detections);
  document.title = told.live ? "taxel · live" : "taxel · view";
  if (maps.taxel) watch(maps.taxel);
  else if (told.array) maps.point([told.array.columns >> 1, told.array.rows >> 1]);
  server.say({ type: "recordings" });
  if (told.live) server.say({ type: "overview" });
  const asked = fragment.get("open") ?? told.open;
  if (asked && (first || !told.live)) server.ask({ type: "open", name: asked }).catch(failed);
  player.show();
  showState();
}

/** Shows the registers of what is looked at: of the board now, or of the recording then. */
function showRegisters() {
  const values = opened ? opened.registers : (registers?.values ?? null);
  maps.floor = Number(values?.noise_floor ?? 0);
  if (opened) {
    if (!hello?.live) board.show(opened.registers ?? {}, frameOf(opened.registers), null, true);
  } else if (registers && hello?.live) board.take(registers);
}

/** @param {Record<string, number | boolean> | null} values @returns {number | null} us of a frame: lines x line period */
function frameOf(values) {
  return values && values.lines && values.line_period ? (Number(values.lines) * Number(values.line_period)) / 100 : null;
}

/** @param {Opened} told */
function open(told) {
  opened = told;
  anew = true;
  player.transport = { ...player.transport, source: told.name, state: "paused" };
  player.reach = told.start_us === null || told.stop_us === null ? null : [told.start_us, told.stop_us];
  player.t_us = told.start_us;
  strip.overview = null;
  size(told.array);
  if (!maps.taxel) maps.point([told.array.columns >> 1, told.array.rows >> 1]);
  board.array = told.array;
  maps.health = null;
  showZeroed();
  part("files", HTMLSelectElement).value = told.name;
  labels.choose(told.name);
  view.choose(told.name);
  showDetections(told.detections.map(({ label, t_us }) => ({ label, t_us, latency_us: null })).reverse());
  part("notes-block", HTMLElement).hidden = !told.notes.length;
  part("note-list", HTMLElement).replaceChildren(
    ...told.notes.map(({ t_us, text }) => {
      // A note without a time is about the whole recording.
      if (t_us === null) return make("li", {}, text);
      const button = make("button", { type: "button", class: "link" }, `${seconds(t_us)}  ${text}`);
      button.onclick = () => player.seek(t_us);
      return make("li", {}, button);
    }),
  );
  server.say({ type: "overview" });
  showRegisters();
  player.show();
  showState();
}

/**
 * The notes that stand somewhere on the time line.
 *
 * @param {import("./protocol.js").Opened["notes"]} notes
 */
function timed(notes) {
  return notes.flatMap(({ t_us }) => (t_us === null ? [] : [{ t_us }]));
}

/** @param {import("./protocol.js").Transport} told */
function move(told) {
  const changed = told.source !== player.transport.source;
  player.take(told);
  if (told.source === null && (opened || changed)) {
    opened = null;
    anew = true;
    strip.overview = null;
    if (hello?.array) size(hello.array);
    maps.health = null;
    showZeroed();
    part("files", HTMLSelectElement).value = "";
    part("notes-block", HTMLElement).hidden = true;
    player.reach = counters?.reach_us ?? null;
    labels.choose(recorder.told?.state === "recording" ? recorder.told.file : null);
    view.choose(null);
    showDetections(liveDetections);
    showRegisters();
    server.say({ type: "overview" });
  }
  showState();
}

/** @param {Heard[]} heard newest first */
function showDetections(heard) {
  detections = heard;
  write(part("detection-count", HTMLElement), heard.length ? whole(heard.length) : "");
  const none = part("detections-none", HTMLElement);
  none.hidden = heard.length > 0;
  write(none, opened ? "None in this recording." : hello?.readout ? "None yet." : "No readout runs: give taxel live one to see what it says.");
  listed = -1;
}

/** The names in the order in which they were first heard: each has a shape and a colour. */
/** @type {string[]} */
const shapes = [];

/** @param {string} label @returns {string} */
function shape(label) {
  if (!shapes.includes(label)) shapes.push(label);
  return `shape shape-${shapes.indexOf(label) % 4}`;
}

function listDetections() {
  if (listed === detections.length && listed < KEPT) return;
  listed = detections.length;
  const rows = detections.slice(0, 100).map(({ label, t_us, latency_us }) => {
    const button = make(
      "button",
      { type: "button", class: "link row", "aria-label": `${label} at ${seconds(t_us)}${latency_us === null ? "" : `, said ${short(latency_us)} later`}` },
      make("span", { class: shape(label) }),
      make("span", { class: "what" }, label),
      make("span", { class: "when" }, seconds(t_us)),
      make("span", { class: "late" }, latency_us === null ? "" : short(latency_us)),
    );
    button.onclick = () => player.seek(t_us);
    return make("li", {}, button);
  });
  part("detection-list", HTMLElement).replaceChildren(...rows);
}

/** Says in one word what is shown, and in one line whose. */
function showState() {
  const pill = part("state", HTMLElement);
  const { source, state } = player.transport;
  const recording = recorder.told?.state === "recording" ? recorder.told : null;
  const [kind, word] = !connected
    ? ["lost", why ? "No connection" : "Connecting"]
    : source !== null || !hello?.live
      ? ["replay", source === null ? "No recording" : "Replay"]
      : state === "following"
        ? ["live", "Live"]
        : ["held", state === "playing" ? "Earlier" : "Held"];
  part("zero", HTMLButtonElement).hidden = kind !== "live";
  pill.dataset.kind = recording && kind !== "lost" ? "rec" : kind;
  write(part("state-word", HTMLElement), recording && kind !== "lost" ? `${word === "Live" ? "" : `${word}, `}Recording ${recording.file ?? ""}` : word);
  const array = opened?.array ?? hello?.array;
  const shapeOf = array ? `${array.rows} × ${array.columns}` : "";
  const place = !connected ? why : source !== null ? `${source} · ${opened?.verdict ?? ""}` : hello?.live ? `${hello.udp ?? ""}` : "Open a recording below";
  write(part("source", HTMLElement), [place, shapeOf].filter(Boolean).join(" · "));
  part("source", HTMLElement).title = part("source", HTMLElement).textContent ?? "";
  document.documentElement.classList.toggle("recording", recording !== null);
}

/** Numbers that change all the time. */
function writeCounters() {
  const number = (/** @type {number | null | undefined} */ value, /** @type {(value: number) => string} */ how) => (value === null || value === undefined ? "–" : how(value));
  const put = (/** @type {string} */ id, /** @type {string} */ text) => write(part(id, HTMLElement), text);
  put("drawn", String(drawn));
  if (!counters) return;
  const { lost, latency } = counters;
  put("events", number(counters.events_per_s, whole));
  put("data", number(counters.bytes_per_s, (bytes) => (bytes / 1e6).toFixed(2)));
  // By the registers: where nobody has read them, they are a preset's, and the board may be another one.
  const assumed = registers?.known === false;
  put("frames", number(counters.frames_per_s, whole) + (assumed ? "?" : ""));
  part("frames", HTMLElement).title = assumed ? "assumed: nobody has read the board's registers yet" : "";
  // What only this page's curves lack is in every recording, and nothing that a detection needs.
  const all = Object.entries(lost).reduce((sum, [place, count]) => sum + (place === "panel" ? 0 : count), 0);
  put("lost", whole(all));
  part("lost-block", HTMLElement).classList.toggle("bad", all > 0);
  put("queue", number(counters.queue, whole));
  // What a detection waits for, where there are any; else what decoding takes.
  const way = latency.said?.count ? latency.said : latency.decode;
  put("latency", way && way.p50_us !== null && way.p99_us !== null ? `${whole(way.p50_us)} / ${whole(way.p99_us)}` : "–");
  const places = part("loss-list", HTMLElement);
  for (const [place, count] of Object.entries(lost)) {
    let row = places.querySelector(`[data-place="${CSS.escape(place)}"]`);
    if (!row) {
      row = make("tr", { "data-place": place }, make("th", { scope: "row", title: LOSSES[place] ?? "" }, place), make("td"));
      places.append(row);
    }
    write(/** @type {Element} */ (row.lastElementChild), whole(count));
  }
  put("reach", counters.reach_us ? `${((counters.reach_us[1] - counters.reach_us[0]) / 1e6).toFixed(0)} s can be looked back at` : "");
  put("wire", counters.wire_version ? `wire version ${counters.wire_version}` : "");
}

/** @type {Record<string, string>} where something can be lost */
const LOSSES = {
  kernel: "messages that the socket's buffer had no room for",
  queue: "datagrams that found no room before the decoder",
  wire: "datagrams that never came whole",
  damaged: "bytes that were no words",
  outside: "taxels outside the array",
  readout: "events that found no room before the readout",
  panel: "events that only this panel's curves and look back lack",
};

/** Values at the cursor, or of the picture. */
function writeLanes() {
  const place = timeline?.pointed ?? -1;
  const cursor = timeline?.cursor_us ?? null;
  write(part("cursor-time", HTMLElement), cursor === null ? "" : seconds(cursor));
  if (!timeline || place < 0) {
    for (const id of ["taxel-now", "force-sum", "force-area", "centre-now"]) write(part(id, HTMLElement), "");
    return;
  }
  const [least, greatest, last] = timeline.history.subarray(3 * place, 3 * place + 3);
  write(part("taxel-now", HTMLElement), last === 65535 ? "" : least === greatest ? `${last} ticks` : `${last} ticks (${least} to ${greatest})`);
  write(part("force-sum", HTMLElement), `${whole(timeline.sum[place])} ticks`);
  write(part("force-area", HTMLElement), counted(timeline.area[place], "taxel"));
  const [x, y] = [timeline.x[place], timeline.y[place]];
  const centre = Number.isNaN(x) ? "nothing pressed" : `column ${x.toFixed(1)}, row ${y.toFixed(1)}`;
  write(part("centre-now", HTMLElement), centre);
  const force = `${whole(timeline.sum[place])} ticks over ${counted(timeline.area[place], "taxel")}`;
  write(part("picture-said", HTMLElement), `${force}, centre: ${centre}`);
}

/** Puts cursor, picture's time and detections where they belong over the lanes. */
function placeMarks() {
  const place = (/** @type {HTMLElement} */ line, /** @type {number | null} */ t_us) => {
    const share = t_us === null ? null : (timeline?.share(t_us) ?? null);
    line.hidden = share === null;
    if (share !== null) line.style.left = `${(100 * share).toFixed(3)}%`;
  };
  place(part("cursor-line", HTMLElement), timeline?.cursor_us ?? null);
  const t_us = timeline?.t_us ?? null;
  const atEdge = t_us !== null && timeline?.end_us !== null && (timeline?.end_us ?? 0) - t_us < 2 * (timeline?.column_us ?? 0);
  place(part("time-line", HTMLElement), atEdge ? null : t_us);
  const marks = part("detection-marks", HTMLElement);
  const inside = detections.filter((heard) => timeline?.share(heard.t_us) !== null).slice(0, 200);
  while (marks.children.length > inside.length) marks.lastElementChild?.remove();
  while (marks.children.length < inside.length) marks.append(make("span"));
  inside.forEach((heard, i) => {
    const mark = /** @type {HTMLElement} */ (marks.children[i]);
    mark.className = shape(heard.label);
    if (mark.title !== heard.label) mark.title = heard.label;
    mark.style.left = `${(100 * (timeline?.share(heard.t_us) ?? 0)).toFixed(3)}%`;
  });
}

const calm = matchMedia("(prefers-reduced-motion: reduce)");
let lanesAt = 0;
let textAt = 0;
let overviewAt = 0;
let drawnAt = 0;
let frames = 0;

/** @param {number} now_ms */
function frame(now_ms) {
  requestAnimationFrame(frame);
  if (fresh) {
    fresh = false;
    frames++;
    maps.draw(now_ms);
  }
  if (now_ms - drawnAt >= 1000) {
    drawn = Math.round((frames * 1000) / (now_ms - drawnAt));
    [drawnAt, frames] = [now_ms, 0];
  }
  const moving = player.transport.state !== "paused";
  if (timeline && lanesDue && now_ms - lanesAt >= (calm.matches && moving ? CALM_MS : LANES_MS)) {
    lanesDue = false;
    lanesAt = now_ms;
    const { values } = settings;
    if (values.showRaster) raster.draw(timeline, values.raster === "spikes" ? "spikes" : "changes");
    lanes.draw(timeline);
    labels.place();
    placeMarks();
  }
  if (now_ms - textAt >= TEXT_MS) {
    textAt = now_ms;
    maps.write();
    writeCounters();
    writeLanes();
    player.write();
    strip.draw();
    strip.write();
    listDetections();
    if (labelsDue) {
      labelsDue = false;
      placeMarks();
    }
  }
  if (connected && player.transport.source === null && hello?.live && now_ms - overviewAt >= OVERVIEW_MS) {
    overviewAt = now_ms;
    server.say({ type: "overview" });
  }
}

/** @param {Tab} chosen @param {boolean} [focus] */
function showTab(chosen, focus = false) {
  for (const name of TABS) {
    const tab = part(`tab-${name}`, HTMLButtonElement);
    tab.setAttribute("aria-selected", String(name === chosen));
    tab.tabIndex = name === chosen ? 0 : -1;
    part(`panel-${name}`, HTMLElement).hidden = name !== chosen;
    if (focus && name === chosen) tab.focus();
  }
}

TABS.forEach((name, i) => {
  const tab = part(`tab-${name}`, HTMLButtonElement);
  tab.onclick = () => showTab(name);
  tab.onkeydown = (event) => {
    const to = { ArrowLeft: i - 1, ArrowRight: i + 1, Home: 0, End: TABS.length - 1 }[event.key];
    if (to === undefined) return;
    event.preventDefault();
    showTab(TABS[(to + TABS.length) % TABS.length], true);
  };
});

/** Colours of the theme, everywhere. */
function dress() {
  document.documentElement.dataset.theme = settings.theme;
  maps.colour();
  raster.colour();
  lanes.make();
  fresh = lanesDue = true;
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
  if (name === "theme") dress();
  if (name === "map" || name === "gamma") maps.colour();
  if (name === "flipX" || name === "flipY") maps.mark();
  if (name === "tones") recorder.tones.on = settings.values.tones;
  if (name.startsWith("show") || name === "raster") showLanes();
  fresh = true;
});
matchMedia("(prefers-color-scheme: light)").addEventListener("change", dress);

/** How far a wheel turns for one step of the zoom, pixels. */
const TURN = 40;
let turned = 0;
let zooming = false;

// One cursor for all that has time.
const stack = part("lanes", HTMLElement);
const track = part("track", HTMLElement);
/** @param {PointerEvent | MouseEvent} event @returns {number | null} */
function pointedTime(event) {
  const box = track.getBoundingClientRect();
  const share = (event.clientX - box.left) / box.width;
  return share < 0 || share > 1 ? null : (timeline?.time(share) ?? null);
}
stack.addEventListener("pointermove", (event) => {
  if (timeline) timeline.cursor_us = pointedTime(event);
  placeMarks();
});
stack.addEventListener("pointerleave", () => {
  if (timeline) timeline.cursor_us = null;
  placeMarks();
});
// With Ctrl, as two fingers on a touch pad send it too: the wheel alone scrolls.
stack.addEventListener("wheel", (event) => {
  if (!event.ctrlKey && !event.metaKey) return;
  event.preventDefault();
  turned += event.deltaY;
  if (zooming || Math.abs(turned) < TURN) return;
  zooming = true;
  zoom(turned < 0 ? 1 : -1).finally(() => {
    zooming = false;
    turned = 0;
  });
}, { passive: false });
stack.addEventListener("click", (event) => {
  const t_us = pointedTime(event);
  if (t_us !== null && event.target instanceof Element && !event.target.closest("#label-lane, button, h2")) player.seek(t_us);
});

part("files", HTMLSelectElement).onchange = ({ target }) => {
  const { value } = /** @type {HTMLSelectElement} */ (target);
  if (value) server.ask({ type: "open", name: value }).catch(failed);
  else player.follow();
};

function theme() {
  const order = ["system", "dark", "light"];
  const next = order[(order.indexOf(settings.values.theme) + 1) % order.length];
  settings.set("theme", next);
  say(`theme: ${next === "system" ? "as the system has it" : next}`);
}

function picture() {
  const inset = (/** @type {string} */ id) => part(id, HTMLElement).querySelector("canvas");
  /** @type {{ title: string, canvas: HTMLCanvasElement, inset: number }[]} */
  const shown = [];
  const { values } = settings;
  if (values.showRaster) shown.push({ title: values.raster === "spikes" ? "Spikes by row" : "Changes by row", canvas: part("raster", HTMLCanvasElement), inset: 44 });
  for (const [id, on, title] of /** @type {const} */ ([
    ["taxel-lane", values.showTaxel, `Taxel ${maps.named()}`],
    ["force-lane", values.showForce, "Force and area"],
    ["centre-lane", values.showCentre, "Centre"],
  ])) {
    const canvas = inset(id);
    if (on && canvas) shown.push({ title, canvas, inset: 0 });
  }
  const of = player.transport.source ?? "live";
  const at = ((player.t_us ?? 0) / 1e6).toFixed(3);
  savePicture({ title: `${of}, ${at} s`, file: `${of.replace(/\.[^.]+$/, "")}-${at}s.png`, lanes: shown }).then(
    () => say("picture saved"),
    failed,
  );
}

function health() {
  showTab("view");
  view.look();
}

const help = part("help", HTMLDialogElement);
const here = () => timeline?.cursor_us ?? player.t_us;
view.cutHere = (/** @type {0 | 1} */ end) => view.setCut(end, here());
const shift = (/** @type {KeyboardEvent} */ event) => (event.shiftKey ? 1e6 : 1e5);
const by = (/** @type {number} */ us) => {
  if (player.goal !== null) player.seek(player.goal + us);
};

hearKeys(
  {
    record: () => recorder.toggle(),
    play: () => player.toggle(),
    stepOn: () => player.step(1),
    stepBack: () => player.step(-1),
    on: (event) => by(shift(event)),
    back: (event) => by(-shift(event)),
    first: () => player.reach && player.seek(player.reach[0]),
    last: () => (player.transport.source === null ? player.follow() : player.reach && player.seek(player.reach[1])),
    faster: () => player.faster(1),
    slower: () => player.faster(-1),
    zoomIn: () => zoom(1),
    zoomOut: () => zoom(-1),
    live: () => player.follow(),
    mark: () => labels.markHere(),
    nextLabel: () => labels.go(1),
    labelBefore: () => labels.go(-1),
    deleteLabel: () => labels.removeChosen(),
    cutFrom: () => view.setCut(0, here()),
    cutTo: () => view.setCut(1, here()),
    open: () => part("files", HTMLSelectElement).focus(),
    crosshair: () => part("pressure-frame", HTMLElement).focus(),
    rest: () => view.rest("now"),
    health,
    picture,
    tabBoard: () => showTab("board"),
    tabRecord: () => showTab("record"),
    tabLabels: () => showTab("labels"),
    tabView: () => showTab("view"),
    theme,
    help: () => help.showModal(),
  },
  () => settings.values.letters,
);
// A narrow page has what opens recordings above the maps, so that its foot stays low.
const narrow = matchMedia("(max-width: 860px)");
const place = () => {
  if (narrow.matches) part("opening", HTMLElement).append(part("files", HTMLElement), part("speed", HTMLElement));
  else {
    part("record", HTMLElement).after(part("files", HTMLElement));
    part("step-on", HTMLElement).after(part("speed", HTMLElement));
  }
};
narrow.addEventListener("change", place);
place();
part("theme-button", HTMLButtonElement).onclick = theme;
part("help-button", HTMLButtonElement).onclick = () => help.showModal();
part("help-close", HTMLButtonElement).onclick = () => help.close();
part("picture", HTMLButtonElement).onclick = picture;
part("health", HTMLButtonElement).onclick = health;
part("zero", HTMLButtonElement).onclick = zero;
part("zoom-in", HTMLButtonElement).onclick = () => zoom(1);
part("zoom-out", HTMLButtonElement).onclick = () => zoom(-1);
part("said-close", HTMLButtonElement).onclick = () => {
  part("said", HTMLElement).hidden = true;
};
for (const kind of ["pointerdown", "keydown"]) document.addEventListener(kind, () => recorder.tones.wake(), { capture: true });

recorder.tones.on = settings.values.tones;
showKeys();
showTab("board");
labels.show();
view.showCut();
showLanes();
dress();
requestAnimationFrame(frame);
if (fragment.get("token")) server.open();
else {
  why = "the address lacks its token: copy the whole line that taxel printed";
  showState();
  failed(new Error(why));
}
