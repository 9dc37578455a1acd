// Ticks at round numbers, and numbers as people write them.

export interface Ticks {
  values: number[];
  /** Digits behind the point that tell the ticks apart. */
  decimals: number;
}

/** At most so many round numbers from `low` to `high`: steps of 1, 2 or 5 by powers of ten. */
export function ticks(low: number, high: number, most: number): Ticks {
  const rough = (high - low) / Math.max(1, most - 1);
  if (!(rough > 0) || !Number.isFinite(rough)) return { values: [low], decimals: 1 };
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = ([1, 2, 5].find((factor) => factor * power >= rough * 0.999) ?? 10) * power;
  const values: number[] = [];
  for (let k = Math.ceil(low / step - 1e-6); k * step <= high + 1e-6 * step; k++) values.push(k * step);
  // One number alone is no scale.
  if (values.length < 2 && most < 20) return ticks(low, high, 2 * most);
  return { values, decimals: Math.max(0, -Math.floor(Math.log10(step) + 1e-9)) };
}

/** A number with these digits; a minus only before what is not zero. */
export function written(value: number | null | undefined, decimals: number): string {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  const text = value.toFixed(decimals);
  return Number(text) === 0 ? text.replace("-", "") : text.replace("-", "−");
}

/** The range that shows these lists, at least `least` wide, with a little room. */
export function span(lists: ArrayLike<number>[], least: number): [number, number] {
  let [low, high] = [Infinity, -Infinity];
  for (const list of lists)
    for (let k = 0; k < list.length; k++) {
      if (list[k] < low) low = list[k];
      if (list[k] > high) high = list[k];
    }
  if (low > high) [low, high] = [0, 0];
  const room = Math.max(0.06 * (high - low), (least - (high - low)) / 2);
  return [low - room, high + room];
}
