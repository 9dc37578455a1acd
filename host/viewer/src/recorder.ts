// Records a flight, and saves it by the program that opened the page.

import { button, element, save } from "./dom";
import type { FlyData } from "./types";

export class Recorder {
  readonly button: HTMLButtonElement;
  readonly message = element("span", { id: "message", role: "status" });
  /** The frames so far; null while nothing is recorded. */
  private frames: Float32Array[] | null = null;

  constructor(private readonly layout: FlyData["layout"]) {
    this.button = button("record", "Record the flight; again to save it", () => {
      if (this.frames) this.finish(this.frames);
      else this.start();
    });
  }

  /** Frames recorded; null while nothing is. */
  get length(): number | null {
    return this.frames?.length ?? null;
  }

  /** Takes a frame, while the flight is recorded. */
  take(frame: () => Float32Array): void {
    this.frames?.push(frame());
  }

  /** The flight begins anew, and its recording with it. */
  restart(): void {
    if (this.frames) this.frames = [];
  }

  private start(): void {
    this.frames = [];
    this.button.setAttribute("aria-pressed", "true");
    this.button.textContent = "save";
  }

  private finish(frames: Float32Array[]): void {
    this.frames = null;
    this.button.removeAttribute("aria-pressed");
    this.button.textContent = "record";
    if (frames.length < 2) return;
    // To the program that opened the page, which writes a recording; where there is none, as numbers.
    if (location.protocol === "http:") this.send(frames);
    else this.saveNumbers(frames);
  }

  private send(frames: Float32Array[]): void {
    const all = new Float32Array(frames.length * frames[0].length);
    for (const [k, frame] of frames.entries()) all.set(frame, k * frame.length);
    const socket = new WebSocket(`ws://${location.host}${location.pathname}socket`);
    socket.binaryType = "arraybuffer";
    socket.onopen = () => socket.send(all.buffer);
    socket.onmessage = (event) => {
      this.message.textContent = String(event.data);
      socket.close();
    };
    socket.onerror = () => {
      this.message.textContent = "The program that opened this page has ended: the flight is not saved.";
    };
  }

  private saveNumbers(frames: Float32Array[]): void {
    const names = this.layout.flatMap(([name, count]) =>
      count === 1 ? [name] : Array.from({ length: count }, (_, k) => `${name}_${k}`),
    );
    const rows = frames.map((frame) => [...frame].join(","));
    save("flight.csv", new Blob([[names.join(","), ...rows, ""].join("\n")], { type: "text/csv" }));
    this.message.textContent = "Saved as numbers; bodyflight fly writes a recording that every verb reads.";
  }
}
