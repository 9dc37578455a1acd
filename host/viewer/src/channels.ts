// Channels as plotted: continuous angles, and one sense of turning.
//
// In the data, headings and turn rates are positive towards west, as the model's axes are. The page shows them as a compass
// does, positive to the right; this is the only place where that is converted.
import { CHANNELS } from "./types";

/** Keys of the channels that the page shows in the sense of a compass. */
const TURNED: readonly string[] = ["heading_rad", "yaw_rate_radps"];

/** What the title of a channel says about its sense. */
export function sense(channel: number): string {
  return TURNED.includes(CHANNELS[channel].key) ? "positive to the right" : "";
}

/** A value of a channel as shown. */
export function asShown(channel: number, value: number): number {
  return TURNED.includes(CHANNELS[channel].key) ? -value : value;
}

/** Values of a channel as shown. */
export function allAsShown(channel: number, values: Float64Array): Float64Array {
  return TURNED.includes(CHANNELS[channel].key) ? values.map((value) => -value) : values;
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
