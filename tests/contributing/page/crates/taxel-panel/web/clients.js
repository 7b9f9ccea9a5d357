// A button that shows how many clients the server has.

import { part, write } from "./dom.js";

/** @typedef {import("./messages.js").Clients} ClientsMessage */
/** @typedef {import("./server.js").Server} Server */

export class Clients {
  /** @param {Server} server */
  constructor(server) {
    part("clients", HTMLButtonElement).onclick = () => server.send({ type: "clients" });
  }

  /** @param {ClientsMessage} message */
  show({ count }) {
    write(part("clients-count", HTMLElement), String(count));
  }
}
