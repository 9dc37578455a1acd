// A decoded run of the replay: values at rows, and interpolated pictures between them.
import { unwrapped, unwrappedBeside } from "./channels";
import { type Columns, rowAt, unpack, wrapped } from "./data";
import { between, type Picture, type Quaternion, type Vector } from "./figure";
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
    const from = this.row(time);
    const to = Math.min(from + 1, this.time.length - 1);
    const share =
      to === from ? 0 : Math.max(0, Math.min(1, (time - this.time[from]) / (this.time[to] - this.time[from])));
    const vector = (name: string, place = 0) =>
      [0, 1, 2].map((k) => {
        const numbers = this.list(name)[place + k];
        return numbers[from] + (numbers[to] - numbers[from]) * share;
      }) as Vector;
    const quaternion = (name: string, place = 0) => {
      const at = (row: number) => [0, 1, 2, 3].map((k) => this.list(name)[place + k][row]) as Quaternion;
      return between(at(from), at(to), share);
    };
    const each = <V>(value: (segment: number) => V) => this.run.shapes.map((_, segment) => value(segment));
    return {
      simulated: { position: vector("simulated_position_m"), attitude: quaternion("simulated_attitude") },
      measured: { position: vector("measured_position_m"), attitude: quaternion("measured_attitude") },
      segments: {
        attitude: each((k) => quaternion("segment_attitude", 4 * k)),
        cg: each((k) => vector("segment_cg_m", 3 * k)),
        force: each((k) => vector("segment_force_n", 3 * k)),
      },
      cg: vector("cg_m"),
      wind: this.run.air_velocity_mps,
    };
  }
}
