// What a live stream has shown so far, to plot and to scroll back.
import type { PlotSpec } from "./plots";
import type { Live } from "./types";

/** Looks that are kept. */
const KEPT = 30 * 60 * 10;
const STATES = ["muscle pitch", "muscle yaw", "muscle roll", "damping pitch", "damping yaw", "damping roll"];
/** Time over which the rate of looks is taken (ms). */
const RATE_SPAN = 2000;

export class LiveHistory {
  readonly looks: Live[] = [];
  readonly frames: Float32Array[] = [];
  private readonly latency: number[] = [];
  private readonly states = STATES.map(() => ({ value: [] as number[], spread: [] as number[] }));
  private arrived: number[] = [];

  takeFrame(frame: Float32Array): void {
    this.frames.push(frame);
  }

  take(look: Live): void {
    if (this.looks.length >= KEPT) this.forgetFirst();
    this.looks.push(look);
    this.latency.push(look.latency_ms ?? NaN);
    for (const [k, list] of this.states.entries()) {
      const value = look.estimate?.state[k] ?? NaN;
      const sigma = Math.sqrt(look.estimate?.variance[k] ?? NaN);
      list.value.push(value);
      list.spread.push(2 * sigma);
    }
    const now = performance.now();
    this.arrived = [...this.arrived.filter((moment) => now - moment < RATE_SPAN), now];
  }

  /** Looks a second, lately. */
  get rate(): number {
    return this.arrived.length / (RATE_SPAN / 1000);
  }

  get time(): Float64Array<ArrayBuffer> {
    return Float64Array.from(this.looks, (look) => look.time_s);
  }

  /** Plots of all that is kept; their lists grow with it. */
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
    return [latency, ...states];
  }

  private forgetFirst(): void {
    const lists = this.states.flatMap(({ value, spread }) => [value, spread]);
    for (const list of [this.looks, this.frames, this.latency, ...lists]) list.shift();
  }
}
