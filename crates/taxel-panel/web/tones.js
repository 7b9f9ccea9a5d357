// Tones of the countdown: low for each second, a high one at the start, as the manual's program plays them.

const LOW_HZ = 440;
const HIGH_HZ = 880;
const STOP_HZ = 330;

/** Plays a tone, 0.12 s long (0.35 s the high one), through a context of its own or one for tests. */
export class Tones {
  constructor() {
    /** @type {AudioContext | null} */
    this.context = null;
    this.enabled = true;
  }

  /** Browsers let a page sound only after a person has done something: called from every key and click. */
  wake() {
    if (!this.enabled) return;
    this.context ??= new AudioContext();
    if (this.context.state === "suspended") this.context.resume().catch(() => {});
  }

  second() {
    this.play(LOW_HZ, 0.12);
  }

  start() {
    this.play(HIGH_HZ, 0.35);
  }

  stop() {
    this.play(STOP_HZ, 0.2);
  }

  /** @param {number} hz @param {number} length_s */
  play(hz, length_s) {
    if (this.enabled && this.context?.state === "running") sound(this.context, hz, length_s);
  }
}

/**
 * A sine with soft edges, as a hard one clicks.
 * @param {BaseAudioContext} context
 * @param {number} hz
 * @param {number} length_s
 */
export function sound(context, hz, length_s) {
  const [oscillator, gain] = [context.createOscillator(), context.createGain()];
  const now = context.currentTime;
  oscillator.frequency.value = hz;
  gain.gain.setValueAtTime(0, now);
  gain.gain.linearRampToValueAtTime(0.2, now + 0.01);
  gain.gain.setValueAtTime(0.2, now + length_s - 0.03);
  gain.gain.linearRampToValueAtTime(0, now + length_s);
  oscillator.connect(gain).connect(context.destination);
  oscillator.start(now);
  oscillator.stop(now + length_s);
}
