// Plots of the last seconds of a flight.

import { asShown, sense } from "./channels";
import { Plots } from "./plots";
import { CHANNELS } from "./types";

/** Time range of the plots (s), and points per second. */
const SPAN = 20;
const RATE = 30;
/** Channels shown, as indices into CHANNELS. */
const SHOWN = [1, 0, 3, 5, 6];

export class Traces {
  private readonly time = new Float64Array(SPAN * RATE);
  private readonly lines = SHOWN.map(() => new Float64Array(SPAN * RATE).fill(NaN));
  private readonly plots: Plots;
  private drawn = 0;

  constructor(place: HTMLElement) {
    const specs = SHOWN.map((k, n) => ({
      key: CHANNELS[k].key,
      title: CHANNELS[k].label,
      note: sense(k),
      unit: CHANNELS[k].unit,
      lines: [{ label: "flown", ink: "simulated", values: this.lines[n] }],
    }));
    this.plots = new Plots({ place, time: this.time, seek: () => {} }, specs);
  }

  clear(): void {
    for (const line of this.lines) line.fill(NaN);
    for (const k of this.time.keys()) this.time[k] = k / RATE - SPAN;
  }

  /** Appends the channels at a time, if a point is due. */
  take(time: number, channels: ArrayLike<number>): void {
    if (time - this.drawn <= 1 / RATE && time >= this.drawn) return;
    this.drawn = time;
    push(this.time, time);
    for (const [n, k] of SHOWN.entries()) push(this.lines[n], asShown(k, channels[k]));
    this.plots.update();
    this.plots.mark(time);
  }
}

/** Shifts a list by one and appends a value. */
function push(list: Float64Array, value: number): void {
  list.copyWithin(0, 1);
  list[list.length - 1] = value;
}
