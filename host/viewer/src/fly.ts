// Fly: keys move the joints while the core simulates the flight in the page.
import { Core } from "./core";
import { button, element, toggle } from "./dom";
import { Gamepads, PAD_KEYS } from "./gamepad";
import { Ground } from "./ground";
import { help, type Keys } from "./help";
import { Instruments, reading } from "./instruments";
import { KEYS, Keyboard, keyList } from "./keyboard";
import { pads } from "./pads";
import { Pilot } from "./pilot";
import { Recorder } from "./recorder";
import { provenance, shell } from "./shell";
import { DampingFields, JointSliders } from "./sliders";
import { Stage } from "./stage";
import { written } from "./ticks";
import { Traces } from "./traces";
import type { FlyData, PageData } from "./types";
import { unitChoice } from "./unit-choice";
import { length } from "./units";

const RATE = 240;
const FLY_KEYS: Keys = [
  ["shift", "with another key: half the movement"],
  ["I K  U O  J L", "muscle input: pitch, yaw, roll"],
  ["T  Y", "let go, to roll and flip; brace, to stop"],
  ["H", "autopilot"],
  ["space", "pause and resume"],
  ["0", "restart"],
];

export function fly(data: PageData, flight: FlyData): void {
  const flown = new Fly(data, flight);
  window.bodyflight = { core: flown.core, flight, advance: (steps) => flown.advance(steps) };
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
  private readonly gamepads: Gamepads;
  private readonly joints: JointSliders;
  private readonly damping: DampingFields;
  private readonly ground: Ground;
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
    this.ground = new Ground(flight.warning_height_m);
    main.append(this.instruments.place, this.ground.place);
    this.recorder = new Recorder(flight);
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
    this.joints = new JointSliders(this.core, flight);
    this.damping = new DampingFields(this.core);
    aside.append(this.joints.place, this.damping.place, provenance(data));
    const acts = { " ": () => this.pause(), "0": () => this.begin(), h: () => this.pilot.flip() };
    this.keyboard = new Keyboard(this.core, flight.controls, acts);
    this.gamepads = new Gamepads(this.core, flight.controls, acts);
    const thumbs = pads(this.keyboard);
    main.append(thumbs);
    header.append(unitChoice());
    header.append(toggle("touch", "Touch controls", !thumbs.hidden, (on) => (thumbs.hidden = !on)));
    header.append(
      help(
        ["Hold", KEYS.map(({ key, does }) => [key.toUpperCase(), does])],
        ["Press", FLY_KEYS],
        ["Gamepad", PAD_KEYS],
      ),
    );
  }

  run(): void {
    this.begin();
    let before = performance.now();
    const next = (now: number) => {
      const passed = now - before;
      before = now;
      this.gamepads.poll();
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
    this.gamepads.clear();
    this.joints.clear();
    this.damping.clear();
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
    const due = Math.floor(this.owed);
    this.owed -= due;
    this.advance(due);
  }

  /** Flies and records some steps, unless the flight has ended at the ground. */
  advance(steps: number): void {
    for (let k = 0; k < steps && !this.core.exports.is_on_ground(); k++) {
      this.core.exports.step(1);
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
      `height above ground ${length(height)}`,
      `${written(now, 1)} s${recorded === null ? "" : `, recorded ${(recorded / RATE).toFixed(1)} s`}`,
    ]);
    this.ground.show(height, now, core.exports.is_on_ground() !== 0);
    this.pilot.say();
    this.cost.textContent = `${passed.toFixed(1)} ms per frame, ${stage.cost.toFixed(1)} ms to draw`;
    if (this.running) this.traces.take(now, observation);
  }
}

declare global {
  interface Window {
    /** For tests. */
    bodyflight?: { core: Core; flight: FlyData; advance: (steps: number) => void };
  }
}
