// Keyboard controls.
import type { Core } from "./core";
import { element, typing } from "./dom";

export interface Key {
  key: string;
  control: string;
  share: number;
  does: string;
}
export const KEYS: Key[] = [
  { key: "a", control: "turn", share: 1, does: "turn left" },
  { key: "d", control: "turn", share: -1, does: "turn right" },
  { key: "w", control: "legs", share: 1, does: "forward: legs stretched" },
  { key: "s", control: "legs", share: -1, does: "backward: legs bent" },
  { key: "q", control: "side-slide", share: 1, does: "slide left" },
  { key: "e", control: "side-slide", share: -1, does: "slide right" },
  { key: "r", control: "arch", share: 1, does: "arch: faster" },
  { key: "f", control: "arch", share: -1, does: "de-arch: slower" },
  { key: "g", control: "press", share: 1, does: "press arms and thighs" },
  { key: "b", control: "arms-down", share: 1, does: "arms down" },
  { key: "n", control: "left-arm-in", share: 1, does: "left arm in" },
  { key: "m", control: "right-arm-in", share: 1, does: "right arm in" },
];
const MUSCLE: [string, number, number][] = [
  ["i", 0, 1],
  ["k", 0, -1],
  ["u", 1, 1],
  ["o", 1, -1],
  ["j", 2, 1],
  ["l", 2, -1],
];
/** Tension of the limbs: damping. */
const TENSION: [string, number, string][] = [
  ["t", -1, "let go: roll and flip"],
  ["y", 1, "brace: stop turning"],
];
const HELD = new Set([...KEYS.map(({ key }) => key), ...MUSCLE.map(([key]) => key), ...TENSION.map(([key]) => key)]);

/** Held keys move joints, give muscle input and set the tension; other keys act once. */
export class Keyboard {
  private readonly down = new Set<string>();

  constructor(
    private readonly core: Core,
    private readonly controls: string[],
    private readonly acts: Record<string, () => void>,
  ) {
    addEventListener("keydown", (event) => this.press(event, true));
    addEventListener("keyup", (event) => this.press(event, false));
    addEventListener("blur", () => {
      for (const key of [...this.down]) this.press(new KeyboardEvent("keyup", { key }), false);
    });
  }

  /** Releases all keys. */
  clear(): void {
    this.down.clear();
  }

  private press(event: KeyboardEvent, on: boolean): void {
    const key = event.key.toLowerCase();
    if (typing(event) || event.ctrlKey || event.metaKey || event.altKey) return;
    if (HELD.has(key)) this.hold(key, on, event.shiftKey ? 0.5 : 1);
    else if (on && !event.repeat) this.act(key, event);
  }

  /** Presses or releases a key; the touch pads use this too. */
  hold(key: string, on: boolean, strength = 1): void {
    if (on === this.down.has(key)) return;
    if (on) this.down.add(key);
    else this.down.delete(key);
    const bound = KEYS.find((entry) => entry.key === key);
    if (bound) this.core.exports.command(this.controls.indexOf(bound.control), on ? bound.share * strength : 0);
    if (MUSCLE.some((entry) => entry[0] === key)) this.core.exports.muscle(...this.muscle(strength));
    if (TENSION.some((entry) => entry[0] === key)) this.core.exports.tension(this.tension(strength));
  }

  private act(key: string, event: KeyboardEvent): void {
    if (key === " ") {
      // Space activates a focused button.
      if ((event.target as HTMLElement).tagName === "BUTTON") return;
      event.preventDefault();
    }
    this.acts[key]?.();
  }

  /** Muscle input of the held keys, as fractions of its range. */
  private muscle(strength: number): [number, number, number] {
    const input: [number, number, number] = [0, 0, 0];
    for (const [held, axis, sign] of MUSCLE) if (this.down.has(held)) input[axis] += sign * strength;
    return input;
  }

  private tension(strength: number): number {
    return TENSION.reduce((sum, [held, sign]) => sum + (this.down.has(held) ? sign * strength : 0), 0);
  }
}

/** List of the keys and their actions. */
export function keyList(): HTMLElement {
  const cap = (key: string) => element("span", { class: "key" }, key.toUpperCase());
  const list = element("dl", { id: "keys" });
  for (const { key, does } of KEYS) list.append(element("dt", {}, cap(key)), element("dd", {}, does));
  list.append(
    element("dt", {}, cap("I K"), " ", cap("U O"), " ", cap("J L")),
    element("dd", {}, "muscle input: pitch, yaw, roll"),
  );
  for (const [key, , does] of TENSION) list.append(element("dt", {}, cap(key)), element("dd", {}, does));
  return element("section", {}, element("h2", {}, "Keys"), list);
}
