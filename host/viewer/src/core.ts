// The core in the page, see host/viewer/wasm/src/page.rs.
import bytes from "core.wasm";
import { Layout } from "./layout";
import type { FlyData } from "./types";

export interface Exports {
  memory: WebAssembly.Memory;
  setup_numbers(): number;
  setup_length(): number;
  frame_length(): number;
  begin(start: number): void;
  command(control: number, share: number): void;
  can_hold(): number;
  hold(on: number): void;
  tilt(): number;
  joint(segment: number, axis: number, angle: number): void;
  muscle(pitch: number, yaw: number, roll: number): void;
  tension(share: number): void;
  is_on_ground(): number;
  damping(pitch: number, yaw: number, roll: number): void;
  step(count: number): void;
  see(): number;
  model_numbers(): number;
  start_numbers(): number;
  row_numbers(): number;
  change_body(massFactor: number, areaFactor: number, withoutInputs: number): void;
  change_joint(index: number, by: number, from: number, to: number): number;
  begin_changed(asPublished: number): void;
  push_row(): number;
  finish_changed(): void;
  see_changed(): number;
  frame_changed(): number;
}

/** Starts an instance of the core. */
export function core(): Exports {
  return new WebAssembly.Instance(new WebAssembly.Module(bytes as BufferSource)).exports as unknown as Exports;
}

export class Core {
  readonly exports: Exports;
  readonly layout: Layout;

  constructor(data: FlyData) {
    this.layout = new Layout(data);
    this.exports = core();
    if (this.exports.setup_length() !== data.setup.length) {
      throw new Error("The page and its data are of different versions: create the page again with bodyflight fly.");
    }
    new Float32Array(this.exports.memory.buffer, this.exports.setup_numbers(), data.setup.length).set(data.setup);
  }

  /** Copies the current frame. */
  frame(): Float32Array {
    return new Float32Array(this.exports.memory.buffer, this.exports.see(), this.exports.frame_length()).slice();
  }
}
