// Plots of channels over time with a common cursor, legend and time axis.
import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";
import { rowAt } from "./data";
import { colour, element, onRecolour } from "./dom";
import { own, part, STRIP, widened } from "./strip";
import { span, ticks, written } from "./ticks";
import { type Shown, shown, units } from "./units";

export interface Line {
  label: string;
  /** Name of a colour of the style sheet. */
  ink: string;
  dash?: number[];
  values: ArrayLike<number>;
  /** Half width of a band around the values: two standard deviations. */
  spread?: ArrayLike<number>;
  /** Whether it is drawn in the strip below, with the axis on the right, as residuals are. */
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

/** Heights of titles and time axis, width of the axes, and range of heights of a plot, in sizes of the font. */
const [TITLE, TIME_AXIS, EDGE] = [1.16, 1.4, 3.4];
const [LOWEST, HIGHEST] = [3.1, 26];
/** Most ticks of the time axis. */
const TIMES = 7;
/** Size of the font of the page (px). */
const em = () => Number.parseFloat(getComputedStyle(document.body).fontSize) || 13;

export class Plots {
  plots: uPlot[] = [];
  /** Plots shown, in the selected order. */
  specs: PlotSpec[];
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
    units.onChoice(() => this.refresh());
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

  /** Draws everything again, after lines were added or units changed. */
  refresh(): void {
    this.build();
    this.mark(this.now);
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
    const [count, size] = [Math.max(1, this.specs.length), em()];
    const axis = Math.round(TIME_AXIS * size);
    const room = (this.frame.room?.() ?? 9999) - this.head.offsetHeight - axis - count * TITLE * size - 8;
    const within = Math.max(LOWEST * size, Math.min(HIGHEST * size, room / count));
    const each = Math.floor(this.frame.room ? within : 7 * size);
    return each + (k === count - 1 ? axis : 0);
  }

  private fit(): void {
    for (const [k, plot] of this.plots.entries()) plot.setSize({ width: this.width(), height: this.height(k) });
  }

  private build(): void {
    const { min, max } = this.plots[0]?.scales.x ?? {};
    for (const plot of this.plots) plot.destroy();
    [this.plots, this.marks, this.readouts] = [[], [], []];
    this.head.replaceChildren(...legend(this.specs));
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
      element("b", {}, `${spec.title} (${shown(spec.unit).unit})`),
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
    const { factor, decimals } = shown(unit);
    const size = rms && `RMS ${rms.map((value) => written(value * factor, decimals)).join(", ")}`;
    return [size, note].filter(Boolean).join(", ");
  }

  /** Shows the values of the lines at a row. */
  private read(k: number, row: number): void {
    const { factor, decimals } = this.shown(k);
    this.readouts[k]?.forEach((place, n) => {
      place.textContent = written(this.specs[k].lines[n].values[row] * factor, decimals);
    });
  }

  private shown(k: number): Shown {
    return shown(this.specs[k].unit);
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
    const { factor } = shown(spec.unit);
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
    const size = em();
    const isDivided = spec.lines.some((line) => line.right);
    const range =
      (isRight: boolean) =>
      (_: uPlot, low: number | null, high: number | null): [number, number] =>
        widened(span([[low ?? NaN, high ?? NaN]], least), part(isDivided, isRight));
    const edge = Math.round(EDGE * size);
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
      padding: [5, isDivided ? 0 : edge, 5, 0],
      cursor: { sync: { key: "time" }, drag: { x: true, y: false }, points: { size: 5 } },
      scales: { x: { time: false }, y: { range: range(false) }, right: { range: range(true) } },
      axes: axes(k === this.specs.length - 1, isDivided, size),
      legend: { show: false },
      hooks: {
        drawAxes: isDivided ? [divide] : [],
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
}

/** The values that are at least this far apart, so that their labels do not overlap; the highest is kept. */
function spaced(values: number[], apart: number): number[] {
  const kept: number[] = [];
  for (const value of values.toReversed()) if (kept.length === 0 || kept[0] - value >= apart) kept.unshift(value);
  return kept;
}

/** Axes of time, on the left, and of a divided plot on the right, for a size of the font (px). */
function axes(hasTime: boolean, isDivided: boolean, size: number): uPlot.Axis[] {
  const axis = {
    stroke: () => colour("faint"),
    grid: { stroke: () => colour("line"), width: 1 },
    ticks: { show: false },
    font: `${Math.round(0.77 * size)}px system-ui`,
    gap: 3,
  };
  const of = (most: number, within: [number, number]) => ({
    splits: (plot: uPlot, _: number, low: number, high: number) => {
      const range = own([low, high], within);
      const { values } = ticks(...range, most);
      const pixels = ((within[1] - within[0]) * plot.bbox.height) / devicePixelRatio;
      return most === TIMES ? values : spaced(values, ((range[1] - range[0]) / pixels) * 0.95 * size);
    },
    values: (plot: uPlot, splits: number[], which: number) => {
      const { min, max } = plot.scales[plot.axes[which].scale ?? "x"];
      const { decimals } = ticks(...own([min ?? 0, max ?? 1], within), most);
      return splits.map((value) => written(value, decimals));
    },
  });
  const edge = Math.round(EDGE * size);
  const left = { ...axis, ...of(4, part(isDivided, false)), size: edge, scale: "y" };
  const right = { ...axis, ...of(2, part(true, true)), size: edge, scale: "right", side: 1 as const };
  return [
    { ...axis, ...of(TIMES, [0, 1]), size: Math.round(TIME_AXIS * size), show: hasTime },
    left,
    ...(isDivided ? [{ ...right, grid: { show: false } }] : []),
  ];
}

/** Draws the line between the signal and the strip of the residuals. */
function divide(plot: uPlot): void {
  const { left, top, width, height } = plot.bbox;
  const y = Math.round(top + (1 - STRIP) * height);
  plot.ctx.fillStyle = colour("faint");
  plot.ctx.fillRect(left, y, width, devicePixelRatio);
}

/** Lines in drawing order: residuals are below the other lines. */
const drawn = ({ lines }: PlotSpec) => [...lines.filter((line) => line.right), ...lines.filter((line) => !line.right)];

/** Legend with each line once. */
function legend(specs: PlotSpec[]): HTMLElement[] {
  const seen = new Map<string, HTMLElement>();
  for (const { lines } of specs)
    for (const { label, ink, dash, right, spread } of lines) {
      const words = `${label}${right ? " (below)" : ""}${spread ? " ± 2 sd" : ""}`;
      const line = `border-top:2px ${dash ? "dashed" : "solid"} var(--${ink})`;
      if (!seen.has(words)) seen.set(words, element("span", { class: "entry" }, element("i", { style: line }), words));
    }
  return [...seen.values()];
}
