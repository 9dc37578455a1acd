// Heading and fall rate as instruments, with the numbers that go with them.
import { element } from "./dom";
import { written } from "./ticks";

/** What instruments show of a body. */
export interface Reading {
  /** Heading (rad), 0 north, towards west. */
  heading: number;
  /** Downwards, and over ground (m/s). */
  fall: number;
  level: number;
  /** Turn about the vertical (rad/s). */
  turn: number;
}

const SVG = "http://www.w3.org/2000/svg";
const DEGREES = 180 / Math.PI;
/** Full scale of the fall rate (m/s), and the half angle of its arc (degrees). */
const [FULL, HALF] = [100, 125];

function drawn(tag: string, attributes: Record<string, string | number>, text = ""): SVGElement {
  const made = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, String(value));
  made.textContent = text;
  return made;
}

function dial(label: string, ...parts: SVGElement[]): SVGElement {
  const made = drawn("svg", { viewBox: "-50 -50 100 100", class: "dial", role: "img", "aria-label": label });
  made.append(drawn("circle", { r: 47, class: "face" }), ...parts);
  return made;
}

const spoke = (angle: number, from: number, to: number) =>
  drawn("path", { d: `M0 ${-to}V${-from}`, transform: `rotate(${angle})`, class: "mark" });
const at = (angle: number, radius: number) => ({
  x: (radius * Math.sin(angle / DEGREES)).toFixed(1),
  y: (4 - radius * Math.cos(angle / DEGREES)).toFixed(1),
});

/** A compass whose card turns, and a gauge of the fall rate; measured ones as thin needles. */
export class Instruments {
  readonly place = element("div", { class: "over legend instruments", id: "legend", "aria-live": "off" });
  private readonly card = drawn("g", {});
  private readonly bug = drawn("path", { d: "M0 -47l5 9h-10z", class: "measured" });
  private readonly needle = drawn("path", { d: "M-3 0L0 -38L3 0z", class: "needle" });
  private readonly thin = drawn("path", { d: "M0 0V-42", class: "measured thin" });
  private readonly numbers = element("div", { class: "numbers" });

  constructor() {
    for (let angle = 0; angle < 360; angle += 30) this.card.append(spoke(angle, 40, 46));
    // Headings grow to the west, as the model's do; a compass grows to the east.
    for (const [angle, name] of [
      [0, "N"],
      [90, "E"],
      [180, "S"],
      [270, "W"],
    ] as const)
      this.card.append(drawn("text", at(angle, 32), name));
    const scale = [0, 20, 40, 60, 80, 100].flatMap((speed) => {
      const angle = this.angle(speed);
      return [spoke(angle, 40, 46), drawn("text", at(angle, 31), String(speed))];
    });
    const gauge = dial("fall rate", ...scale, this.thin, this.needle, drawn("circle", { r: 4, class: "hub" }));
    const lubber = drawn("path", { d: "M0 -24l4 10h-8z", class: "needle" });
    this.place.append(dial("heading", this.card, this.bug, lubber), gauge, this.numbers);
  }

  private angle(speed: number): number {
    return -HALF + (2 * HALF * Math.max(0, Math.min(FULL, speed))) / FULL;
  }

  show(shown: Reading, measured: Reading | null, remarks: string[] = []): void {
    const heading = (-shown.heading * DEGREES + 720) % 360;
    this.card.setAttribute("transform", `rotate(${-heading})`);
    this.needle.setAttribute("transform", `rotate(${this.angle(shown.fall)})`);
    for (const part of [this.bug, this.thin]) part.style.display = measured ? "" : "none";
    if (measured) {
      this.bug.setAttribute("transform", `rotate(${(shown.heading - measured.heading) * DEGREES})`);
      this.thin.setAttribute("transform", `rotate(${this.angle(measured.fall)})`);
    }
    const row = (name: string, value: (reading: Reading) => number, decimals: number, unit: string) => {
      const beside = measured ? ` (measured ${written(value(measured), decimals)})` : "";
      const number = `${name} ${written(value(shown), decimals)}`;
      return element("div", {}, number, element("span", { class: "beside" }, beside), ` ${unit}`);
    };
    this.numbers.replaceChildren(
      row("heading", (reading) => (-reading.heading * DEGREES + 720) % 360, 0, "°"),
      row("fall rate", (reading) => reading.fall, 1, "m/s"),
      row("over ground", (reading) => reading.level, 1, "m/s"),
      row("turn", (reading) => reading.turn * DEGREES, 0, "°/s"),
      ...remarks.map((remark) => element("div", {}, remark)),
    );
  }
}

/** A reading of the channels of the model, in the order of CHANNELS. */
export function reading(channels: ArrayLike<number>): Reading {
  return { heading: channels[2], fall: -channels[6], level: channels[5], turn: channels[3] };
}
