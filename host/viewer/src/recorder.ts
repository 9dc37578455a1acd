// Records a flight and saves it through the program that serves the page.

import { button, element, save } from "./dom";
import type { FlyData } from "./types";

export class Recorder {
  readonly button: HTMLButtonElement;
  readonly message = element("span", { id: "message", role: "status" });
  /** Recorded frames; null when not recording. */
  private frames: Float32Array[] | null = null;

  constructor(private readonly flight: FlyData) {
    this.button = button("record", "Record the flight; click again to save it", () => {
      if (this.frames) this.finish(this.frames);
      else this.start();
    });
  }

  /** Number of recorded frames; null when not recording. */
  get length(): number | null {
    return this.frames?.length ?? null;
  }

  /** Appends a frame if recording. */
  take(frame: () => Float32Array): void {
    this.frames?.push(frame());
  }

  /** Restarts the recording together with the flight. */
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
    // The program that serves the page writes a recording; without it, the flight is saved as CSV.
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
      this.message.textContent = "The program that serves this page has ended: the flight was not saved.";
    };
  }

  private saveNumbers(frames: Float32Array[]): void {
    const { density_kgpm3: density, mass_kg: mass, layout } = this.flight;
    const first = `# bodyflight fly: density_kgpm3=${density}, mass_kg=${mass}`;
    const names = layout.flatMap(([name, count]) =>
      count === 1 ? [name] : Array.from({ length: count }, (_, k) => `${name}_${k}`),
    );
    const rows = frames.map((frame) => [...frame].join(","));
    save("flight.csv", new Blob([[first, names.join(","), ...rows, ""].join("\n")], { type: "text/csv" }));
    this.message.textContent =
      "Saved flight.csv: bodyflight fly --from flight.csv makes a recording of it that every command reads.";
  }
}
