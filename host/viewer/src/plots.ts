// Plots of channels over time with a common cursor, legend and time axis.
import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";
import { type Shown, shown } from "./channels";
import { rowAt } from "./data";
import { button, colour, element, onRecolour } from "./dom";
import { span, ticks, written } from "./ticks";

export interface Line {
  label: string;
  /** Name of a colour of the style sheet. */
  ink: string;
  dash?: number[];
  values: ArrayLike<number>;
  /** Half width of a band around the values: two standard deviations. */
  spread?: ArrayLike<number>;
  /** Whether it uses the axis on the right, as residuals do. */
  right?: boolean;
}
export interface PlotSpec {
  key: string;
  title: string;
  unit: string;
  note?: string;
  /** Root mean squares in the unit of the values, one for each flight; shown in the unit of the plot. */
  rms?: number[];
  lines: Line[];
  /** Whether it is hidden unless selected. */
  aside?: boolean;
}
/** What all plots share. */
export interface Frame {
  place: HTMLElement;
  time: Float64Array;
  seek: (time: number) => void;
  /** Height available for all plots (px); without it the height of a plot is fixed. */
  room?: () => number;
}

const TITLE = 15;
const TIME_AXIS = 18;
const [LOWEST, HIGHEST] = [40, 240];
const EDGE = 44;

export class Plots {
  plots: uPlot[] = [];
  /** Plots shown, in the selected order. */
  specs: PlotSpec[];
  degrees = true;
  private time: Float64Array;
  private now = NaN;
  private marks: HTMLElement[] = [];
  private readouts: HTMLElement[][] = [];
  private readonly head = element("div", { class: "legends", id: "plot-legend" });
  private readonly body = element("div", { class: "plots" });

  constructor(
    private readonly frame: Frame,
    private readonly all: PlotSpec[],
  ) {
    this.time = frame.time;
    this.specs = all.filter((spec) => !spec.aside);
    frame.place.append(this.head, this.body);
    this.build();
    onRecolour(() => this.build());
    let width = 0;
    new ResizeObserver(() => {
      // React to the width only: the plots themselves change the height.
      if (width !== this.width()) this.fit();
      width = this.width();
    }).observe(frame.place);
    addEventListener("resize", () => this.fit());
  }

  /** Shows these channels, in this order. */
  choose(keys: string[]): void {
    this.specs = keys.flatMap((key) => this.all.filter((spec) => spec.key === key));
    this.build();
  }

  /** Moves the marks to a time. */
  mark(time: number): void {
    this.now = time;
    const row = rowAt(this.time, time);
    for (const [k, plot] of this.plots.entries()) {
      this.place(k, plot);
      if (plot.cursor.idx == null || (plot.cursor.left ?? -1) < 0) this.read(k, row);
    }
  }

  /** Updates the data of all lines. */
  update(time: Float64Array = this.time): void {
    this.time = time;
    for (const [k, plot] of this.plots.entries()) plot.setData(this.data(this.specs[k]));
  }

  /** Time range shown. */
  range(): [number, number] {
    const { min, max } = this.plots[0]?.scales.x ?? {};
    return [min ?? -Infinity, max ?? Infinity];
  }

  private width(): number {
    return Math.max(200, this.frame.place.clientWidth - 18);
  }

  private height(k: number): number {
    const count = Math.max(1, this.specs.length);
    const room = (this.frame.room?.() ?? 9999) - this.head.offsetHeight - TIME_AXIS - count * TITLE - 8;
    const each = this.frame.room ? Math.max(LOWEST, Math.min(HIGHEST, Math.floor(room / count))) : 92;
    return each + (k === count - 1 ? TIME_AXIS : 0);
  }

  private fit(): void {
    for (const [k, plot] of this.plots.entries()) plot.setSize({ width: this.width(), height: this.height(k) });
  }

  private build(): void {
    const { min, max } = this.plots[0]?.scales.x ?? {};
    for (const plot of this.plots) plot.destroy();
    [this.plots, this.marks, this.readouts] = [[], [], []];
    this.head.replaceChildren(...legend(this.specs), this.unitSwitch());
    this.body.replaceChildren();
    for (const k of this.specs.keys()) this.add(k);
    if (min != null && max != null) for (const plot of this.plots) plot.setScale("x", { min, max });
  }

  private add(k: number): void {
    const spec = this.specs[k];
    const readout = spec.lines.map((line) => element("span", { class: "value", style: `color:var(--${line.ink})` }));
    const values = element("span", { class: "values" }, ...readout);
    const title = element(
      "div",
      { class: "title" },
      element("b", {}, `${spec.title} (${shown(spec.unit, this.degrees).unit})`),
      element("span", { class: "faint note" }, this.note(spec)),
      values,
    );
    const box = element("div", { class: "plot", "data-plot": spec.key }, title);
    this.body.append(box);
    const plot = new uPlot(this.options(k), this.data(spec), box);
    const mark = element("div", { class: "now", style: "display:none" });
    plot.over.append(mark);
    plot.over.addEventListener("click", () => {
      const left = plot.cursor.left ?? -1;
      if (left >= 0) this.frame.seek(plot.posToVal(left, "x"));
    });
    this.marks.push(mark);
    this.readouts.push(readout);
    this.plots.push(plot);
  }

  private note({ note, rms, unit }: PlotSpec): string {
    if (!rms) return note ?? "";
    const { factor, decimals } = shown(unit, this.degrees);
    return `RMS ${rms.map((value) => written(value * factor, decimals)).join(", ")}`;
  }

