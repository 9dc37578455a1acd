// A decoded run of the replay: values at rows, and interpolated pictures between them.
import { unwrapped, unwrappedBeside } from "./channels";
import { type Columns, rowAt, unpack, wrapped } from "./data";
import type { Picture } from "./figure";
import { Moment } from "./moment";
import { CHANNELS, type Run } from "./types";

export class Flight {
  readonly time: Float64Array;

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
    if (!CHANNELS[channel].angle) return values;
    return side === "measured" ? unwrapped(values) : unwrappedBeside(values, this.list("measured")[channel]);
  }

  /** Measured minus simulated; angle differences are wrapped. */
  residual(channel: number): Float64Array {
    const [measured, simulated] = [this.list("measured")[channel], this.list("simulated")[channel]];
    return measured.map((value, k) => (CHANNELS[channel].angle ? wrapped(value - simulated[k]) : value - simulated[k]));
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
