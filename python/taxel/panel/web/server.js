// The connection to the server: requests with their answers, credits for frames, and reconnecting after a break.

import { failed } from "./notice.js";
import { VERSION } from "./protocol.js";

/** @typedef {import("./messages.js").Message} Message */
/** @typedef {import("./messages.js").Refused} Refused */
/** @typedef {import("./messages.js").Request} Request */

/** Time until the next attempt to connect, ms. */
const RECONNECT_MS = 2000;

/** The reason why a request was refused. */
export class RefusedError extends Error {
  /** @param {Refused} message */
  constructor(message) {
    super(message.reason);
    this.field = message.field;
  }
}

/**
 * Asks for what is lacking, one request at a time.
 * @param {Server} server
 * @param {() => Request | null} lacking the next request
 * @param {() => void} [refused] called where one is refused, which ends this turn
 * @returns {() => Promise<void>}
 */
export function inTurn(server, lacking, refused) {
  let asking = false;
  return async () => {
    if (asking) return;
    asking = true;
    try {
      for (let request = lacking(); request; request = lacking()) await server.request(request);
    } catch (error) {
      refused?.();
      failed(error);
    }
    asking = false;
  };
}

/** One WebSocket, opened again after it has closed. */
export class Server {
  /**
   * @param {string} token
   * @param {(message: Message) => void} onMessage
   * @param {(frame: ArrayBuffer) => void} onFrame
   * @param {(state: "open" | "lost", why: string) => void} onState
   */
  constructor(token, onMessage, onFrame, onState) {
    this.token = token;
    this.onMessage = onMessage;
    this.onFrame = onFrame;
    this.onState = onState;
    /** @type {WebSocket | null} */
    this.socket = null;
    this.next = 0;
    /** @type {Map<number, { done: () => void, refused: (error: Error) => void }>} */
    this.pending = new Map();
  }

  /** Connects, and again whenever the connection has closed. */
  open() {
    const socket = new WebSocket(`ws://${location.host}/socket`, [`taxel.panel.${VERSION}`, `token.${this.token}`]);
    socket.binaryType = "arraybuffer";
    this.socket = socket;
    socket.onopen = () => {
      this.onState("open", "");
      this.send({ type: "credit", n: 2 });
    };
    socket.onmessage = ({ data }) => {
      if (data instanceof ArrayBuffer) {
        // A credit for each frame received, not drawn: two may arrive between two refreshes of the screen.
        this.send({ type: "credit", n: 1 });
        this.onFrame(data);
      } else {
        this.receive(JSON.parse(data));
      }
    };
    socket.onclose = ({ code, reason }) => {
      for (const { refused } of this.pending.values()) refused(new Error("the connection broke"));
      this.pending.clear();
      const why = code === 1001 ? "the server has ended" : reason || "no connection to the server";
      this.onState("lost", why);
      setTimeout(() => this.open(), RECONNECT_MS);
    };
  }

  /** @param {Message} message */
  receive(message) {
    const request = (message.type === "done" || message.type === "refused") && typeof message.id === "number" ? this.pending.get(message.id) : undefined;
    if (!request) return this.onMessage(message);
    const { id } = /** @type {{ id: number }} */ (message);
    this.pending.delete(id);
    if (message.type === "refused") request.refused(new RefusedError(message));
    else request.done();
  }

  /**
   * Sends a message that needs no answer.
   * @param {Request} message
   */
  send(message) {
    if (this.socket?.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(message));
  }

  /** Makes a request; the user sees why it was refused. @param {Request} message */
  ask(message) {
    return this.request(message).catch(failed);
  }

  /**
   * Makes a request: fulfilled when it is done, rejected with the reason when it is refused.
   * @param {Request} message
   * @returns {Promise<void>}
   */
  request(message) {
    if (this.socket?.readyState !== WebSocket.OPEN) return Promise.reject(new Error("no connection to the server"));
    const id = this.next++;
    return new Promise((done, refused) => {
      this.pending.set(id, { done, refused });
      this.send({ ...message, id });
    });
  }
}
