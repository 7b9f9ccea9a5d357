// The connection to the board: its control line and the address of its events, chosen or typed; the lines that it sends.

import { entitle, make, part, write } from "./dom.js";

/** @typedef {import("./messages.js").Hello} Hello */
/** @typedef {import("./messages.js").Places} Places */
/** @typedef {import("./messages.js").Port} Port */
/** @typedef {import("./messages.js").SourcePreview} SourcePreview */
/** @typedef {import("./server.js").Server} Server */
/** @typedef {import("./settings.js").Settings} Settings */
/** @typedef {{ label: string, choices: { address: string, text: string }[] }} Group */

/** How many addresses of each kind the browser stores. */
const STORED = 8;
const MOST_LINES = 200;

/** An address to choose from a list, or to type, and to connect to: a serial port, or host and port. */
class AddressForm {
  /**
   * @param {"control" | "udp" | "numbers"} name of its parts in the page
   * @param {"lines" | "addresses" | "sources"} setting the setting that stores earlier addresses
   * @param {Settings} settings
   * @param {(address: string) => Promise<void>} connect
   */
  constructor(name, setting, settings, connect) {
    this.setting = setting;
    this.settings = settings;
    this.input = part(name, HTMLInputElement);
    this.choice = part(`${name}-choice`, HTMLSelectElement);
    this.why = part(`${name}-why`, HTMLElement);
    /** @type {Group[]} */
    this.groups = [];
    this.none = "";
    this.choice.onchange = () => {
      if (this.choice.value) this.input.value = this.choice.value;
      this.refuse(null);
    };
    part(`${name}-form`, HTMLFormElement).onsubmit = (event) => {
      event.preventDefault();
      const { address } = this;
      connect(address).then(() => {
        this.refuse(null);
        this.remember(address);
      }, (error) => this.refuse(error.message));
    };
  }

  /** @returns {string} what is typed; the bare name of a serial port is a source of lines by its kind */
  get address() {
    const typed = this.input.value.trim();
    return this.setting === "sources" && /^(\/dev\/|COM\d)/i.test(typed) ? `serial:${typed}` : typed;
  }

  /** @param {string | null} reason */
  refuse(reason) {
    this.why.hidden = reason === null;
    this.input.setAttribute("aria-invalid", String(reason !== null));
    write(this.why, reason ?? "");
  }

  /** @param {string} address */
  remember(address) {
    const before = this.before.filter((earlier) => earlier !== address);
    this.settings.set(this.setting, [address, ...before].slice(0, STORED).join("\n"));
    this.show();
  }

  /** @returns {string[]} where it was before, the last first */
  get before() {
    return this.settings.values[this.setting].split("\n").filter(Boolean);
  }

  /** @param {Group[]} groups @param {string} none the text where there are none */
  offer(groups, none) {
    [this.groups, this.none] = [groups, none];
    this.show();
  }

  show() {
    const found = this.groups.flatMap(({ choices }) => choices.map(({ address }) => address));
    const before = this.before.filter((earlier) => !found.includes(earlier));
    const groups = [...this.groups, { label: "Used before", choices: before.map((address) => ({ address, text: address })) }];
    const options = groups
      .filter(({ choices }) => choices.length)
      .map(({ label, choices }) => make("optgroup", { label }, ...choices.map(({ address, text }) => make("option", { value: address }, text))));
    const first = options.length ? "choose or type" : this.none;
    this.choice.replaceChildren(make("option", { value: "" }, first), ...options);
    this.choice.value = [...this.choice.options].some(({ value }) => value === this.input.value) ? this.input.value : "";
  }

  /** @param {string | null} address where it is now */
  at(address) {
    // Text that is being typed stays, and so does a refused address.
    if (document.activeElement !== this.input && (address !== null || this.why.hidden)) this.input.value = address ?? "";
    this.show();
  }
}

/** The part of the board's tab that chooses and connects. */
export class Connection {
  /**
   * @param {Server} server
   * @param {Settings} settings
   * @param {(error: unknown) => void} failed
   */
  constructor(server, settings, failed) {
    this.server = server;
    this.udp = "";
    this.line = new AddressForm("control", "lines", settings, (line) => server.request({ type: "control", place: line || null }));
    this.events = new AddressForm("udp", "addresses", settings, (address) => {
      const [host, port] = hostAndPort(address);
      return server.request({ type: "listen", host, port });
    });
    this.source = new AddressForm("numbers", "sources", settings, (source) => server.request({ type: "read_source", source }));
    part("numbers-look", HTMLButtonElement).onclick = () => {
      write(part("numbers-about", HTMLElement), "Reading for two seconds …");
      server.request({ type: "preview_source", source: this.source.address }).then(() => this.source.refuse(null), (error) => {
        write(part("numbers-about", HTMLElement), "");
        this.source.refuse(error.message);
      });
    };
    const falls = part("numbers-falls", HTMLInputElement);
    falls.onchange = () => this.state(this.source.input.value, falls.checked);
    this.source.input.oninput = () => this.showSource();
    const name = part("layout-name", HTMLInputElement);
    part("layout-save", HTMLButtonElement).onclick = () => {
      if (!name.value.trim()) return name.focus();
      server.request({ type: "save_layout", source: this.source.address, name: name.value.trim() }).then(() => this.source.refuse(null), (error) => this.source.refuse(error.message));
    };
    const drop = part("control-drop", HTMLButtonElement);
    drop.onclick = () => server.request({ type: "control", place: null }).then(() => this.line.refuse(null), failed);
    part("places-again", HTMLButtonElement).onclick = () => this.look();
    const where = part("where", HTMLDetailsElement);
    where.ontoggle = () => where.open && this.look();
    const delta = part("delta-intensity", HTMLInputElement);
    delta.onchange = () =>
      server.request({ type: "delta_intensity", on: delta.checked }).catch((error) => {
        delta.checked = !delta.checked;
        failed(error);
      });
  }

