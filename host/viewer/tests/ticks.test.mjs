import assert from "node:assert/strict";
import { test } from "node:test";
import { build } from "esbuild";

const { outputFiles } = await build({
  entryPoints: [`${import.meta.dirname}/../src/ticks.ts`],
  bundle: true,
  format: "esm",
  write: false,
});
const { ticks } = await import(`data:text/javascript,${encodeURIComponent(outputFiles[0].text)}`);

/** The lowest plots are 40 px high with 5 px of padding above and below; digits of the 10 px font are 7.2 px high. */
const HEIGHT = 30;
const DIGIT = 7.2;

/** Ranges with widths from 1e-4 to 1e5, with and without zero, the same in every run. */
function* ranges() {
  for (let n = 0; n < 4000; n++) {
    const width = 10 ** (-4 + (9 * n) / 4000);
    const low = width * (((n * 0.618034) % 4) - 2.5);
    yield [low, low + width];
  }
  // Ranges with few round numbers.
  yield* [
    [-4.5, 4.5],
    [-4.9, 4.9],
    [-0.9, 0.9],
    [-1.99, 1.99],
    [51, 59],
    [0.3, 0.301],
    [-62.4, -47.1],
  ];
}

for (const most of [3, 4])
  test(`labels of a low plot do not overlap where at most ${most} are requested`, () => {
    for (const [low, high] of ranges()) {
      const { values, decimals } = ticks(low, high, most);
      const what = `${values} in ${low} to ${high}`;
      assert.ok(values.length >= 2, `no scale: ${what}`);
      const space = (HEIGHT * (values[1] - values[0])) / (high - low);
      assert.ok(space >= DIGIT, `${space.toFixed(1)} px: ${what}`);
      assert.ok(values[0] >= low - 1e-5 * (high - low) && values.at(-1) <= high + 1e-5 * (high - low), what);
      const labels = new Set(values.map((value) => value.toFixed(decimals)));
      assert.equal(labels.size, values.length, `labels ${[...labels]}: ${what}`);
      for (const label of labels)
        assert.ok(
          values.some((value) => Math.abs(value - Number(label)) < 1e-3 * (values[1] - values[0])),
          `${label} is rounded: ${what}`,
        );
    }
  });

test("a high axis has at most the requested number of round steps", () => {
  assert.deepEqual(ticks(0, 30, 7), { values: [0, 5, 10, 15, 20, 25, 30], decimals: 0 });
  assert.deepEqual(ticks(41, 89, 4), { values: [60, 80], decimals: 0 });
  assert.deepEqual(ticks(41, 59, 3), { values: [45, 50, 55], decimals: 0 });
  for (const [low, high] of ranges()) assert.ok(ticks(low, high, 7).values.length <= 7, `${low} to ${high}`);
});

test("a range without width has one label", () => {
  assert.deepEqual(ticks(3, 3, 4).values, [3]);
  assert.deepEqual(ticks(Number.NaN, 1, 4).values.length, 1);
});
