// Where a view is in time: play, hold, step, seek, follow.

import { part, write } from "./dom.js";
import { seconds, short } from "./words.js";

/** @typedef {import("./messages.js").Transport} Transport */
/** @typedef {import("./server.js").Server} Server */

/** Transport's buttons and the requests behind them. One seek is under way at a time; of later ones the last counts. */
export class Player {
  /** @param {Server} server */
  constructor(server) {
    this.server = server;
    /** @type {Transport} */
    this.transport = { type: "transport", source: null, state: "paused", speed: 1, t_us: null };
    this.live = false;
    /** @type {[number, number] | null} from and to where this view can go, us */
    this.reach = null;
    /** @type {number | null} */
    this.t_us = null;
    this.seeking = false;
    /** @type {number | null} */
    this.wanted = null;
    /** @type {number | null} */
    this.asked = null;
    this.speed = part("speed", HTMLSelectElement);
    part("play", HTMLButtonElement).onclick = () => this.toggle();
    part("step-back", HTMLButtonElement).onclick = () => this.step(-1);
    part("step-on", HTMLButtonElement).onclick = () => this.step(1);
    part("go-live", HTMLButtonElement).onclick = () => this.follow();
    this.speed.onchange = () => {
      if (this.transport.state === "playing") this.play();
    };
    this.show();
  }

  /** @param {Transport} transport */
  take(transport) {
    this.transport = transport;
    if (transport.t_us !== null) this.t_us = transport.t_us;
    this.show();
  }

  /** Shows what can be done. */
  show() {
    const { state, source } = this.transport;
    const moving = state !== "paused";
    const play = part("play", HTMLButtonElement);
    play.setAttribute("aria-label", moving ? "Pause" : "Play");
    play.dataset.state = state;
    const anything = this.live || source !== null;
    for (const id of ["play", "step-back", "step-on"]) part(id, HTMLButtonElement).disabled = !anything;
    const live = part("go-live", HTMLButtonElement);
    live.hidden = !this.live;
    live.setAttribute("aria-pressed", String(state === "following"));
  }

  /** Writes the clock. */
  write() {
    const { state, source, speed } = this.transport;
    // At rest to the microsecond, as stamps of the board are less than a millisecond apart.
    write(part("clock", HTMLElement), seconds(this.t_us, state === "paused" ? 6 : 3));
    let text = "";
    if (source === null && state !== "following" && this.reach && this.t_us !== null) text = `${short(Math.max(0, this.reach[1] - this.t_us))} behind`;
    else if (source !== null && this.reach) text = `of ${seconds(this.reach[1])}`;
    if (state === "playing" && speed !== 1) text += ` · × ${speed}`;
    write(part("clock-more", HTMLElement), text);
  }

  toggle() {
    if (this.transport.state === "paused") this.play();
    else this.server.ask({ type: "pause" });
  }

  play() {
    this.server.ask({ type: "play", speed: Number(this.speed.value) });
  }

  /** @param {number} frames */
  step(frames) {
    this.server.ask({ type: "step", frames });
  }

  follow() {
    this.server.ask({ type: "live" });
  }

  /** @param {number} by to the next (1) or the one before (-1) of the speeds */
  faster(by) {
    const at = this.speed.selectedIndex + by;
    if (at < 0 || at >= this.speed.options.length) return;
    this.speed.selectedIndex = at;
    this.speed.dispatchEvent(new Event("change"));
  }

  /** @returns {number | null} us: where the view will be when what was asked for is done */
  get targetTime() {
    return this.seeking ? this.asked : this.t_us;
  }

  /** @param {number} t_us */
  seek(t_us) {
    const [from, to] = this.reach ?? [t_us, t_us];
    this.asked = this.wanted = Math.round(Math.max(from, Math.min(to, t_us)));
    if (!this.seeking) this.seekNext();
  }

  async seekNext() {
    this.seeking = true;
    while (this.wanted !== null) {
      const t_us = this.wanted;
      this.wanted = null;
      await this.server.ask({ type: "seek", t_us });
    }
    this.seeking = false;
  }
}