  /** States whether the values of a source are turned. @param {string} source @param {boolean} falls */
  state(source, falls) {
    const others = source.split(",").filter((key) => !key.startsWith("falls="));
    this.source.input.value = [...others, ...(falls ? ["falls=true"] : [])].join(",");
    this.showSource();
  }

  /** Reads the source that runs anew with turned values. @param {string} source */
  turn(source) {
    this.state(source, true);
    return this.server.request({ type: "read_source", source: this.source.address });
  }

  /** Ticks "Invert values" as the source says, and shows the command that reads the same. */
  showSource() {
    const source = this.source.address;
    entitle(this.source.input, "title", source);
    part("numbers-falls", HTMLInputElement).checked = /,falls=(?!false)/.test(source);
    const command = part("numbers-command", HTMLElement);
    command.hidden = !source;
    write(part("numbers-shell", HTMLElement), `taxel live --panel --source ${quoted(source)}`);
    write(part("layout-saved", HTMLElement), "");
  }

  /** Shows what arrives from a source, and what it seems to be. @param {SourcePreview} preview */
  preview({ lines, source, about }) {
    const list = part("numbers-lines", HTMLElement);
    list.replaceChildren(...lines.map((line) => make("li", {}, line)));
    list.hidden = !lines.length;
    write(part("numbers-about", HTMLElement), about);
    this.source.input.value = source;
    this.showSource();
  }

  /** A layout file was written. @param {import("./messages.js").LayoutSaved} saved */
  saved({ name, command }) {
    part("numbers-command", HTMLElement).hidden = false;
    write(part("numbers-shell", HTMLElement), command);
    write(part("layout-saved", HTMLElement), `Saved in ${name}, which the command reads.`);
  }

  /** Asks which ports and addresses there are. */
  look() {
    this.server.send({ type: "places" });
  }

  /** @param {Hello} hello */
  greet({ live, options, udp, lines, source, sources: [, ...others], control, delta_intensity }) {
    const where = part("where", HTMLDetailsElement);
    where.hidden = !live;
    // Without a line there is something to choose.
    if (live && control === null) where.open = true;
    if (live && where.open) this.look();
    this.udp = udp ?? "";
    this.line.at(control);
    this.events.at(udp);
    // Without a source of lines, the one that was used last can be chosen again.
    if (!this.source.input.value) this.source.at(source ?? this.source.before[0] ?? null);
    this.showSource();
    part("numbers-others", HTMLElement).hidden = !others.length;
    write(part("numbers-others", HTMLElement), `Only recorded, not shown and without a readout: ${others.join(", ")}.`);
    part("control-drop", HTMLButtonElement).disabled = control === null;
    part("delta-intensity", HTMLInputElement).checked = delta_intensity ?? false;
    const stated = Object.entries(options ?? {}).filter(([, value]) => value !== null && String(value) !== "");
    part("session-options", HTMLElement).replaceChildren(...stated.map(([name, value]) => make("li", {}, `${name}: ${value}`)));
    write(part("where-info", HTMLElement), lines ?? control ?? "no control line");
  }

  /** @param {Places} places */
  offer({ serial, addresses }) {
    const ports = serial.map((port) => ({ address: port.place, text: [port.place, described(port)].filter(Boolean).join(" · ") }));
    this.line.offer([{ label: "Serial ports", choices: ports }], "no serial port found: type the port below");
    const sources = ports.map(({ address, text }) => ({ address: `serial:${address}`, text }));
    this.source.offer([{ label: "Serial ports", choices: sources }], "no serial port found: type the source below");
    const port = hostAndPort(this.udp)[1] || 5208;
    const each = addresses.map(({ host, name }) => ({ address: `${host}:${port}`, text: `${host}:${port} · ${name}` }));
    const all = { address: `0.0.0.0:${port}`, text: `0.0.0.0:${port} · every address` };
    this.events.offer([{ label: "This machine", choices: [all, ...each] }], "type an address below");
  }

  /** @param {string} text a line from the board */
  log(text) {
    const lines = part("board-lines", HTMLElement);
    lines.append(make("li", {}, text));
    while (lines.children.length > MOST_LINES) lines.firstElementChild?.remove();
    lines.scrollTop = lines.scrollHeight;
    part("no-lines", HTMLElement).hidden = true;
  }
}

/** @param {Port} port @returns {string} description of a port */
function described({ kind, product, maker, serial }) {
  return [product, maker, serial].filter(Boolean).join(", ") || (kind === "other" ? "" : kind);
}

/** @param {string} word @returns {string} as it is typed in a shell */
const quoted = (word) => (/^[\w@%+=:,./-]+$/.test(word) ? word : `'${word.replaceAll("'", `'"'"'`)}'`);

/** @param {string} text @returns {[string, number]} host and port; an address in brackets may hold colons */
function hostAndPort(text) {
  const at = text.trim().lastIndexOf(":");
  const host = at < 0 ? "" : text.trim().slice(0, at).replace(/^\[|\]$/g, "");
  return [host || "127.0.0.1", Number(text.trim().slice(at + 1))];
}
