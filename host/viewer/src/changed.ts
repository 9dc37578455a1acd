// A recorded flight simulated again with changes, by the core in the page: see host/viewer/wasm/src/what_if.rs.
import { core, type Exports } from "./core";
import { type Columns, rowAt } from "./data";
import type { Pose, Quaternion, Segments, Vector } from "./figure";
import type { Flight } from "./flight";
import { CHANNELS, type ModelNumbers, type Shape } from "./types";

/** A change of a joint: its index in the angles of the run, by how much (rad), and when (s), always if null. */
export interface JointChange {
  index: number;
  by: number;
  window: [number, number] | null;
}

export interface Changes {
  joints: JointChange[];
  massFactor: number;
  areaFactor: number;
  withoutInputs: boolean;
}

/** Numbers of a row before its posture, and of what is seen, see the core. */
const [HEAD, SEEN] = [7, 15];
/** Numbers of a segment in a frame, see frame.rs; segments are the last part of a frame. */
const EACH = 14;
/** Components of velocity (m/s) and rate (rad/s) beyond which the simulation diverges, as in the program. */
const [FAST, SPIN] = [400, 100];

/** The flight with changes, at the rows of the flight shown. */
export class ChangedFlight {
  /** Channels of all rows, in the order of CHANNELS. */
  readonly channels: Float64Array[];
  readonly positions: Vector[] = [];
  readonly attitudes: Quaternion[] = [];
  /** Means over all frames of turn rate (rad/s) and fall rate (m/s), without and with the changes. */
  turn: [number, number] = [0, 0];
  fall: [number, number] = [0, 0];
  /** Time at which the simulation diverges (s). */
  diverged: number | null = null;
  private readonly frames: Float32Array[] = [];
  private readonly time: Float64Array;

  constructor(
    flight: Flight,
    private readonly shapes: Shape[],
  ) {
    this.time = flight.time;
    this.channels = CHANNELS.map(() => new Float64Array(this.time.length).fill(NaN));
  }

  /** What is drawn at a time. */
  at(time: number): { pose: Pose; segments: Segments } {
    const row = rowAt(this.time, time);
    const frame = this.frames[row];
    const part = <V>(segment: number, from: number, count: number) => {
      const begin = frame.length - EACH * (this.shapes.length - segment) + from;
      return [...frame.subarray(begin, begin + count)] as V;
    };
    const each = <V>(from: number, count: number) => this.shapes.map((_, k) => part<V>(k, from, count));
    return {
      pose: { position: this.positions[row], attitude: this.attitudes[row] },
      segments: { attitude: each(4, 4), cg: each(8, 3), force: each(11, 3) },
    };
  }

  /** Takes a row of the flight shown. */
  take(row: number, seen: Float64Array, frame: Float32Array): void {
    for (const [k, list] of this.channels.entries()) list[row] = seen[1 + k];
    this.positions[row] = [...seen.subarray(8, 11)] as Vector;
    this.attitudes[row] = [...seen.subarray(11, 15)] as Quaternion;
    this.frames[row] = frame;
  }
}

/** Simulates flights again with changes. */
export class Simulator {
  private readonly exports: Exports = core();

  constructor(
    private readonly flight: Flight,
    private readonly full: Columns,
    private readonly model: ModelNumbers,
  ) {}

  /** A view of the core's memory, which may have grown since. */
  private numbers(at: number, length: number): Float64Array {
    return new Float64Array(this.exports.memory.buffer, at, length);
  }

  run({ joints, massFactor, areaFactor, withoutInputs }: Changes): ChangedFlight {
    const { exports, flight, model } = this;
    this.numbers(exports.model_numbers(), model.setup.length).set(model.setup);
    this.numbers(exports.start_numbers(), model.start.length).set(model.start);
    exports.change_body(massFactor, areaFactor, withoutInputs ? 1 : 0);
    for (const { index, by, window } of joints) exports.change_joint(index, by, window?.[0] ?? 0, window?.[1] ?? 0);
    exports.begin_changed(model.as_published ? 1 : 0);
    const made = new ChangedFlight(flight, flight.run.shapes);
    const list = (name: string) => this.full.get(name) ?? [];
    const [[times], inputs, postures] = [list("time_s"), list("inputs"), list("postures")];
    const simulated = list("simulated");
    /** Row of the flight shown that is due. */
    let due = 0;
    const see = (row: number) => {
      const seen = this.numbers(exports.see_changed(), SEEN);
      // The first row is that with which both begin.
      if (row > 0) {
        made.turn[0] += simulated[3][row] / (times.length - 1);
        made.turn[1] += seen[4] / (times.length - 1);
        made.fall[0] -= simulated[6][row] / (times.length - 1);
        made.fall[1] -= seen[7] / (times.length - 1);
      }
      const isPlausible = Math.abs(seen[7]) < FAST && seen[6] < FAST && seen[5] < SPIN;
      if (!isPlausible && made.diverged === null) made.diverged = times[row];
      // Times of the rows shown are rounded.
      while (due < flight.time.length && flight.time[due] <= times[row] + 1e-3) {
        const at = exports.frame_changed();
        const frame = new Float32Array(exports.memory.buffer, at, exports.frame_length()).slice();
        made.take(due, this.numbers(exports.see_changed(), SEEN), frame);
        due += 1;
      }
    };
    const row = this.numbers(exports.row_numbers(), HEAD + postures.length);
    for (let k = 0; k < times.length && made.diverged === null; k++) {
      row[0] = times[k];
      for (let n = 0; n < inputs.length; n++) row[1 + n] = inputs[n][k];
      for (let n = 0; n < postures.length; n++) row[HEAD + n] = postures[n][k];
      if (exports.push_row()) see(k - 1);
    }
    if (made.diverged === null) {
      exports.finish_changed();
      see(times.length - 1);
    }
    return made;
  }
}
