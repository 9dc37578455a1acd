// A gamepad of the standard mapping: sticks and buttons move joints, give muscle input and set the tension.
import type { Core } from "./core";
import type { Keys } from "./help";

/** Deflection below which a stick is at rest. */
const AT_REST = 0.12;

/** What the parts of a gamepad do, for the list of keys. */
export const PAD_KEYS: Keys = [
  ["left stick", "turn; legs forward and back"],
  ["right stick", "muscle input: roll and pitch"],
  ["LB  RB", "muscle input: yaw"],
  ["LT  RT", "let go, brace"],
  ["cross", "arch, de-arch; slide"],
  ["A  B  X  Y", "press, arms down, left arm in, right arm in"],
  ["start  back", "pause, restart"],
];

type Read = (pad: Gamepad) => number;
const stick = (axis: number): Read => {
  return (pad) => {
    const value = pad.axes[axis] ?? 0;
    return Math.abs(value) < AT_REST ? 0 : Math.max(-1, Math.min(1, -value));
  };
};
const pressed =
  (button: number): Read =>
  (pad) =>
    pad.buttons[button]?.value ?? 0;
const between = (plus: number, minus: number): Read => {
  return (pad) => pressed(plus)(pad) - pressed(minus)(pad);
};

/** Controls, with the sticks and buttons of the standard mapping that move them. Sticks count up and left. */
const CONTROLS: [string, Read][] = [
  ["turn", stick(0)],
  ["legs", stick(1)],
  ["arch", between(12, 13)],
  ["side-slide", between(14, 15)],
  ["press", pressed(0)],
  ["arms-down", pressed(1)],
  ["left-arm-in", pressed(2)],
  ["right-arm-in", pressed(3)],
];
/** Pitch, yaw and roll. */
const MUSCLE: Read[] = [stick(3), between(4, 5), stick(2)];
const TENSION = between(7, 6);
/** Buttons that act once, and the keys that do the same. */
const ONCE: [number, string][] = [
  [9, " "],
  [8, "0"],
];

/** Commands what the first gamepad does, whenever that changes, so that it leaves keys and pads alone otherwise. */
export class Gamepads {
  private readonly last = new Map<string, string>();

  constructor(
    private readonly core: Core,
    private readonly controls: string[],
    private readonly acts: Record<string, () => void>,
  ) {}

  /** Forgets what was commanded, for a flight that starts anew; a button that is still held does not act again. */
  clear(): void {
    for (const name of this.last.keys()) if (!ONCE.some(([, key]) => key === name)) this.last.delete(name);
  }

  poll(): void {
    const pad = navigator.getGamepads?.().find((known) => known?.mapping === "standard");
    if (!pad) return;
    const { exports } = this.core;
    for (const [name, read] of CONTROLS)
      this.changed(name, [read(pad)], ([share]) => exports.command(this.controls.indexOf(name), share));
    const muscle = MUSCLE.map((read) => read(pad));
    this.changed("muscle", muscle, ([pitch, yaw, roll]) => exports.muscle(pitch, yaw, roll));
    this.changed("tension", [TENSION(pad)], ([share]) => exports.tension(share));
    for (const [button, key] of ONCE)
      this.changed(key, [pressed(button)(pad)], ([value]) => {
        if (value > 0) this.acts[key]();
      });
  }

  private changed(name: string, values: number[], act: (values: number[]) => void): void {
    const now = values.join();
    const before = this.last.get(name) ?? values.map(() => 0).join();
    this.last.set(name, now);
    if (now !== before) act(values);
  }
}
