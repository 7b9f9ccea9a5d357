// The dialog that connects a sensor: a place and its speed; what its lines hold is chosen in the dialog of roles.

import { make, part, write } from "./dom.js";

/** @typedef {import("./messages.js").Ports} Ports */
/** @typedef {import("./server.js").Server} Server */

/** The dialog and the button that opens it. */
export class Sensor {
  /** @param {Server} server */
  constructor(server) {
    this.server = server;
    this.dialog = part("sensor", HTMLDialogElement);
    this.place = part("sensor-place", HTMLInputElement);
    part("sensor-open", HTMLButtonElement).onclick = () => {
      this.dialog.showModal();
      this.ask({ type: "ports" });
    };
    part("sensor-close", HTMLButtonElement).onclick = () => this.dialog.close();
    part("sensor-off", HTMLButtonElement).onclick = () => this.ask({ type: "disconnect" });
    part("sensor-form", HTMLFormElement).onsubmit = (event) => {
      event.preventDefault();
      this.say("Reading what the sensor prints …");
      const request = { type: /** @type {const} */ ("guess"), place: this.place.value.trim(), baud: Number(part("sensor-baud", HTMLInputElement).value) };
      this.ask(request).then((done) => done && this.dialog.close());
    };
  }

  /** @param {import("./messages.js").Request} request @returns {Promise<boolean>} whether it was done */
  async ask(request) {
    try {
      await this.server.request(request);
      return true;
    } catch (error) {
      this.say(error instanceof Error ? error.message : String(error));
      return false;
    }
  }

  /** @param {string} text */
  say(text) {
    write(part("sensor-about", HTMLElement), ...text.split("\n"));
  }

  /** @param {Ports} message */
  offer({ ports }) {
    part("sensor-ports", HTMLElement).replaceChildren(...ports.map(({ place, about }) => make("option", { value: place }, about)));
    this.say(ports.length ? "Choose a port, or type where lines of numbers come from." : "No serial port found: type where lines of numbers come from.");
    this.place.value ||= ports.length === 1 ? ports[0].place : "";
  }
}
