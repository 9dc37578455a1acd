// Ticks at round numbers, and number formatting.

export interface Ticks {
  values: number[];
  /** Decimals needed to tell the ticks apart. */
  decimals: number;
}

/** Finer steps (times a power of ten) for ranges with fewer than two ticks. */
const FINER = [5, 4, 2, 1, 0.5, 0.4, 0.2, 0.1];

/**
 * Returns at most `most` round numbers from `low` to `high`, in steps of 1, 2 or 5 times a power of ten.
 *
 * If fewer than two fit, a finer step is used. The step 4 comes before 2 so that ticks stay more than a quarter of the
 * range apart, and their labels do not overlap in low plots.
 */
export function ticks(low: number, high: number, most: number): Ticks {
  const rough = (high - low) / Math.max(1, most - 1);
  if (!(rough > 0) || !Number.isFinite(rough)) return { values: [low], decimals: 1 };
  const power = 10 ** Math.floor(Math.log10(rough));
  const coarse = [1, 2, 5].find((factor) => factor * power >= rough * 0.999) ?? 10;
  const factors = [coarse, ...FINER.filter((factor) => factor < coarse)];
  const found = factors.find((factor) => multiples(factor * power, low, high).length > 1);
  const step = (found ?? coarse) * power;
  return { values: multiples(step, low, high), decimals: Math.max(0, -Math.floor(Math.log10(step) + 1e-9)) };
}

function multiples(step: number, low: number, high: number): number[] {
  const values: number[] = [];
  // Adding 0 turns -0 into 0.
  for (let k = Math.ceil(low / step - 1e-6) + 0; k * step <= high + 1e-6 * step; k++) values.push(k * step);
  return values;
}

/** Formats a number; zero has no sign. */
export function written(value: number | null | undefined, decimals: number): string {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  const text = value.toFixed(decimals);
  return Number(text) === 0 ? text.replace("-", "") : text.replace("-", "−");
}

/** Range of the values in all lists, at least `least` wide, with a margin. */
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
