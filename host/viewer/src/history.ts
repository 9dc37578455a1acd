// History of a live stream, for plots and for looking back.
import { asShown, sense } from "./channels";
import type { Layout } from "./layout";
import type { PlotSpec } from "./plots";
import { CHANNELS, type Look } from "./types";

/** Number of looks kept. */
const KEPT = 30 * 60 * 10;
const STATES = ["muscle pitch", "muscle yaw", "muscle roll", "damping pitch", "damping yaw", "damping roll"];
/** Averaging time for the rate of looks (ms). */
const RATE_SPAN = 2000;

/** Channels shown for both bodies, as indices into CHANNELS. */
const SHOWN = [2, 1, 0, 5, 6];

export class LiveHistory {
  readonly looks: Look[] = [];
  readonly frames: Float32Array[] = [];
  private readonly latency: number[] = [];
  private readonly bodies = SHOWN.map(() => ({ measured: [] as number[], simulated: [] as number[] }));
  private readonly states = STATES.map(() => ({ value: [] as number[], spread: [] as number[] }));
  private arrived: number[] = [];

  takeFrame(frame: Float32Array): void {
    this.frames.push(frame);
  }

  constructor(private readonly layout: Layout) {}

  take(look: Look): void {
    if (this.looks.length >= KEPT) this.forgetFirst();
    this.looks.push(look);
    this.latency.push(look.stream?.latency_ms ?? NaN);
    const frame = this.frames[this.frames.length - 1];
    for (const [n, { measured, simulated }] of this.bodies.entries()) {
      const value = (part: string) => asShown(SHOWN[n], this.layout.part(frame, part)[SHOWN[n]]);
      measured.push(frame ? value("measured") : NaN);
      simulated.push(frame && look.avatar ? value("observation") : NaN);
    }
    const estimate = look.stream?.estimate;
    for (const [k, list] of this.states.entries()) {
      const value = estimate?.state[k] ?? NaN;
      const sigma = Math.sqrt(estimate?.variance[k] ?? NaN);
      list.value.push(value);
      list.spread.push(2 * sigma);
    }
    const now = performance.now();
    this.arrived = [...this.arrived.filter((moment) => now - moment < RATE_SPAN), now];
  }

  /** Current rate of looks (Hz). */
  get rate(): number {
    return this.arrived.length / (RATE_SPAN / 1000);
  }

  get time(): Float64Array<ArrayBuffer> {
    return Float64Array.from(this.looks, (look) => look.time_s);
  }

  /** Plots of the history. They share its lists, which grow. */
  specs(): PlotSpec[] {
    const latency: PlotSpec = {
      key: "latency",
      title: "latency",
      unit: "ms",
      lines: [{ label: "sample to estimate", ink: "measured", values: this.latency }],
    };
    const states = STATES.map((name, k): PlotSpec => {
      const { value, spread } = this.states[k];
      return {
        key: name,
        title: name,
        unit: "1",
        lines: [{ label: "estimate", ink: "simulated", values: value, spread }],
      };
    });
    const bodies = SHOWN.map((k, n): PlotSpec => {
      const { key, label: title, unit } = CHANNELS[k];
      const { measured, simulated } = this.bodies[n];
      return {
        key,
        title,
        unit,
        note: sense(k),
        lines: [
          { label: "measured", ink: "measured", values: measured },
          { label: "simulated", ink: "simulated", dash: [6, 3], values: simulated },
        ],
      };
    });
    const isUnit = this.looks.some((look) => look.stream);
    return isUnit ? [...bodies, latency, ...states] : bodies;
  }

  private forgetFirst(): void {
    const lists = [
      ...this.states.flatMap(({ value, spread }) => [value, spread]),
      ...this.bodies.flatMap(({ measured, simulated }) => [measured, simulated]),
    ];
    for (const list of [this.looks, this.frames, this.latency, ...lists]) list.shift();
  }
}
