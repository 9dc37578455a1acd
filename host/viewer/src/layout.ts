// Layout of a frame, see host/viewer/wasm/src/frame.rs.

import type { Picture, Quaternion, Vector } from "./figure";
import type { FlyData } from "./types";

export class Layout {
  private readonly places = new Map<string, [number, number]>();
  private readonly segmentPlaces = new Map<string, number>();
  private readonly segmentNumbers: number;

  constructor(private readonly data: FlyData) {
    let next = 0;
    for (const [name, count] of data.layout) {
      this.places.set(name, [next, count]);
      next += count;
    }
    let within = 0;
    for (const [name, count] of data.segment_layout) {
      this.segmentPlaces.set(name, within);
      within += count;
    }
    this.segmentNumbers = within;
  }

  part(frame: Float32Array, name: string): Float32Array {
    const [from, count] = this.places.get(name) ?? [0, 0];
    return frame.subarray(from, from + count);
  }

  picture(frame: Float32Array): Picture {
    const vector = (name: string) => [...this.part(frame, name)] as Vector;
    const segments = this.part(frame, "segments");
    const each = <V>(name: string, count: number) =>
      this.data.shapes.map((_, k) => {
        const from = k * this.segmentNumbers + (this.segmentPlaces.get(name) ?? 0);
        return [...segments.subarray(from, from + count)] as V;
      });
    return {
      simulated: {
        position: vector("position_m"),
        attitude: [...this.part(frame, "inertial_from_body")] as Quaternion,
      },
      measured: this.places.has("measured_attitude")
        ? {
            position: vector("measured_position_m"),
            attitude: [...this.part(frame, "measured_attitude")] as Quaternion,
          }
        : null,
      segments: { attitude: each("body_from_segment", 4), cg: each("cg_m", 3), force: each("force_n", 3) },
      cg: vector("cg_m"),
      wind: vector("air_velocity_mps"),
    };
  }
}
