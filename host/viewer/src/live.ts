// Live: what bodyflight stream --view sends while it streams.
import type { FlyData, PageData } from "./data";
import { button, element } from "./dom";
import { Layout } from "./layout";
import { type PlotSpec, Plots } from "./plots";
import { provenance, shell } from "./shell";
import { Stage } from "./stage";

/** See Live in host/src/unit/stream/report.rs. */
interface Look {
  time_s: number;
  sent: number;
  estimates: number;
  latency_ms: number | null;
  missing: number;
  dropped: number;
  deadline_missed: number;
  estimate: { state: number[]; variance: number[]; nis: number } | null;
}

/** Looks that are kept, to scroll back. */
const KEPT = 30 * 60 * 10;
const STATES = ["muscle pitch", "muscle yaw", "muscle roll", "damping pitch", "damping yaw", "damping roll"];

export function live(data: PageData): void {
  const layoutData = data.fly as FlyData;
  const { header, main, aside, footer } = shell(data);
  const layout = new Layout(layoutData);
  const stage = new Stage(main, layoutData.shapes);
  stage.listenToKeys();
  const looks: Look[] = [];
  const frames: Float32Array[] = [];
  let paused = false;
  let shown = 0;
  let arrived: number[] = [];

  const numbers = element("dl", { id: "numbers" });
  const state = element("span", { id: "state", role: "status" }, "waiting for the stream");
  const slider = element("input", { type: "range", min: "0", max: "0", value: "0", "aria-label": "look back" });
  const hold = button("pause", "Stop the picture; the stream goes on", () => follow(!paused));
  slider.addEventListener("input", () => {
    follow(true);
    shown = Number(slider.value);
    dirty = true;
  });
  header.append(state);
  const cost = element("span", { class: "faint", id: "cost" });
  footer.append(hold, slider, cost);
  const place = element("div");
  aside.append(numbers, place, provenance(data));

  let time = new Float64Array(0);
  const lists = STATES.map(() => ({ value: [] as number[], low: [] as number[], high: [] as number[] }));
  const latency: number[] = [];
  const specs: PlotSpec[] = [
    {
      key: "latency",
      title: "latency",
      unit: "ms",
      lines: [{ label: "sample to estimate", ink: "measured", values: latency }],
    },
    ...STATES.map(
      (name, k): PlotSpec => ({
        key: name,
        title: name,
        unit: "1, \u00b1 2 sigma",
        lines: [
          { label: "estimate", ink: "simulated", values: lists[k].value },
          { label: "- 2 sigma", ink: "residual", dash: [3, 3], values: lists[k].low },
          { label: "+ 2 sigma", ink: "residual", dash: [3, 3], values: lists[k].high },
        ],
      }),
    ),
  ];
  let plots: Plots | null = null;
  let dirty = false;
  let plotted = 0;

  function follow(stop: boolean): void {
    paused = stop;
    hold.textContent = paused ? "go on" : "pause";
    dirty = true;
  }

  function take(look: Look): void {
    if (looks.length >= KEPT) {
      looks.shift();
      frames.shift();
      latency.shift();
      lists.forEach((list) => {
        list.value.shift();
        list.low.shift();
        list.high.shift();
      });
    }
    looks.push(look);
    latency.push(look.latency_ms ?? NaN);
    lists.forEach((list, k) => {
      const value = look.estimate?.state[k] ?? NaN;
      const sigma = Math.sqrt(look.estimate?.variance[k] ?? NaN);
      list.value.push(value);
      list.low.push(value - 2 * sigma);
      list.high.push(value + 2 * sigma);
    });
    const now = performance.now();
    arrived = [...arrived.filter((moment) => now - moment < 2000), now];
    dirty = true;
  }

  const socket = new WebSocket(`ws://${location.host}${location.pathname}socket`);
  socket.binaryType = "arraybuffer";
  socket.onopen = () => {
    state.textContent = "streaming";
  };
  socket.onclose = () => {
    state.textContent = "the stream has ended; look back with the slider";
  };
  socket.onmessage = (event) => {
    if (event.data instanceof ArrayBuffer) frames.push(new Float32Array(event.data));
    else take(JSON.parse(String(event.data)) as Look);
  };

  function show(now: number): void {
    const look = looks[shown];
    const frame = frames[Math.min(shown, frames.length - 1)];
    if (frame) stage.draw(layout.picture(frame));
    const rate = arrived.length / 2;
    const rows: [string, string][] = [
      ["time", `${look.time_s.toFixed(1)} s`],
      ["samples sent", String(look.sent)],
      ["estimates", String(look.estimates)],
      ["latency", look.latency_ms === null ? "none yet" : `${look.latency_ms.toFixed(2)} ms`],
      ["missing", String(look.missing)],
      ["dropped", String(look.dropped)],
      ["deadlines missed", String(look.deadline_missed)],
      ["NIS", look.estimate ? look.estimate.nis.toFixed(2) : ""],
      ["frames a second", rate.toFixed(1)],
    ];
    numbers.replaceChildren(
      ...rows.flatMap(([name, value]) => [
        element("dt", {}, name),
        element("dd", { id: name.replaceAll(" ", "-") }, value),
      ]),
    );
    cost.textContent = `${stage.cost.toFixed(1)} ms to draw`;
    // Plots are slower than the picture: twice a second.
    if (now - plotted > 500) {
      plotted = now;
      time = Float64Array.from(looks, (entry) => entry.time_s);
      if (plots) plots.update(time);
      else if (time.length > 1) plots = new Plots(place, time, specs, () => {});
      plots?.mark(look.time_s);
    }
  }

  function next(now: number): void {
    if (dirty && looks.length > 0) {
      dirty = false;
      slider.max = String(looks.length - 1);
      if (!paused) shown = looks.length - 1;
      shown = Math.min(shown, looks.length - 1);
      slider.value = String(shown);
      show(now);
    }
    requestAnimationFrame(next);
  }
  document.documentElement.dataset.ready = "live";
  requestAnimationFrame(next);
}
