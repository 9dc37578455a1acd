// A decoded run of the replay: values at rows, and interpolated pictures between them.
import { allAsShown, unwrapped, unwrappedBeside } from "./channels";
import { type Columns, rowAt, unpack, wrapped } from "./data";
import type { Picture } from "./figure";
import { Moment } from "./moment";
import { CHANNELS, type Run } from "./types";

export class Flight {
  readonly time: Float64Array;
  private full: Promise<Columns> | null = null;

  private constructor(
    readonly run: Run,
    readonly columns: Columns,
    /** Estimated inputs, with their own time base. */
    readonly estimated: Columns | null,
  ) {
    this.time = this.list("time_s")[0];
  }

  static async of(run: Run): Promise<Flight> {
    const estimated = run.estimated && (await unpack(run.estimated.series));
    return new Flight(run, await unpack(run.series), estimated);
  }

  list(name: string): Float64Array[] {
    return this.columns.get(name) ?? [];
  }

  get end(): number {
    return this.time[this.time.length - 1];
  }

  row(time: number): number {
    return rowAt(this.time, time);
  }

  /** A channel as plotted, with unwrapped angles. */
  plotted(side: "measured" | "simulated", channel: number): Float64Array {
    const values = this.list(side)[channel];
    return side === "measured" && CHANNELS[channel].angle
      ? allAsShown(channel, unwrapped(values))
      : this.beside(channel, values);
  }

  /** Values of a channel of another flight of the same person as plotted, with angles that begin near the measured one. */
  beside(channel: number, values: Float64Array): Float64Array {
    const near = CHANNELS[channel].angle ? unwrappedBeside(values, this.list("measured")[channel]) : values;
    return allAsShown(channel, near);
  }

  /** Measured minus simulated, as shown; angle differences are wrapped. */
  residual(channel: number): Float64Array {
    const [measured, simulated] = [this.list("measured")[channel], this.list("simulated")[channel]];
    const difference = measured.map((value, k) => value - simulated[k]);
    return allAsShown(channel, CHANNELS[channel].angle ? difference.map(wrapped) : difference);
  }

  /** The data at the rate of the recording, or null if the page has none; unpacked once. */
  atFullRate(): Promise<Columns> | null {
    const full = this.run.full_rate;
    if (full) this.full ??= unpack(full.series);
    return this.full;
  }

  picture(time: number): Picture {
    const now = new Moment(this.columns, time);
    const each = <V>(value: (segment: number) => V) => this.run.shapes.map((_, segment) => value(segment));
    return {
      simulated: { position: now.vector("simulated_position_m"), attitude: now.quaternion("simulated_attitude") },
      measured: { position: now.vector("measured_position_m"), attitude: now.quaternion("measured_attitude") },
      segments: {
        attitude: each((k) => now.quaternion("segment_attitude", 4 * k)),
        cg: each((k) => now.vector("segment_cg_m", 3 * k)),
        force: each((k) => now.vector("segment_force_n", 3 * k)),
      },
      cg: now.vector("cg_m"),
      wind: this.run.air_velocity_mps,
    };
  }
}
