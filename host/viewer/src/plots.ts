// Plots of channels over time, one cursor for all.
import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";
import { colour, element } from "./dom";

export interface Line {
  label: string;
  /** Name of a colour of the style sheet. */
  ink: string;
  dash?: number[];
  values: ArrayLike<number>;
}
export interface PlotSpec {
  key: string;
  title: string;
  unit: string;
  note?: string;
  lines: Line[];
}

export class Plots {
  readonly plots: uPlot[] = [];
  readonly specs: PlotSpec[];
  private readonly marks: HTMLElement[] = [];

  constructor(
    place: HTMLElement,
    private time: Float64Array,
    specs: PlotSpec[],
    seek: (time: number) => void,
  ) {
    this.specs = specs;
    for (const spec of specs) {
      const title = element(
        "div",
        { class: "title" },
        element("b", {}, `${spec.title} (${spec.unit})`),
        element("span", { class: "faint" }, spec.note ?? ""),
      );
      const box = element("div", { class: "plot", "data-plot": spec.key }, title);
      place.append(box);
      const keys = element("div", { class: "title faint" });
      for (const line of spec.lines)
        keys.append(
          element("span", { style: `color:var(--${line.ink})` }, `${line.dash ? "- - " : "— "}${line.label}`),
        );
      const plot = new uPlot(this.options(spec, place.clientWidth - 20), this.data(spec), box);
      box.append(keys);
      const mark = element("div", { class: "now", style: "display:none" });
      plot.over.append(mark);
      this.marks.push(mark);
      plot.over.addEventListener("click", () => {
        const left = plot.cursor.left ?? -1;
        if (left >= 0) seek(plot.posToVal(left, "x"));
      });
      this.plots.push(plot);
    }
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
      for (const plot of this.plots) plot.redraw();
    });
    new ResizeObserver(() => {
      for (const plot of this.plots) plot.setSize({ width: place.clientWidth - 20, height: 110 });
    }).observe(place);
  }

  private data(spec: PlotSpec): uPlot.AlignedData {
    // What is no number is a gap, which uPlot writes as null.
    const gaps = (values: ArrayLike<number>) =>
      Array.prototype.some.call(values, Number.isNaN)
        ? Array.from(values, (value) => (Number.isNaN(value) ? null : value))
        : values;
    return [this.time, ...spec.lines.map((line) => gaps(line.values))] as uPlot.AlignedData;
  }

  private options(spec: PlotSpec, width: number): uPlot.Options {
    const axis = {
      stroke: () => colour("faint"),
      grid: { stroke: () => colour("line"), width: 1 },
      ticks: { show: false },
      font: "11px system-ui",
    };
    return {
      width: Math.max(200, width),
      height: 110,
      cursor: { sync: { key: "time" }, drag: { x: true, y: false } },
      scales: { x: { time: false } },
      axes: [
        { ...axis, size: 22 },
        { ...axis, size: 42 },
      ],
      legend: { show: false },
      series: [
        { label: "time (s)" },
        ...spec.lines.map((line) => ({
          label: line.label,
          stroke: () => colour(line.ink),
          width: 1.4,
          dash: line.dash,
          points: { show: false },
        })),
      ],
    };
  }

  /** Marks the time shown. */
  mark(time: number): void {
    this.plots.forEach((plot, k) => {
      const left = plot.valToPos(time, "x");
      this.marks[k].style.display = left >= 0 && left <= plot.over.clientWidth ? "" : "none";
      this.marks[k].style.left = `${left}px`;
    });
  }

  /** New numbers in the same lines. */
  update(time: Float64Array = this.time): void {
    this.time = time;
    for (const [k, plot] of this.plots.entries()) plot.setData(this.data(this.specs[k]));
  }

  /** The part of time that is shown. */
  range(): [number, number] {
    const { min, max } = this.plots[0]?.scales.x ?? {};
    return [min ?? -Infinity, max ?? Infinity];
  }
}

/** Plots as one SVG, for papers. */
export function svg(title: string, time: ArrayLike<number>, specs: PlotSpec[]): string {
  const [width, each, left, right] = [900, 150, 70, 880];
  const clean = (text: string) => text.replace(/[<&>]/g, (c) => `&#${c.charCodeAt(0)};`);
  const [from, to] = [time[0], time[time.length - 1]];
  const parts = specs.map((spec, row) => {
    const [top, bottom] = [40 + row * each + 20, 40 + (row + 1) * each - 12];
    let [low, high] = [Infinity, -Infinity];
    for (const line of spec.lines)
      for (let k = 0; k < line.values.length; k++) {
        low = Math.min(low, line.values[k]);
        high = Math.max(high, line.values[k]);
      }
    if (!(high > low)) [low, high] = [low - 1, high + 1];
    const x = (t: number) => (left + ((t - from) / (to - from || 1)) * (right - left)).toFixed(1);
    const y = (v: number) => (bottom - ((v - low) / (high - low)) * (bottom - top)).toFixed(1);
    const lines = spec.lines.map((line) => {
      const points: string[] = [];
      for (let k = 0; k < line.values.length; k++) points.push(`${x(time[k])},${y(line.values[k])}`);
      return `<polyline fill="none" stroke="${colour(line.ink)}"${line.dash ? ` stroke-dasharray="${line.dash}"` : ""} points="${points.join(" ")}"><title>${clean(line.label)}</title></polyline>`;
    });
    const labels =
      `<text x="${left}" y="${top - 5}">${clean(spec.title)} (${clean(spec.unit)}): ${clean(spec.lines.map((line) => line.label).join(", "))}</text>` +
      `<text x="${left - 5}" y="${top + 10}" text-anchor="end">${high.toPrecision(3)}</text><text x="${left - 5}" y="${bottom}" text-anchor="end">${low.toPrecision(3)}</text>`;
    return `<rect x="${left}" y="${top}" width="${right - left}" height="${bottom - top}" fill="none" stroke="#999"/>${labels}${lines.join("")}`;
  });
  const height = 40 + specs.length * each + 25;
  return (
    `<svg xmlns="http://www.w3.org/2000/svg" width="${width}" height="${height}" font-family="sans-serif" font-size="12">` +
    `<rect width="100%" height="100%" fill="${colour("back")}"/><g fill="${colour("text")}"><text x="${left}" y="22" font-size="15">${clean(title)}</text>${parts.join("")}` +
    `<text x="${right}" y="${height - 8}" text-anchor="end">time (s), ${from.toFixed(1)} to ${to.toFixed(1)}</text></g></svg>`
  );
}
