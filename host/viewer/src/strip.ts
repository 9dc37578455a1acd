// A plot with residuals is divided: the signal above, the residuals in a strip below.

/** Share of the height of a plot that the strip takes. */
export const STRIP = 0.3;

/** The part of the height that the lines of an axis take, from the bottom. */
export function part(isDivided: boolean, isRight: boolean): [number, number] {
  if (!isDivided) return [0, 1];
  return isRight ? [0, STRIP] : [STRIP, 1];
}

/** The range of an axis whose values have a range of their own in their part of the plot. */
export function widened([low, high]: [number, number], [from, to]: [number, number]): [number, number] {
  const whole = (high - low) / (to - from);
  return [low - from * whole, high + (1 - to) * whole];
}

/** The inverse of `widened`. */
export function own([low, high]: [number, number], [from, to]: [number, number]): [number, number] {
  return [low + from * (high - low), low + to * (high - low)];
}
