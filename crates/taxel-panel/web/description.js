// What a recording of another program does not say itself: the topic of a bag, its size, its rate, whether values fall. It is written into the
// layout file beside the recording, by which the page and every command read it.

import { make, part, write } from "./dom.js";

/** @typedef {import("./messages.js").BagTopic} BagTopic */
/** @typedef {import("./messages.js").DescribeRequest} DescribeRequest */
/** @typedef {import("./messages.js").Opened} Opened */
/** @typedef {import("./messages.js").Topics} Topics */

/** The part of the tab View that says how a recording is read. */
export class Description {
  /**
   * @param {import("./server.js").Server} server
   * @param {(name: string) => void} open called to open a recording again
   * @param {(name: string) => number | null} labelled how many labels a recording has
   * @param {() => void} shown called to bring the tab to the front
   */
  constructor(server, open, labelled, shown) {
    this.server = server;
    this.open = open;
    this.labelled = labelled;
    this.shown = shown;
    /** The recording that it is about. */
    this.name = "";
    /** @type {BagTopic[]} */
    this.topics = [];
    this.block = part("reading", HTMLDetailsElement);
    this.block.ontoggle = () => {
      if (this.block.open && !this.topics.length) this.look(this.name);
    };
    this.topic = part("topic", HTMLSelectElement);
    this.topic.onchange = () => this.showSize();
    this.rows = part("reading-rows", HTMLInputElement);
    this.columns = part("reading-columns", HTMLInputElement);
    this.rate = part("rate", HTMLInputElement);
    this.falls = part("falls", HTMLInputElement);
    part("reading-form", HTMLFormElement).onsubmit = (event) => {
      event.preventDefault();
      this.write(this.stated());
    };
  }

  /** @param {Opened | null} opened the recording that is shown */
  choose(opened) {
    const { frames } = opened ?? {};
    const again = opened?.name === this.name;
    this.about(opened && frames ? opened.name : "");
    if (!opened || !frames) return;
    part("rate-field", HTMLElement).hidden = frames.number_us === null;
    if (again) return;
    this.falls.checked = false;
    this.block.open = false;
  }

  /** A recording was not opened: it may be a bag of which no topic is chosen. @param {string} name */
  refused(name) {
    this.look(name);
  }

  /** @param {string} name */
  look(name) {
    if (name) this.server.send({ type: "topics", name });
  }

  /** @param {string} name */
  about(name) {
    this.refuse("");
    if (name !== this.name) this.offered([]);
    this.name = name;
    this.block.hidden = !name;
    write(part("reading-file", HTMLElement), `${name.replace(/\.[^.]+$/, "")}.layout.toml`);
  }

  /** @param {Topics} message @param {string | null} shown the recording that is shown */
  offer({ name, topics }, shown) {
    if (!topics.length) return;
    if (name !== shown) {
      // Nothing can be shown before a topic is chosen.
      this.about(name);
      part("rate-field", HTMLElement).hidden = true;
      this.shown();
      this.block.open = true;
    }
    this.offered(topics);
  }

  /** @param {BagTopic[]} topics */
  offered(topics) {
    this.topics = topics;
    const options = topics.map(({ topic, field, shape, messages, trouble }, i) => {
      const text = [`${topic}${field ? ` ${field}` : ""}`, shape.join(" × "), trouble || `${messages} messages`].filter(Boolean).join(", ");
      return make("option", { value: i, disabled: Boolean(trouble) }, text);
    });
    this.topic.replaceChildren(...options);
    const largest = topics.reduce((best, { shape, trouble }, i) => {
      const size = trouble ? 0 : shape.reduce((product, count) => product * count, 1);
      return size > best.size ? { i, size } : best;
    }, { i: 0, size: 0 });
    if (topics.length) this.topic.value = String(largest.i);
    part("topic-field", HTMLElement).hidden = part("size-field", HTMLElement).hidden = !topics.length;
    this.showSize();
  }

  /** Offers the size of the topic that is chosen: that of its messages, or a square. */
  showSize() {
    const shape = this.topics[Number(this.topic.value)]?.shape ?? [];
    const side = Math.sqrt(shape[0] ?? 0);
    const [rows, columns] = shape.length === 2 ? shape : Number.isInteger(side) && side > 1 ? [side, side] : [1, shape[0] ?? ""];
    [this.rows.value, this.columns.value] = shape.length ? [String(rows), String(columns)] : ["", ""];
  }

  /** @returns {Omit<DescribeRequest, "type" | "name">} what the form states */
  stated() {
    const topic = this.topics[Number(this.topic.value)];
    const [rows, columns] = [Number(this.rows.value), Number(this.columns.value)];
    const rate_hz = Number(this.rate.value.replace(",", "."));
    return {
      ...(topic ? { topic: topic.topic, ...(topic.field ? { field: topic.field } : {}), ...(rows && columns ? { size: [rows, columns] } : {}) } : {}),
      ...(this.rate.value.trim() && !part("rate-field", HTMLElement).hidden ? { rate_hz } : {}),
      ...(this.falls.checked ? { falls: true } : {}),
    };
  }

  /** Writes what is stated, and reads the recording again. @param {Omit<DescribeRequest, "type" | "name">} stated */
  async write(stated) {
    const { name } = this;
    if (stated.rate_hz !== undefined && this.labelled(name)) return this.refuse("the labels of this recording are frame numbers, not times in seconds: delete the labels before you state a rate");
    if (!Object.keys(stated).length) return this.refuse("nothing to save: fill in a field first");
    try {
      await this.server.request({ type: "describe", name, ...stated });
      this.refuse("");
      this.open(name);
    } catch (error) {
      this.shown();
      this.block.open = true;
      this.refuse(error instanceof Error ? error.message : String(error));
    }
  }

  /** @param {string} reason "": none */
  refuse(reason) {
    const why = part("reading-why", HTMLElement);
    why.hidden = !reason;
    write(why, reason);
  }
}