  /** Shows the values of the lines at a row. */
  private read(k: number, row: number): void {
    const { factor, decimals } = this.shown(k);
    this.readouts[k]?.forEach((place, n) => {
      place.textContent = written(this.specs[k].lines[n].values[row] * factor, decimals);
    });
  }

  private shown(k: number): Shown {
    return shown(this.specs[k].unit, this.degrees);
  }

  /** Moves the mark of a plot to the current time. */
  private place(k: number, plot: uPlot): void {
    const left = plot.valToPos(this.now, "x");
    const mark = this.marks[k];
    if (!mark) return;
    // The width is 0 before the layout.
    const width = plot.over.clientWidth || plot.width;
    mark.style.display = left >= -1 && left <= width + 1 ? "" : "none";
    mark.style.left = `${left}px`;
  }

  private data(spec: PlotSpec): uPlot.AlignedData {
    const { factor } = shown(spec.unit, this.degrees);
    // NaN is a gap, which uPlot represents as null.
    const scaled = (values: ArrayLike<number>) =>
      Array.from(values, (value) => (Number.isNaN(value) ? null : value * factor));
    const bands = spec.lines.flatMap(({ values, spread }) =>
      spread ? [1, -1].map((sign) => scaled(Array.from(values, (value, k) => value + sign * spread[k]))) : [],
    );
    return [this.time, ...drawn(spec).map((line) => scaled(line.values)), ...bands] as uPlot.AlignedData;
  }

  private options(k: number): uPlot.Options {
    const spec = this.specs[k];
    const { least } = this.shown(k);
    const axis = {
      stroke: () => colour("faint"),
      grid: { stroke: () => colour("line"), width: 1 },
      ticks: { show: false },
      font: "10px system-ui",
      gap: 3,
    };
    const of = (most: number) => ({
      splits: (_: uPlot, __: number, low: number, high: number) => ticks(low, high, most).values,
      values: (plot: uPlot, splits: number[], which: number) => {
        const { min, max } = plot.scales[plot.axes[which].scale ?? "x"];
        const { decimals } = ticks(min ?? 0, max ?? 1, most);
        return splits.map((value) => written(value, decimals));
      },
    });
    const isLast = k === this.specs.length - 1;
    const isRight = spec.lines.some((line) => line.right);
    const range = (_: uPlot, low: number | null, high: number | null): [number, number] =>
      span([[low ?? NaN, high ?? NaN]], least);
    const end = (line: Line) => ({ scale: "y", stroke: "transparent", width: 0, fill: undefined, label: line.label });
    let next = spec.lines.length + 1;
    const bands = spec.lines.flatMap((line): uPlot.Band[] => {
      if (!line.spread) return [];
      next += 2;
      const fill = () => `${colour(line.ink)}38`;
      return [{ series: [next - 2, next - 1], fill: fill as unknown as uPlot.Band["fill"] }];
    });
    return {
      width: this.width(),
      height: this.height(k),
      padding: [5, isRight ? 0 : EDGE, 5, 0],
      cursor: { sync: { key: "time" }, drag: { x: true, y: false }, points: { size: 5 } },
      scales: { x: { time: false }, y: { range }, right: { range } },
      axes: [
        { ...axis, ...of(7), size: TIME_AXIS, show: isLast },
        { ...axis, ...of(4), size: EDGE, scale: "y" },
        ...(isRight
          ? [{ ...axis, ...of(3), size: EDGE, scale: "right", side: 1 as const, grid: { show: false } }]
          : []),
      ],
      legend: { show: false },
      hooks: {
        ready: [(plot) => this.place(k, plot)],
        setSize: [(plot) => this.place(k, plot)],
        setScale: [(plot, scale) => scale === "x" && this.place(k, plot)],
        setCursor: [(plot) => this.read(k, plot.cursor.idx != null ? plot.cursor.idx : rowAt(this.time, this.now))],
      },
      bands,
      series: [
        { label: "time (s)" },
        ...drawn(spec).map((line) => ({
          label: line.label,
          scale: line.right ? "right" : "y",
          stroke: () => colour(line.ink),
          width: line.right ? 0.7 : 1.6,
          dash: line.dash,
          points: { show: false },
        })),
        ...spec.lines.flatMap((line) => (line.spread ? [end(line), end(line)] : [])),
      ],
    };
  }

  private unitSwitch(): HTMLElement {
    const made = button(this.degrees ? "°" : "rad", "Angles in degrees or in radians", () => {
      this.degrees = !this.degrees;
      this.build();
      this.mark(this.now);
    });
    made.id = "degrees";
    return made;
  }
}

/** Lines in drawing order: residuals are below the other lines. */
const drawn = ({ lines }: PlotSpec) => [...lines.filter((line) => line.right), ...lines.filter((line) => !line.right)];

/** Legend with each line once. */
function legend(specs: PlotSpec[]): HTMLElement[] {
  const seen = new Map<string, HTMLElement>();
  for (const { lines } of specs)
    for (const { label, ink, dash, right, spread } of lines) {
      const words = `${label}${right ? " (right)" : ""}${spread ? " ± 2 sd" : ""}`;
      const line = `border-top:2px ${dash ? "dashed" : "solid"} var(--${ink})`;
      if (!seen.has(words)) seen.set(words, element("span", { class: "entry" }, element("i", { style: line }), words));
    }
  return [...seen.values()];
}
