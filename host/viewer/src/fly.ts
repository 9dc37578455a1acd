// Fly: keys move the joints while the core simulates the flight in the page.
import { Core } from "./core";
import { button, element, toggle } from "./dom";
import { help, type Keys } from "./help";
import { Instruments, reading } from "./instruments";
import { KEYS, Keyboard, keyList } from "./keyboard";
import { pads } from "./pads";
import { Pilot } from "./pilot";
import { Recorder } from "./recorder";
import { provenance, shell } from "./shell";
import { Stage } from "./stage";
import { written } from "./ticks";
import { Traces } from "./traces";
import type { FlyData, PageData } from "./types";

const RATE = 240;
const FLY_KEYS: Keys = [
  ["shift", "with another key: half the movement"],
  ["I K  U O  J L", "muscle input: pitch, yaw, roll"],
  ["H", "autopilot"],
  ["space", "pause and resume"],
  ["0", "restart"],
];

export function fly(data: PageData, flight: FlyData): void {
  const flown = new Fly(data, flight);
  window.bodyflight = { core: flown.core, flight };
  document.documentElement.dataset.ready = "fly";
  flown.run();
}

/** The page for flying by keyboard. */
class Fly {
  readonly core: Core;
  private readonly stage: Stage;
  private readonly instruments = new Instruments();
  private readonly cost = element("span", { class: "faint", id: "cost" });
  private readonly recorder: Recorder;
  private readonly traces: Traces;
  private readonly keyboard: Keyboard;
  private readonly pilot: Pilot;
  /** Index of the selected start. */
  private start = 0;
  private running = true;
  /** Simulation steps that are due. */
  private owed = 0;

  constructor(
    data: PageData,
    private readonly flight: FlyData,
  ) {
    const { header, main, aside, footer } = shell(data);
    this.core = new Core(flight);
    this.stage = new Stage(main, flight, false);
    main.append(this.instruments.place);
    this.recorder = new Recorder(flight.layout);
    this.pilot = new Pilot(this.core);
    header.append(
      this.starts(),
      this.pilot.switch,
      button("restart", "Restart the flight (0)", () => this.begin()),
      button("pause", "Pause or resume (space)", () => this.pause()),
      this.recorder.button,
      this.recorder.message,
      this.pilot.message,
    );
    footer.append(
      element("span", { class: "faint" }, "Hold a key. Shift: half the movement."),
      element("span", { style: "flex:1" }),
      this.cost,
    );
    aside.append(keyList());
    this.traces = new Traces(aside);
    aside.append(joints(this.core, flight), damping(this.core), provenance(data));
    this.keyboard = new Keyboard(this.core, flight.controls, {
      " ": () => this.pause(),
      "0": () => this.begin(),
      h: () => this.pilot.flip(),
    });
    const thumbs = pads(this.keyboard);
    main.append(thumbs);
    header.append(toggle("touch", "Touch controls", !thumbs.hidden, (on) => (thumbs.hidden = !on)));
    header.append(help(["Hold", KEYS.map(({ key, does }) => [key.toUpperCase(), does])], ["Press", FLY_KEYS]));
  }

  run(): void {
    this.begin();
    let before = performance.now();
    const next = (now: number) => {
      const passed = now - before;
      before = now;
      if (this.running) this.step(passed);
      this.show(passed);
      requestAnimationFrame(next);
    };
    requestAnimationFrame(next);
  }

  private begin(): void {
    this.core.exports.begin(this.start);
    this.pilot.apply();
    this.keyboard.clear();
    this.traces.clear();
    this.recorder.restart();
  }

  private pause(): void {
    this.running = !this.running;
  }

  private starts(): HTMLElement {
    const starts = element(
      "select",
      { id: "start", "aria-label": "initial pose" },
      ...this.flight.starts.map((name, k) => element("option", { value: String(k) }, name)),
    );
    starts.addEventListener("change", () => {
      this.start = Number(starts.value);
      this.begin();
      starts.blur();
    });
    return starts;
  }

  /** Advances the simulation by the elapsed time (ms). */
  private step(passed: number): void {
    // A page in the background does not catch up afterwards.
    this.owed += Math.min(passed, 100) * (RATE / 1000);
    while (this.owed >= 1) {
      this.core.exports.step(1);
      this.owed -= 1;
      this.recorder.take(() => this.core.frame());
    }
  }

  private show(passed: number): void {
    const { core, stage } = this;
    const frame = core.frame();
    stage.draw(core.layout.picture(frame));
    const observation = core.layout.part(frame, "observation");
    const now = frame[0];
    const recorded = this.recorder.length;
    const height = core.layout.part(frame, "position_m")[2];
    this.instruments.show(reading(observation), null, [
      `height ${written(height, 0)} m`,
      `${written(now, 1)} s${recorded === null ? "" : `, recorded ${(recorded / RATE).toFixed(1)} s`}`,
    ]);
    this.pilot.say();
    this.cost.textContent = `${passed.toFixed(1)} ms per frame, ${stage.cost.toFixed(1)} ms to draw`;
    if (this.running) this.traces.take(now, observation);
  }
}

declare global {
  interface Window {
    /** For tests. */
    bodyflight?: { core: Core; flight: FlyData };
  }
}

/** Controls for a single joint. */
function joints(core: Core, flight: FlyData): HTMLElement {
  const segment = element(
    "select",
    { "aria-label": "joint" },
    ...flight.shapes.slice(1).map((shape, k) => element("option", { value: String(k + 1) }, shape.name)),
  );
  const sliders = ["psi", "theta", "phi"].map((name, axis) => {
    const slider = element("input", {
      type: "range",
      min: "-1.5",
      max: "1.5",
      step: "0.01",
      value: "0",
      "aria-label": `${name} (rad)`,
    });
    slider.addEventListener("input", () => core.exports.joint(Number(segment.value), axis, Number(slider.value)));
    return element("label", {}, `${name} `, slider);
  });
  return element(
    "section",
    {},
    element("h2", {}, "Single joint"),
    element("div", { class: "joints" }, segment, ...sliders),
  );
}

/** Controls for damping; a novice has little. */
function damping(core: Core): HTMLElement {
  const values = ["pitch", "yaw", "roll"].map((name) => {
    const field = element("input", {
      type: "number",
      min: "-1",
      max: "30",
      step: "0.1",
      "aria-label": `damping ${name}`,
      style: "width:5em",
    });
    return { name, field };
  });
  const read = () =>
    core.exports.damping(...(values.map(({ field }) => Number(field.value)) as [number, number, number]));
  core.exports.begin(0);
  const now = core.layout.part(core.frame(), "damping");
  values.forEach(({ field }, k) => {
    field.value = String(Math.round(now[k] * 100) / 100);
    field.addEventListener("change", read);
  });
  return element(
    "section",
    {},
    element("h2", {}, "Damping coefficients"),
    element("div", { class: "joints" }, ...values.map(({ name, field }) => element("label", {}, `${name} `, field))),
  );
}
