// The line to the server: requests with their answers, credits for pictures, and coming back after a break.

import { VERSION } from "./protocol.js";

/** @typedef {import("./protocol.js").Message} Message */
/** @typedef {import("./protocol.js").Refused} Refused */

/** How long until the next attempt, ms. */
const AGAIN_MS = 2000;

/** What a request was refused for. */
export class RefusedError extends Error {
  /** @param {Refused} said */
  constructor(said) {
    super(said.reason);
    this.field = said.field;
  }
}

/** One WebSocket, opened again when it breaks. */
export class Server {
  /**
   * @param {string} token
   * @param {(message: Message) => void} told
   * @param {(picture: ArrayBuffer) => void} pictured
   * @param {(state: "open" | "lost", why: string) => void} changed
   */
  constructor(token, told, pictured, changed) {
    this.token = token;
    this.told = told;
    this.pictured = pictured;
    this.changed = changed;
    /** @type {WebSocket | null} */
    this.socket = null;
    this.next = 0;
    /** @type {Map<number, { done: () => void, refused: (error: Error) => void }>} */
    this.waiting = new Map();
  }

  /** Opens the line, and again whenever it has closed. */
  open() {
    const socket = new WebSocket(`ws://${location.host}/socket`, [`taxel.panel.${VERSION}`, `token.${this.token}`]);
    socket.binaryType = "arraybuffer";
    this.socket = socket;
    socket.onopen = () => {
      this.changed("open", "");
      this.say({ type: "credit", n: 2 });
    };
    socket.onmessage = ({ data }) => {
      if (data instanceof ArrayBuffer) {
        // A credit for what was received, not drawn: two may arrive between two frames of the screen.
        this.say({ type: "credit", n: 1 });
        this.pictured(data);
      } else {
        this.hear(JSON.parse(data));
      }
    };
    socket.onclose = ({ code, reason }) => {
      for (const { refused } of this.waiting.values()) refused(new Error("the connection broke"));
      this.waiting.clear();
      const why = code === 1001 ? "the server has ended" : reason || "no connection to the server";
      this.changed("lost", why);
      setTimeout(() => this.open(), AGAIN_MS);
    };
  }

  /** @param {Message} message */
  hear(message) {
    const asked = (message.type === "done" || message.type === "refused") && message.id !== undefined ? this.waiting.get(message.id) : undefined;
    if (!asked) return this.told(message);
    const { id } = /** @type {{ id: number }} */ (message);
    this.waiting.delete(id);
    if (message.type === "refused") asked.refused(new RefusedError(message));
    else asked.done();
  }

  /**
   * Says something that needs no answer.
   * @param {{ type: string } & Record<string, unknown>} message
   */
  say(message) {
    if (this.socket?.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(message));
  }

  /**
   * Asks for something: fulfilled when it is done, rejected with the reason when it is refused.
   * @param {{ type: string } & Record<string, unknown>} message
   * @returns {Promise<void>}
   */
  ask(message) {
    if (this.socket?.readyState !== WebSocket.OPEN) return Promise.reject(new Error("no connection to the server"));
    const id = this.next++;
    return new Promise((done, refused) => {
      this.waiting.set(id, { done, refused });
      this.say({ ...message, id });
    });
  }
}
