// From labels to a readout: trains on the labels of the recording that is shown, and lets a readout of the folder read what is shown.

import { make, part, write } from "./dom.js";
import { failed, notify } from "./notice.js";

/** @typedef {import("./messages.js").Recordings} Recordings */
/** @typedef {import("./messages.js").Trained} Trained */
/** @typedef {import("./server.js").Server} Server */

/** The button that trains, what the training prints, and the choice of the readout. */
export class Training {
  /**
   * @param {Server} server
   * @param {import("./player.js").Player} player
   * @param {import("./mistakes.js").Mistakes} mistakes
   * @param {() => void} chosen called when another readout is to read what is shown
   */
  constructor(server, player, mistakes, chosen) {
    this.server = server;
    this.player = player;
    this.mistakes = mistakes;
    this.chosen = chosen;
    /** When the training began, ms; null while none runs. @type {number | null} */
    this.since = null;
    /** The recording that is shown; null: the live source. @type {string | null} */
    this.source = null;
    this.button = part("train", HTMLButtonElement);
    this.button.onclick = () => (this.since === null ? this.begin() : this.end());
    /** The readout that reads what is shown; "" without one. */
    this.reads = "";
    this.readout = part("readout", HTMLSelectElement);
    this.readout.onchange = () => this.read(this.readout.value);
    /** What detects each label: the better in training, its plain rule or its neuron. */
    this.use = part("use", HTMLSelectElement);
    this.use.onchange = () => this.read(this.readout.value);
  }

  async begin() {
    this.since = performance.now();
    this.text("");
    this.mistakes.clear();
    this.write();
    try {
      await this.server.request({ type: "train" });
    } catch (error) {
      this.text(error instanceof Error ? error.message : String(error));
      part("train-text", HTMLElement).classList.add("bad");
    }
    this.since = null;
    this.write();
  }

  end() {
    this.server.request({ type: "train_stop" }).catch(failed);
  }

  /** @param {string} text how far the training is, or its result @param {string} [next] the command that detects */
  text(text, next = "") {
    const output = part("train-text", HTMLElement);
    output.hidden = !text;
    output.classList.remove("bad");
    write(output, ...text.split("\n"));
    part("train-next", HTMLElement).hidden = !next;
    write(part("train-detect", HTMLElement), next);
  }

  /** Shows how far the training that runs is. @param {string} text as the command says it */
  progress(text) {
    if (this.since !== null) this.text(text);
  }

  /** @param {Trained} trained */
  take(trained) {
    const { name, readout, text, next } = trained;
    this.text(text, next);
    if (name !== this.source) return;
    this.mistakes.take(trained);
    this.read(readout);
  }

  /** Lets a readout read what is shown. @param {string} readout */
  async read(readout) {
    const { source } = this;
    const { t_us } = this.player;
    this.readout.value = readout;
    this.use.hidden = !readout;
    this.chosen();
    if (readout) notify(`${readout} reads ${source ?? "the board: leave the sensor at rest for the tare"}`);
    /** @type {import("./messages.js").Request} */
    const request = readout ? { type: "read_out", readout, use: this.use.value } : source === null ? { type: "live" } : { type: "open", name: source };
    try {
      await this.server.request(request);
      if (source !== this.source) return;
      this.reads = readout;
      // What is opened again begins at its beginning.
      if (!readout && source !== null && t_us !== null) this.player.seek(t_us);
    } catch (error) {
      if (source === this.source && this.readout.value === readout) {
        this.readout.value = this.reads;
        this.use.hidden = !this.reads;
        this.chosen();
      }
      failed(error);
    }
  }

  /** @param {Recordings} message */
  list({ readouts }) {
    const now = this.readout.value;
    this.readout.replaceChildren(make("option", { value: "" }, "as recorded"), ...readouts.map((value) => make("option", { value }, value)));
    this.readout.value = readouts.includes(now) ? now : "";
    this.show();
  }

  /** @param {string | null} source a recording, or null: the live source @param {string | null} [trial] where the file holds several */
  choose(source, trial = null) {
    this.mistakes.choose(trial, source === this.source);
    if (source === this.source) return;
    this.source = source;
    this.reads = this.readout.value = "";
    this.use.hidden = true;
    if (this.since === null) this.text("");
    this.show();
  }

  show() {
    const [first, ...readouts] = this.readout.options;
    write(first, this.source === null ? "as started" : "as recorded");
    // A readout that runs live is replaced by another; only a restart of the program is without one.
    this.readout.hidden = readouts.length === 0;
  }

  /** Writes how long the training has run. */
  write() {
    const running = this.since === null ? null : Math.round((performance.now() - this.since) / 1000);
    this.button.dataset.state = running === null ? "idle" : "running";
    write(this.button, running === null ? "Train on these labels" : `Stop the training (${running} s)`);
  }
}
