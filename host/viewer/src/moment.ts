// Numbers of the data at one time.
import { type Columns, rowAt } from "./data";
import { between, type Quaternion, type Vector } from "./figure";

/** Numbers of columns at a time, between two rows. */
export class Moment {
  private readonly from: number;
  private readonly to: number;
  private readonly share: number;

  constructor(
    private readonly columns: Columns,
    time: number,
  ) {
    const [times] = columns.get("time_s") ?? [[0]];
    this.from = rowAt(times, time);
    this.to = Math.min(this.from + 1, times.length - 1);
    const [begin, end] = [times[this.from], times[this.to]];
    this.share = this.to === this.from ? 0 : Math.max(0, Math.min(1, (time - begin) / (end - begin)));
  }

  private list(name: string): Float64Array[] {
    return this.columns.get(name) ?? [];
  }

  /** Three numbers of a column from a place on. */
  vector(name: string, place = 0): Vector {
    return [0, 1, 2].map((k) => {
      const numbers = this.list(name)[place + k];
      return numbers[this.from] + (numbers[this.to] - numbers[this.from]) * this.share;
    }) as Vector;
  }

  /** Four numbers as a rotation. */
  quaternion(name: string, place = 0): Quaternion {
    const at = (row: number) => [0, 1, 2, 3].map((k) => this.list(name)[place + k][row]) as Quaternion;
    return between(at(this.from), at(this.to), this.share);
  }
}
