// Helpers for the page's elements: find them by id, create them, write text only where it changed.
// Names in strangers' files may hold control characters; what these write shows them escaped.

/** C0, DEL and C1, marks and overrides of direction, separators, lone surrogates: as `escaped` of taxel/_base/messages.py. */
const CONTROL = /[\u0000-\u001f\u007f-\u009f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]/gu;
/** @type {Record<string, string>} */
const SHORT = { "\t": "\\t", "\n": "\\n", "\r": "\\r" };

/**
 * A text as one line without control characters: each is escaped as in a literal of Python.
 * @param {string} text
 * @returns {string}
 */
export function escaped(text) {
  return text.replace(CONTROL, (found) => {
    const code = found.charCodeAt(0);
    return SHORT[found] ?? (code < 0x7f ? `\\x${code.toString(16).padStart(2, "0")}` : `\\u${code.toString(16).padStart(4, "0")}`);
  });
}

/**
 * Finds an element of the page; throws where the page has none of that id and kind.
 * @template {Element} T
 * @param {string} id
 * @param {new () => T} kind
 * @returns {T}
 */
export function part(id, kind) {
  const found = document.getElementById(id);
  if (!(found instanceof kind)) throw new Error(`the page has no ${kind.name} #${id}`);
  return found;
}

/**
 * Makes an element.
 * @template {keyof HTMLElementTagNameMap} T
 * @param {T} tag
 * @param {Record<string, string | number | boolean>} [attributes] false: left out
 * @param {...(Node | string)} children
 * @returns {HTMLElementTagNameMap[T]}
 */
export function make(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    // A value is sent back to the server, and stays as it is.
    const text = name === "value" ? String(value) : escaped(String(value));
    if (value !== false) element.setAttribute(name, value === true ? "" : text);
  }
  element.append(...children.map((child) => (typeof child === "string" ? escaped(child) : child)));
  return element;
}

/** Makes an element of a drawing. @template {keyof SVGElementTagNameMap} T @param {T} tag @param {Record<string, string | number>} attributes */
export function drawing(tag, attributes) {
  const element = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, String(value));
  return element;
}

/**
 * Gives an element so many children; those that it has stay.
 * @template {HTMLElement} T
 * @param {HTMLElement} parent
 * @param {number} count
 * @param {(i: number) => T} create makes the child of this number
 * @returns {T[]}
 */
export function withChildren(parent, count, create) {
  while (parent.children.length > count) parent.lastElementChild?.remove();
  while (parent.children.length < count) parent.append(create(parent.children.length));
  return /** @type {T[]} */ ([...parent.children]);
}

/**
 * Writes text where it differs: an unchanged text costs no layout.
 * @param {Node} node
 * @param {...string} lines
 */
export function write(node, ...lines) {
  const text = lines.map(escaped).join("\n");
  if (node.textContent !== text) node.textContent = text;
}

/**
 * Names an element, for those who point at it or hear it, where the name differs.
 * @param {Element} element
 * @param {"title" | "aria-label"} attribute
 * @param {string} name
 */
export function entitle(element, attribute, name) {
  const text = escaped(name);
  if (element.getAttribute(attribute) !== text) element.setAttribute(attribute, text);
}

/**
 * The 2D context of a canvas.
 * @param {HTMLCanvasElement} canvas
 * @returns {CanvasRenderingContext2D}
 */
export function ground(canvas) {
  const context = canvas.getContext("2d");
  if (!context) throw new Error("this browser has no 2D canvas");
  return context;
}

/**
 * A colour of the theme, by the name of its variable.
 * @param {string} name
 * @returns {string}
 */
export function themed(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
}

/**
 * Gives a canvas as many pixels as the screen has under it.
 * @param {HTMLCanvasElement} canvas
 * @returns {{ width: number, height: number, ratio: number, resized: boolean }} CSS pixels
 */
export function fitted(canvas) {
  const ratio = Math.min(2, window.devicePixelRatio || 1);
  const { clientWidth: width, clientHeight: height } = canvas;
  const [wide, high] = [Math.max(1, Math.round(width * ratio)), Math.max(1, Math.round(height * ratio))];
  const resized = canvas.width !== wide || canvas.height !== high;
  if (resized) [canvas.width, canvas.height] = [wide, high];
  return { width, height, ratio, resized };
}
