// Channels as they are plotted: angles without jumps, in degrees or radians, and how fine their numbers are.

/** What a unit is shown as. */
export interface Shown {
  unit: string;
  /** Factor on the numbers. */
  factor: number;
  /** Digits behind the point of a value. */
  decimals: number;
  /** The smallest range of an axis: what is less is noise. */
  least: number;
}

const DEGREES = 180 / Math.PI;
const SHOWN: Record<string, Omit<Shown, "unit">> = {
  "°": { factor: DEGREES, decimals: 1, least: 2 },
  "°/s": { factor: DEGREES, decimals: 1, least: 2 },
  rad: { factor: 1, decimals: 3, least: 0.04 },
  "rad/s": { factor: 1, decimals: 3, least: 0.04 },
  "m/s": { factor: 1, decimals: 2, least: 0.2 },
  ms: { factor: 1, decimals: 2, least: 0.2 },
};
const IN_DEGREES: Record<string, string> = { rad: "°", "rad/s": "°/s" };

/** How numbers of a unit are shown. */
export function shown(unit: string, degrees: boolean): Shown {
  const name = (degrees && IN_DEGREES[unit]) || unit;
  return { unit: name, ...(SHOWN[name] ?? { factor: 1, decimals: 3, least: 0.02 }) };
}

/** An angle that turns on where it would jump from one end of its range to the other. */
export function unwrapped(angles: ArrayLike<number>): Float64Array {
  const made = Float64Array.from(angles);
  for (let k = 1; k < made.length; k++) made[k] += 2 * Math.PI * Math.round((made[k - 1] - made[k]) / (2 * Math.PI));
  return made;
}

/** An angle that turns on, by the turns that bring its first value nearest to another's. */
export function unwrappedBeside(angles: ArrayLike<number>, other: ArrayLike<number>): Float64Array {
  const made = unwrapped(angles);
  const turns = 2 * Math.PI * Math.round(((other[0] ?? 0) - (made[0] ?? 0)) / (2 * Math.PI));
  return turns ? made.map((angle) => angle + turns) : made;
}
