// The picture as a file: maps with their colours, and all lanes, as PNG.

import { escaped, ground, part, themed } from "./dom.js";

const WIDE = 1200;
const EDGE = 32;
const BETWEEN = 40;
/** Room for a lane's title. */
const LANE = 30;

/**
 * A lane's canvas. `inset`: how much narrower it is than the lanes on each side, CSS pixels.
 * @typedef {{ title: string, canvas: HTMLCanvasElement, inset: number }} Lane
 */

/** @param {Lane} lane @returns {number} its height in the picture */
const heightOf = ({ canvas, inset }) => (canvas.clientHeight * WIDE) / (canvas.clientWidth + 2 * inset);

/**
 * Draws what is shown into one picture and hands it to the browser to save.
 * @param {{ title: string, file: string, lanes: Lane[] }} what
 * @returns {Promise<void>}
 */
export async function savePicture({ title, file, lanes }) {
  const maps = [
    { name: "pressure", caption: `${part("pressure-title", HTMLElement).textContent} ${part("pressure-above", HTMLElement).textContent}`, ends: ["0", part("pressure-top", HTMLElement).textContent ?? ""] },
    { name: "change", caption: "Change", ends: [part("change-least", HTMLElement).textContent ?? "", part("change-top", HTMLElement).textContent ?? ""] },
  ].filter(({ name }) => part(`${name}-map`, HTMLCanvasElement).clientWidth > 0);
  const side = (WIDE - 2 * EDGE - BETWEEN) / 2;
  const map = part(`${maps[0].name}-map`, HTMLCanvasElement);
  const high = (side * map.clientHeight) / map.clientWidth;
  const top = EDGE + 40;
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [WIDE, Math.ceil(top + 24 + high + 50 + lanes.reduce((sum, lane) => sum + LANE + heightOf(lane), 0) + EDGE)];
  const context = ground(canvas);
  const font = getComputedStyle(document.body).fontFamily;
  const text = (/** @type {string} */ caption, /** @type {number} */ x, /** @type {number} */ y, /** @type {number} */ size, colour = "text") => {
    context.font = `${size}px ${font}`;
    context.fillStyle = themed(colour);
    context.fillText(escaped(caption), x, y);
  };
  context.fillStyle = themed("ground");
  context.fillRect(0, 0, canvas.width, canvas.height);
  text(title, EDGE, EDGE + 16, 20);
  context.imageSmoothingEnabled = false;
  maps.forEach(({ name, caption, ends }, i) => {
    const x = EDGE + i * (side + BETWEEN);
    text(caption, x, top + 14, 15);
    context.drawImage(part(`${name}-map`, HTMLCanvasElement), x, top + 24, side, high);
    context.drawImage(part(`${name}-bar`, HTMLCanvasElement), x, top + 24 + high + 8, side, 8);
    text(ends[0], x, top + high + 56, 13, "dim");
    context.textAlign = "right";
    text(ends[1], x + side, top + high + 56, 13, "dim");
    context.textAlign = "left";
  });
  context.imageSmoothingEnabled = true;
  let y = top + high + 74;
  for (const lane of lanes) {
    const share = WIDE / (lane.canvas.clientWidth + 2 * lane.inset);
    text(lane.title, EDGE, y + 14, 14);
    context.drawImage(lane.canvas, lane.inset * share, y + 22, lane.canvas.clientWidth * share, heightOf(lane));
    y += LANE + heightOf(lane);
  }
  const blob = await new Promise((done) => canvas.toBlob(done, "image/png"));
  if (!(blob instanceof Blob)) throw new Error("this browser could not make a PNG");
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = file;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}
