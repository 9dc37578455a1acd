// Channels as plotted: continuous angles, in degrees or radians, with a precision for each unit.

/** How a unit is displayed. */
export interface Shown {
  unit: string;
  /** Conversion factor. */
  factor: number;
  /** Decimals of a value. */
  decimals: number;
  /** Smallest range of an axis; anything smaller is noise. */
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

/** Returns how values of a unit are displayed. */
export function shown(unit: string, degrees: boolean): Shown {
  const name = (degrees && IN_DEGREES[unit]) || unit;
  return { unit: name, ...(SHOWN[name] ?? { factor: 1, decimals: 3, least: 0.02 }) };
}

/** Unwraps an angle. */
export function unwrapped(angles: ArrayLike<number>): Float64Array {
  const made = Float64Array.from(angles);
  for (let k = 1; k < made.length; k++) made[k] += 2 * Math.PI * Math.round((made[k - 1] - made[k]) / (2 * Math.PI));
  return made;
}

/** Unwraps an angle, shifted by whole turns so that it starts as close as possible to another angle. */
export function unwrappedBeside(angles: ArrayLike<number>, other: ArrayLike<number>): Float64Array {
  const made = unwrapped(angles);
  const turns = 2 * Math.PI * Math.round(((other[0] ?? 0) - (made[0] ?? 0)) / (2 * Math.PI));
  return turns ? made.map((angle) => angle + turns) : made;
}
