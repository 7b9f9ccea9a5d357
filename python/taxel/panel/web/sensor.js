// The dialog that connects a sensor on a serial port: port, speed, rows and columns as its lines look.

import { make, part, write } from "./dom.js";

/** @typedef {import("./messages.js").Guess} Guess */
/** @typedef {import("./messages.js").Ports} Ports */
/** @typedef {import("./server.js").Server} Server */

/** Rows and columns in the text of a source. */
const ARRAY = /,array=(\d+)x(\d+)/;

/** The dialog and the button that opens it. */
export class Sensor {
  /** @param {Server} server */
  constructor(server) {
    this.server = server;
    /** The source as its lines look; empty before they were read. */
    this.source = "";
    this.dialog = part("sensor", HTMLDialogElement);
    this.port = part("sensor-port", HTMLSelectElement);
    this.baud = part("sensor-baud", HTMLInputElement);
    this.rows = part("sensor-rows", HTMLInputElement);
    this.columns = part("sensor-columns", HTMLInputElement);
    part("sensor-open", HTMLButtonElement).onclick = () => {
      this.dialog.showModal();
      this.ask({ type: "ports" });
    };
    part("sensor-close", HTMLButtonElement).onclick = () => this.dialog.close();
    part("sensor-off", HTMLButtonElement).onclick = () => this.ask({ type: "disconnect" });
    for (const input of [this.port, this.baud]) input.onchange = () => this.look();
    part("sensor-form", HTMLFormElement).onsubmit = (event) => {
      event.preventDefault();
      const place = this.source.replace(ARRAY, "") || this.place;
      this.ask({ type: "connect", source: `${place},array=${this.rows.value}x${this.columns.value}` }).then((done) => done && this.dialog.close());
    };
  }

  /** @returns {string} port and speed as the text of a source */
  get place() {
    return `serial:${this.port.value},baud=${this.baud.value}`;
  }

  /** Reads lines for two seconds, to see what they are. */
  look() {
    this.source = "";
    if (!this.port.value) return;
    this.say("Reading what the sensor prints …");
    this.ask({ type: "guess", port: this.port.value, baud: Number(this.baud.value) });
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
    const { value } = this.port;
    const options = ports.map(({ place, about }) => make("option", { value: place }, about ? `${place} · ${about}` : place));
    this.port.replaceChildren(make("option", { value: "" }, ports.length ? "Choose a port" : "No serial port found"), ...options);
    this.port.value = ports.some(({ place }) => place === value) ? value : "";
  }

  /** @param {Guess} guess */
  take({ lines, about, source }) {
    this.say([about, ...lines.slice(-3)].join("\n"));
    const [, rows, columns] = source.match(ARRAY) ?? [];
    if (!rows) return;
    this.source = source;
    [this.rows.value, this.columns.value] = [rows, columns];
  }
}
