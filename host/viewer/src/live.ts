// Live: follows bodyflight stream --view or mvn listen --view, with a simulated body next to the measured one.

import { button, element } from "./dom";
import { CAMERA_KEYS, help } from "./help";
import { LiveHistory } from "./history";
import { Instruments, reading } from "./instruments";
import { Layout } from "./layout";
import { Plots } from "./plots";
import { provenance, shell } from "./shell";
import { Stage } from "./stage";
import type { FlyData, Look, PageData } from "./types";
import { unitChoice } from "./unit-choice";

/** Interval between updates of the plots (ms), which are slower to draw than the picture. */
const PLOT_INTERVAL = 500;
/** Depth of the drawn ground below the start (m); a stream does not contain the height above ground. */
const GROUND_BELOW = 2000;

export function live(data: PageData): void {
  const view = new LiveView(data, data.fly as FlyData);
  view.listen();
  document.documentElement.dataset.ready = "live";
  view.run();
}

/** The page of a stream. */
class LiveView {
  private readonly layout: Layout;
  private readonly history: LiveHistory;
  private readonly stage: Stage;
  private readonly instruments = new Instruments();
  private readonly numbers = element("dl", { id: "numbers" });
  private readonly state = element("span", { id: "state", role: "status" }, "waiting for the stream");
  private readonly slider = element("input", {
    type: "range",
    min: "0",
    max: "0",
    value: "0",
    "aria-label": "look back",
  });
  private readonly hold: HTMLButtonElement;
  private readonly cost = element("span", { class: "faint", id: "cost" });
  private readonly place = element("div");
  private plots: Plots | null = null;
  private socket: WebSocket | null = null;
  private plotted = 0;
  /** Whether the plots are behind the picture. */
  private unplotted = false;
  /** Index of the look shown. */
  private shown = 0;
  private paused = false;
  private ground: number | null = null;
  private dirty = false;

  constructor(data: PageData, flight: FlyData) {
    const { header, main, aside, footer } = shell(data);
    this.layout = new Layout(flight);
    this.history = new LiveHistory(this.layout);
    this.stage = new Stage(main, flight, true);
    this.stage.listenToKeys();
    this.hold = button("pause", "Pause the picture; the stream continues", () => this.stop(!this.paused));
    this.slider.addEventListener("input", () => {
      this.stop(true);
      this.shown = Number(this.slider.value);
    });
    const again = "Restarts the simulated body from the measured motion";
    header.append(
      this.state,
      element("span", { style: "flex:1" }),
      unitChoice(),
      button("restart", again, () => this.socket?.send(new Uint8Array([1]))),
      help(["Picture", CAMERA_KEYS]),
    );
    main.append(this.instruments.place);
    footer.append(this.hold, this.slider, this.cost);
    aside.append(this.numbers, this.place, provenance(data));
  }

  listen(): void {
    const socket = new WebSocket(`ws://${location.host}${location.pathname}socket`);
    socket.binaryType = "arraybuffer";
    this.socket = socket;
    socket.onopen = () => {
      this.state.textContent = "streaming";
    };
    socket.onclose = () => {
      this.state.textContent = "the stream has ended; look back with the slider";
    };
    socket.onmessage = (event) => {
      if (event.data instanceof ArrayBuffer) {
        this.history.takeFrame(new Float32Array(event.data));
      } else {
        const told = JSON.parse(String(event.data)) as Look | { note: string };
        if ("note" in told) return;
        this.history.take(told);
      }
      this.dirty = true;
    };
  }

  run(): void {
    const next = (now: number) => {
      const last = this.history.looks.length - 1;
      if (this.dirty && last >= 0) {
        this.dirty = false;
        this.slider.max = String(last);
        this.shown = this.paused ? Math.min(this.shown, last) : last;
        this.slider.value = String(this.shown);
        this.show();
      }
      if (this.unplotted && now - this.plotted > PLOT_INTERVAL) this.plot(now);
      requestAnimationFrame(next);
    };
    requestAnimationFrame(next);
  }

  private stop(paused: boolean): void {
    this.paused = paused;
    this.hold.textContent = paused ? "continue" : "pause";
    this.dirty = true;
  }

  private show(): void {
    const { frames, looks, rate } = this.history;
    const look = looks[this.shown];
    const frame = frames[Math.min(this.shown, frames.length - 1)];
    if (frame) {
      const picture = this.layout.picture(frame);
      this.ground ??= picture.simulated.position[2] - GROUND_BELOW;
      this.stage.drawer.ground = this.ground;
      this.stage.draw(picture);
      const measured = reading(this.layout.part(frame, "measured"));
      this.instruments.show(reading(this.layout.part(frame, "observation")), measured, [said(look)]);
    }
    this.numbers.replaceChildren(...rows(look, rate));
    this.cost.textContent = `${this.stage.cost.toFixed(1)} ms to draw`;
    this.unplotted = true;
  }

  private plot(now: number): void {
    this.plotted = now;
    this.unplotted = false;
    const { time, looks } = this.history;
    if (this.plots) this.plots.update(time);
    else if (time.length > 1) this.plots = new Plots({ place: this.place, time, seek: () => {} }, this.history.specs());
    this.plots?.mark(looks[this.shown].time_s);
  }
}

/** Describes the simulated body. */
function said({ time_s, avatar }: Look): string {
  if (!avatar) return "no simulated body: the stream has not sent velocities yet";
  const again = avatar.restarts ? `, restarted ${avatar.restarts === 1 ? "once" : `${avatar.restarts} times`}` : "";
  return `simulated from the postures alone for ${(time_s - avatar.since_s).toFixed(1)} s${again}`;
}

/** Values of a look, as rows of a list. */
function rows({ time_s, stream, received }: Look, rate: number): HTMLElement[] {
  const numbers: [string, string][] = [["time", `${time_s.toFixed(1)} s`]];
  if (received) numbers.push(["frames received", String(received.frames)], ["samples lost", String(received.lost)]);
  if (stream)
    numbers.push(
      ["samples sent", String(stream.sent)],
      ["estimates", String(stream.estimates)],
      ["latency", stream.latency_ms === null ? "none yet" : `${stream.latency_ms.toFixed(2)} ms`],
      ["missing", String(stream.missing)],
      ["dropped", String(stream.dropped)],
      ["deadlines missed", String(stream.deadline_missed)],
      ["NIS", stream.estimate ? stream.estimate.nis.toFixed(2) : ""],
    );
  numbers.push(["frames per second", rate.toFixed(1)]);
  return numbers.flatMap(([name, value]) => [
    element("dt", {}, name),
    element("dd", { id: name.replaceAll(" ", "-") }, value),
  ]);
}
