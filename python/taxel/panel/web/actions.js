// What keys and buttons do.

import { part } from "./dom.js";
import { bindKeys } from "./keys.js";
import { failed, notify } from "./notice.js";
import { showTab, TABS } from "./tabs.js";

/**
 * The parts of the page that actions concern.
 * @typedef {object} Parts
 * @property {import("./server.js").Server} server
 * @property {import("./player.js").Player} player
 * @property {import("./settings.js").Settings} settings
 * @property {import("./recorder.js").Recorder} recorder
 * @property {import("./labels.js").Labels} labels
 * @property {import("./mistakes.js").Mistakes} mistakes
 * @property {import("./view.js").View} view
 * @property {import("./maps.js").Maps} maps
 * @property {import("./cursor.js").Cursor} cursor
 * @property {import("./window.js").TimeWindow} window
 */

/** @typedef {import("./timeline.js").Timeline} Timeline */

/**
 * Binds keys and buttons to their actions.
 * @param {Parts} parts
 * @param {() => Timeline | null} timeline
 */
export function bindActions({ server, player, settings, recorder, labels, mistakes, view, maps, cursor, window }, timeline) {
  const help = part("help", HTMLDialogElement);
  const cutHere = (/** @type {0 | 1} */ end) => view.setCut(end, timeline()?.cursor_us ?? player.targetTime);
  const step = (/** @type {KeyboardEvent} */ event) => (event.shiftKey ? 1e6 : 1e5);
  const moveBy = (/** @type {number} */ us) => {
    if (player.targetTime !== null) player.seek(player.targetTime + us);
  };
  const health = () => {
    showTab("view");
    view.look();
  };
  const theme = () => {
    const order = ["system", "dark", "light"];
    const next = order[(order.indexOf(settings.values.theme) + 1) % order.length];
    settings.set("theme", next);
    notify(`theme: ${next === "system" ? "the system’s" : next}`);
  };
  /** Sets the rest of the watched taxel to its held value, for the readout too. */
  const zero = () => {
    const { taxel } = maps;
    if (!taxel) return notify("choose a taxel first: click it on a map, or use the arrow keys on the map", true);
    server.request({ type: "zero", taxels: [taxel] }).then(() => notify(`zeroed row ${taxel[1]}, column ${taxel[0]}`), failed);
  };
  /** Sets the rest of all taxels that have a value to it, of frames to the median of the last second: nothing may touch the sensor. */
  const zeroAll = () => {
    if (part("zero-all", HTMLButtonElement).hidden) return;
    const taxels = maps.known;
    server.request({ type: "zero", taxels }).then(() => notify(`zeroed ${taxels.length} taxels`), failed);
  };
  view.cutHere = cutHere;
  bindKeys({
    record: () => recorder.toggle(),
    play: () => player.toggle(),
    stepOn: () => player.step(1),
    stepBack: () => player.step(-1),
    on: (event) => moveBy(step(event)),
    back: (event) => moveBy(-step(event)),
    first: () => player.reach && player.seek(player.reach[0]),
    last: () => (player.transport.source === null ? player.follow() : player.reach && player.seek(player.reach[1])),
    faster: () => player.faster(1),
    slower: () => player.faster(-1),
    zoomIn: () => window.scale(0.5),
    zoomOut: () => window.scale(2),
    second: () => cursor.second(),
    showAll: () => window.showAll(),
    live: () => player.follow(),
    mark: () => labels.markHere(),
    nextLabel: () => labels.go(1),
    labelBefore: () => labels.go(-1),
    nextMistake: () => mistakes.go(1),
    mistakeBefore: () => mistakes.go(-1),
    deleteLabel: () => labels.removeChosen(),
    undo: () => labels.undo(),
    cutFrom: () => cutHere(0),
    cutTo: () => cutHere(1),
    open: () => part("files", HTMLSelectElement).focus(),
    crosshair: () => part("pressure-frame", HTMLElement).focus(),
    zeroAll,
    health,
    tab: ({ key }) => showTab(TABS[Number(key) - 1]),
    theme,
    help: () => help.showModal(),
  });
  const onClick = (/** @type {string} */ id, /** @type {() => void} */ action) => {
    part(id, HTMLButtonElement).onclick = action;
  };
  onClick("theme-button", theme);
  onClick("help-button", () => help.showModal());
  onClick("help-close", () => help.close());
  onClick("zero", zero);
  onClick("zero-all", zeroAll);
  onClick("zoom-in", () => window.scale(0.5));
  onClick("zoom-out", () => window.scale(2));
}
