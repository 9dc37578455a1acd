// Time controls of a replay: slider, clock, playback, and their keys.
import { button, element, toggle, typing } from "./dom";
import type { Keys } from "./help";

const SPEEDS = [0.1, 0.25, 0.5, 1, 2];
/** Pause after which the time is stored in the page's address (ms). */
const REST = 150;
/** Step of the arrow keys (s); 1 s with Shift. */
const STEP = 1 / 30;

export const PLAYER_KEYS: Keys = [
  ["space", "play or pause"],
  ["[  ]", "slower, faster"],
  ["←  →", "1/30 s; with shift 1 s"],
  [",  .", "1/30 s"],
  ["L", "loop over the time range of the plots"],
  ["M", "write a note at this time"],
  ["home  end", "first and last frame"],
];

/** Something that can be shown at a time. */
export interface Scene {
  /** Shows a time (s) that passes at a pace, 0 if it is still. */
  show(time: number, pace: number): void;
  /** Time range to loop over. */
  range(): [number, number];
  /** Begins a note. */
  note(): void;
  /** Drawing time of the last picture (ms). */
  readonly cost: number;
}

export class Player {
  private now: number;
  private speed = 1;
  private playing = false;
  private remembering = 0;
  private readonly slider: HTMLInputElement;
  private readonly clock = element("output", { id: "time" });
  private readonly play: HTMLButtonElement;
  private readonly loop: HTMLButtonElement;
  private loops = false;
  private readonly pace: HTMLSelectElement;
  private readonly cost = element("span", {
    class: "faint",
    id: "cost",
    title: "frame interval and drawing time",
  });

  constructor(
    place: HTMLElement,
    readonly begin: number,
    readonly end: number,
    private readonly scene: Scene,
  ) {
    this.now = begin;
    this.slider = element("input", {
      type: "range",
      min: String(begin),
      max: String(end),
      step: "any",
      "aria-label": "time",
    });
    this.slider.addEventListener("input", () => this.seek(Number(this.slider.value)));
    this.play = button("play", "Play or pause (space)", () => this.toggle());
    this.pace = element(
      "select",
      { title: "Playback speed ([ and ])", "aria-label": "playback speed" },
      ...SPEEDS.map((value) => element("option", { value: String(value) }, `${value}x`)),
    );
    this.pace.value = String(this.speed);
    this.pace.addEventListener("change", () => {
      this.speed = Number(this.pace.value);
      this.pace.blur();
    });
    this.loop = toggle(
      "loop",
      "Loop over the time range of the plots (L): drag in a plot to select it",
      false,
      (on) => {
        this.loops = on;
      },
    );
    place.append(this.play, this.loop, this.slider, this.clock, this.pace, this.cost);
    this.listenToKeys();
  }

  get time(): number {
    return this.now;
  }

  seek(to: number): void {
    this.now = Math.max(this.begin, Math.min(this.end, to));
    this.show();
    this.remember();
  }

  /** Redraws the current time. */
  show(): void {
    this.slider.value = String(this.now);
    this.clock.textContent = `${this.now.toFixed(3)} s`;
    this.scene.show(this.now, this.playing ? this.speed : 0);
  }

  /** The time range that is played. */
  private range(): [number, number] {
    if (!this.loops) return [this.begin, this.end];
    const [from, to] = this.scene.range();
    return [Math.max(this.begin, from), Math.min(this.end, to)];
  }

  start(): void {
    const [from, to] = this.range();
    if (this.now >= to || this.now < from) this.now = from;
    this.playing = true;
    this.play.textContent = "pause";
    let before = performance.now();
    const next = (now: number) => {
      if (!this.playing) return;
      const [from, to] = this.range();
      this.now = Math.min(to, this.now + ((now - before) / 1000) * this.speed);
      const isOver = this.now >= to;
      if (isOver && this.loops) this.now = from;
      this.cost.textContent = `${(now - before).toFixed(1)} ms, ${this.scene.cost.toFixed(1)} ms`;
      before = now;
      this.show();
      if (isOver && !this.loops) this.pause();
      else requestAnimationFrame(next);
    };
    requestAnimationFrame(next);
  }

  private pause(): void {
    this.playing = false;
    this.play.textContent = "play";
    this.show();
    this.remember();
  }

  private toggle(): void {
    if (this.playing) this.pause();
    else this.start();
  }

  private faster(by: number): void {
    const place = Math.max(0, Math.min(SPEEDS.length - 1, SPEEDS.indexOf(this.speed) + by));
    this.speed = SPEEDS[place];
    this.pace.value = String(this.speed);
  }

  /** Stores the current time in the page's address once it rests: browsers limit how often an address may change. */
  private remember(): void {
    clearTimeout(this.remembering);
    this.remembering = window.setTimeout(() => history.replaceState(null, "", `#t=${this.now.toFixed(3)}`), REST);
  }

  private listenToKeys(): void {
    const keys: Record<string, (event: KeyboardEvent) => void> = {
      " ": () => this.toggle(),
      ArrowRight: (event) => this.seek(this.now + (event.shiftKey ? 1 : STEP)),
      ArrowLeft: (event) => this.seek(this.now - (event.shiftKey ? 1 : STEP)),
      ".": () => this.seek(this.now + STEP),
      ",": () => this.seek(this.now - STEP),
      Home: () => this.seek(this.begin),
      End: () => this.seek(this.end),
      "[": () => this.faster(-1),
      "]": () => this.faster(1),
      l: () => this.loop.click(),
      m: () => this.scene.note(),
    };
    addEventListener("keydown", (event) => {
      const act = keys[event.key];
      if (!act || typing(event) || event.ctrlKey || event.metaKey) return;
      // Space activates a focused button.
      if (event.key === " " && (event.target as HTMLElement).tagName === "BUTTON") return;
      event.preventDefault();
      act(event);
    });
  }
}
