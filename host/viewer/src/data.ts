// Reads, checks and unpacks the page's data. The types are generated from the program's.
import { type Packed, type PageData, SCHEMA } from "./types";

/** An error with a message for the user, shown instead of the page. */
export class BadData extends Error {}

export function pageData(): PageData {
  const text = document.getElementById("bodyflight-data")?.textContent ?? "null";
  let data: PageData | null;
  try {
    data = JSON.parse(text);
  } catch {
    throw new BadData(
      "The data of this page is damaged: it was truncated or modified. Create the page again with bodyflight view.",
    );
  }
  if (data === null) {
    throw new BadData("This page contains no data: create one with bodyflight view, fly or stream --view.");
  }
  if (data.schema !== SCHEMA) {
    throw new BadData(
      `This page reads data of version ${SCHEMA} and was given version ${data.schema}: make the page and the data with the same bodyflight.`,
    );
  }
  return data;
}

/** Time series: for each column, one list per component. */
export type Columns = Map<string, Float64Array[]>;

/** The inverse of verbs/src/view/series.rs. */
export async function unpack(packed: Packed): Promise<Columns> {
  let bytes: Uint8Array;
  try {
    const zipped = Uint8Array.from(atob(packed.data), (c) => c.charCodeAt(0));
    const stream = new Blob([zipped]).stream().pipeThrough(new DecompressionStream("gzip"));
    bytes = new Uint8Array(await new Response(stream).arrayBuffer());
  } catch {
    throw new BadData("The series of this page are damaged: create the page again with bodyflight view.");
  }
  let next = 0;
  const difference = () => {
    let value = 0;
    for (let shift = 0; ; shift += 7) {
      if (next >= bytes.length)
        throw new BadData("The series of this page end too early: create the page again with bodyflight view.");
      const byte = bytes[next++];
      value |= (byte & 0x7f) << shift;
      if (byte < 0x80) break;
    }
    return (value >>> 1) ^ -(value & 1);
  };
  const columns: Columns = new Map();
  for (const { name, width, step } of packed.columns) {
    const numbers: Float64Array[] = [];
    for (let k = 0; k < width; k++) {
      const list = new Float64Array(packed.rows);
      let sum = 0;
      for (let row = 0; row < packed.rows; row++) {
        sum = (sum + difference()) | 0;
        list[row] = sum * step;
      }
      numbers.push(list);
    }
    columns.set(name, numbers);
  }
  return columns;
}

/** Index of the last of the ascending `times` that is not after `time`, or 0. */
export function rowAt(times: ArrayLike<number>, time: number): number {
  let [low, high] = [0, times.length - 1];
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (times[middle] <= time) low = middle;
    else high = middle - 1;
  }
  return low;
}

/** Wraps an angle difference to ±π. */
export function wrapped(angle: number): number {
  return angle - 2 * Math.PI * Math.round(angle / (2 * Math.PI));
}
