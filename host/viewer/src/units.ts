// Units in which the reader wants to see values, kept by the browser.
import { written } from "./ticks";

/** How values of a unit are displayed. */
export interface Shown {
  unit: string;
  /** Conversion factor. */
  factor: number;
  /** Decimals of a value. */
  decimals: number;
  /** Smallest range of an axis; anything smaller is noise. */
  least: number;
}

/** Names of the units for speeds; with miles per hour, lengths are in feet. */
export const SPEEDS = ["m/s", "km/h", "mph"] as const;
export type Speed = (typeof SPEEDS)[number];

const KEPT = "bodyflight-units";
const DEGREES = 180 / Math.PI;
const SHOWN: Record<string, Omit<Shown, "unit">> = {
  "°": { factor: DEGREES, decimals: 1, least: 2 },
  "°/s": { factor: DEGREES, decimals: 1, least: 2 },
  rad: { factor: 1, decimals: 3, least: 0.04 },
  "rad/s": { factor: 1, decimals: 3, least: 0.04 },
  "m/s": { factor: 1, decimals: 2, least: 0.2 },
  "km/h": { factor: 3.6, decimals: 1, least: 0.7 },
  mph: { factor: 3600 / 1609.344, decimals: 1, least: 0.4 },
  m: { factor: 1, decimals: 0, least: 1 },
  ft: { factor: 1 / 0.3048, decimals: 0, least: 3 },
  ms: { factor: 1, decimals: 2, least: 0.2 },
};
const IN_DEGREES: Record<string, string> = { rad: "°", "rad/s": "°/s" };
/** Marks of the gauge of the fall rate: distance and full scale. */
export const GAUGE: Record<Speed, [number, number]> = { "m/s": [20, 100], "km/h": [60, 360], mph: [40, 240] };

class Units {
  degrees = true;
  speed: Speed = "m/s";
  private readonly acts: (() => void)[] = [];

  constructor() {
    try {
      const kept = JSON.parse(localStorage.getItem(KEPT) ?? "{}") as Partial<Units>;
      this.degrees = kept.degrees ?? true;
      if (kept.speed && SPEEDS.includes(kept.speed)) this.speed = kept.speed;
    } catch {
      // A browser that keeps nothing shows the default.
    }
  }

  choose(chosen: { degrees?: boolean; speed?: Speed }): void {
    Object.assign(this, chosen);
    try {
      localStorage.setItem(KEPT, JSON.stringify({ degrees: this.degrees, speed: this.speed }));
    } catch {
      // As above.
    }
    for (const act of this.acts) act();
  }

  /** Calls `act` after each choice. */
  onChoice(act: () => void): void {
    this.acts.push(act);
  }
}

export const units = new Units();

/** Returns how values of a unit are displayed. */
export function shown(unit: string): Shown {
  let name = unit;
  if (units.degrees) name = IN_DEGREES[unit] ?? name;
  if (unit === "m/s") name = units.speed;
  if (unit === "m" && units.speed === "mph") name = "ft";
  return { unit: name, ...(SHOWN[name] ?? { factor: 1, decimals: 3, least: 0.02 }) };
}

/** A length (m) with its unit. */
export function length(metres: number): string {
  const { unit, factor, decimals } = shown("m");
  return `${written(metres * factor, decimals)} ${unit}`;
}
