// Instruments for heading and fall rate, with their values.
import { asShown } from "./channels";
import { element } from "./dom";
import { written } from "./ticks";
import { GAUGE, shown, units } from "./units";

/** Values shown by the instruments. */
export interface Reading {
  /** Heading (rad), 0 is north, positive to the right as on a compass. */
  heading: number;
  /** Fall rate and ground speed (m/s). */
  fall: number;
  level: number;
  /** Turn rate about the vertical (rad/s), positive to the right. */
  turn: number;
}

const SVG = "http://www.w3.org/2000/svg";
const DEGREES = 180 / Math.PI;
/** Half the angle of the arc of the fall rate (degrees). */
const HALF = 125;

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

/** Heading on a compass (degrees). */
const bearing = ({ heading }: Reading) => (heading * DEGREES + 720) % 360;
/** A speed (m/s) in the unit of the reader. */
const speed = (value: number) => value * shown("m/s").factor;

/** Name, value, decimals and unit of each row. */
const ROWS: [string, (reading: Reading) => number, number, () => string][] = [
  ["heading", bearing, 0, () => "°"],
  ["fall rate", (reading) => speed(reading.fall), 1, () => units.speed],
  ["over ground", (reading) => speed(reading.level), 1, () => units.speed],
  ["turn", (reading) => reading.turn * DEGREES, 0, () => "°/s to the right"],
];

/** A row of text; only the parts that change are updated. */
class Row {
  readonly place = element("div");
  private readonly parts = [new Text(), element("span", { class: "beside" }), new Text()];

  constructor() {
    this.place.append(...this.parts);
  }

  show(...words: string[]): void {
    for (const [k, part] of this.parts.entries()) if (part.textContent !== words[k]) part.textContent = words[k];
  }
}

/** A compass with a rotating card and a fall-rate gauge; thin needles show the measured values. */
export class Instruments {
  readonly place = element("div", { class: "over legend instruments", id: "legend", "aria-live": "off" });
  private readonly card = drawn("g", {});
  private readonly bug = drawn("path", { d: "M0 -47l5 9h-10z", class: "measured" });
  private readonly needle = drawn("path", { d: "M-3 0L0 -38L3 0z", class: "needle" });
  private readonly thin = drawn("path", { d: "M0 0V-42", class: "measured thin" });
  private readonly scale = drawn("g", {});
  private readonly rows = ROWS.map(() => new Row());
  private readonly remarks = element("div");

  constructor() {
    for (let angle = 0; angle < 360; angle += 30) this.card.append(spoke(angle, 40, 46));
    for (const [angle, name] of [
      [0, "N"],
      [90, "E"],
      [180, "S"],
      [270, "W"],
    ] as const)
      this.card.append(drawn("text", at(angle, 32), name));
    this.mark();
    units.onChoice(() => this.mark());
    const gauge = dial("fall rate", this.scale, this.thin, this.needle, drawn("circle", { r: 4, class: "hub" }));
    const lubber = drawn("path", { d: "M0 -24l4 10h-8z", class: "needle" });
    const numbers = element("div", { class: "numbers" }, ...this.rows.map((row) => row.place), this.remarks);
    this.place.append(dial("heading", this.card, this.bug, lubber), gauge, numbers);
  }

  /** Marks the gauge in the unit of the reader. */
  private mark(): void {
    const [step, full] = GAUGE[units.speed];
    const marks = Array.from({ length: full / step + 1 }, (_, k) => k * step);
    const parts = marks.flatMap((value) => {
      const angle = -HALF + (2 * HALF * value) / full;
      return [spoke(angle, 40, 46), drawn("text", at(angle, 31), String(value))];
    });
    this.scale.replaceChildren(...parts);
  }

  /** Angle of the needle for a fall rate (m/s). */
  private angle(fall: number): number {
    const [, full] = GAUGE[units.speed];
    return -HALF + (2 * HALF * Math.max(0, Math.min(full, speed(fall)))) / full;
  }

  show(reading: Reading, measured: Reading | null, remarks: string[] = []): void {
    this.card.setAttribute("transform", `rotate(${-bearing(reading)})`);
    this.needle.setAttribute("transform", `rotate(${this.angle(reading.fall)})`);
    for (const part of [this.bug, this.thin]) part.style.display = measured ? "" : "none";
    if (measured) {
      this.bug.setAttribute("transform", `rotate(${(measured.heading - reading.heading) * DEGREES})`);
      this.thin.setAttribute("transform", `rotate(${this.angle(measured.fall)})`);
    }
    for (const [k, [name, value, decimals, unit]] of ROWS.entries()) {
      const beside = measured ? ` (measured ${written(value(measured), decimals)})` : "";
      this.rows[k].show(`${name} ${written(value(reading), decimals)}`, beside, ` ${unit()}`);
    }
    if (this.remarks.textContent !== remarks.join(""))
      this.remarks.replaceChildren(...remarks.map((remark) => element("div", {}, remark)));
  }
}

/** Reads the instruments' values from channels in the order of CHANNELS. */
export function reading(channels: ArrayLike<number>): Reading {
  const value = (channel: number) => asShown(channel, channels[channel]);
  return { heading: value(2), fall: -value(6), level: value(5), turn: value(3) };
}
