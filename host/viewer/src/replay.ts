// Replay: one timeline for the body, the plots and the exports.
import { CHANNELS, type PageData } from "./data";
import { discoveryPanel } from "./discovery";
import { button, element, typing } from "./dom";
import { film, saveCsv, savePng, saveSvg, strip } from "./exports";
import { Flight } from "./flight";
import { TopView } from "./map";
import { type PlotSpec, Plots } from "./plots";
import { provenance, shell } from "./shell";
import { Stage } from "./stage";

const SPEEDS = [0.1, 0.25, 0.5, 1, 2];
/** Pictures of a strip. */
const SNAPSHOTS = 5;
const INKS = ["simulated", "second", "text"];
const INPUTS = [
  ["muscle pitch", "muscle yaw", "muscle roll"],
  ["damping pitch", "damping yaw", "damping roll"],
];

export async function replay(data: PageData): Promise<void> {
  const flights = await Promise.all(data.runs.map((run) => Flight.of(run)));
  const first = flights[0];
  const { header, main, aside, footer } = shell(data);
  const stage = new Stage(main, first.run.shapes);
  stage.addGhostTools();
  stage.listenToKeys();
  const map = new TopView();
  main.append(element("div", { class: "over top" }, map.canvas));
  const legend = element("div", { class: "over legend", id: "legend" });
  main.append(legend);

  let shown = first;
  let time = first.time[0];
  let playing = false;
  let speed = 1;
  const end = Math.max(...flights.map((flight) => flight.end));

  if (data.discovery) aside.append(discoveryPanel(data.discovery, (to) => seek(to)));
  const specs = plotSpecs(flights);
  const plots = new Plots(aside, first.time, specs, (to) => seek(to));
  aside.append(summary(flights), provenance(data));

  const slider = element("input", {
    type: "range",
    min: String(first.time[0]),
    max: String(end),
    step: "any",
    "aria-label": "time",
  });
  const clock = element("output", { id: "time" });
  const play = button("play", "Play or pause (space)", () => (playing ? pause() : start()));
  const pace = element(
    "select",
    { title: "Playback speed ([ and ])", "aria-label": "playback speed" },
    ...SPEEDS.map((value) => element("option", { value: String(value) }, `${value}x`)),
  );
  pace.value = "1";
  pace.addEventListener("change", () => {
    speed = Number(pace.value);
  });
  slider.addEventListener("input", () => seek(Number(slider.value)));
  const cost = element("span", {
    class: "faint",
    id: "cost",
    title: "time from one picture to the next, and to draw one",
  });
  footer.append(play, slider, clock, pace, cost);

  if (flights.length > 1) {
    const choice = element(
      "select",
      { "aria-label": "run shown", id: "run" },
      ...flights.map((flight, k) => element("option", { value: String(k) }, flight.run.name)),
    );
    choice.addEventListener("change", () => {
      shown = flights[Number(choice.value)];
      show();
      trail();
    });
    header.append(choice);
  }
  const name = data.title || "flight";
  let stop: (() => void) | null = null;
  const filming = button("WebM", "Film the picture; again to stop", () => {
    if (stop) {
      stop();
      stop = null;
      filming.removeAttribute("aria-pressed");
      return;
    }
    stop = film(name, stage.drawer.canvas);
    if (stop) {
      filming.setAttribute("aria-pressed", "true");
      start();
    }
  });
  header.append(
    element("span", { style: "flex:1" }),
    button("CSV", "Numbers of the part of time that the plots show", () => saveCsv(name, shown, plots.range())),
    button("SVG", "All plots as one figure", () => saveSvg(name, first.time, specs)),
    button("PNG", "The picture", () => savePng(name, stage.drawer.canvas)),
    button("strip", `${SNAPSHOTS} pictures over the time that the plots show`, () => {
      const [from, to] = plots.range();
      const [a, b] = [Math.max(from, first.time[0]), Math.min(to, end)];
      const times = Array.from({ length: SNAPSHOTS }, (_, k) => a + ((b - a) * k) / (SNAPSHOTS - 1));
      const back = time;
      savePng(`${name}-strip`, strip(stage, times, seek));
      seek(back);
    }),
    filming,
  );

  function trail(): void {
    const [x, y, z] = shown.list("simulated_position_m");
    stage.drawer.setTrail(x, y, z);
  }

  function show(): void {
    const picture = shown.picture(time);
    stage.draw(picture);
    plots.mark(time);
    slider.value = String(time);
    clock.textContent = `${time.toFixed(3)} s`;
    const row = shown.row(time);
    const [simulated, measured] = [shown.list("simulated"), shown.list("measured")];
    legend.replaceChildren(
      ...[5, 6, 3].map((k) =>
        element(
          "div",
          {},
          `${CHANNELS[k].label}: ${simulated[k][row].toFixed(2)} (measured ${measured[k][row].toFixed(2)}) ${CHANNELS[k].unit}`,
        ),
      ),
    );
    const way = (column: string, ink: string) => ({ north: shown.list(column)[0], west: shown.list(column)[1], ink });
    map.draw(
      [way("measured_position_m", "measured"), way("simulated_position_m", "simulated")],
      [picture.simulated.position[0], picture.simulated.position[1]],
    );
  }

  function seek(to: number): void {
    time = Math.max(first.time[0], Math.min(end, to));
    show();
    history.replaceState(null, "", `#t=${time.toFixed(3)}`);
  }

  function start(): void {
    if (time >= end) time = first.time[0];
    playing = true;
    play.textContent = "pause";
    let before = performance.now();
    const next = (now: number) => {
      if (!playing) return;
      time = Math.min(end, time + ((now - before) / 1000) * speed);
      cost.textContent = `${(now - before).toFixed(1)} ms, ${stage.cost.toFixed(1)} ms`;
      before = now;
      show();
      if (time >= end) pause();
      else requestAnimationFrame(next);
    };
    requestAnimationFrame(next);
  }

  function pause(): void {
    playing = false;
    play.textContent = "play";
    history.replaceState(null, "", `#t=${time.toFixed(3)}`);
  }

  const keys: Record<string, (event: KeyboardEvent) => void> = {
    " ": () => (playing ? pause() : start()),
    ArrowRight: (event) => seek(time + (event.shiftKey ? 1 : 1 / 30)),
    ArrowLeft: (event) => seek(time - (event.shiftKey ? 1 : 1 / 30)),
    ".": () => seek(time + 1 / 30),
    ",": () => seek(time - 1 / 30),
    Home: () => seek(first.time[0]),
    End: () => seek(end),
    "[": () => faster(-1),
    "]": () => faster(1),
  };
  function faster(by: number): void {
    const place = Math.max(0, Math.min(SPEEDS.length - 1, SPEEDS.indexOf(speed) + by));
    speed = SPEEDS[place];
    pace.value = String(speed);
  }
  addEventListener("keydown", (event) => {
    const act = keys[event.key];
    if (!act || typing(event) || event.ctrlKey || event.metaKey) return;
    // A focused button keeps its space bar.
    if (event.key === " " && (event.target as HTMLElement).tagName === "BUTTON") return;
    event.preventDefault();
    act(event);
  });

  trail();
  seek(Number(/#t=([\d.]+)/.exec(location.hash)?.[1] ?? first.time[0]));
  document.documentElement.dataset.ready = "replay";
}

function plotSpecs(flights: Flight[]): PlotSpec[] {
  const first = flights[0];
  const channels = CHANNELS.map(
    ({ key, label, unit }, k): PlotSpec => ({
      key,
      title: label,
      unit,
      note: flights.map((flight) => `RMS ${flight.run.rms[key]?.toFixed(3)}`).join(", "),
      lines: [
        { label: "measured", ink: "measured", values: first.list("measured")[k] },
        ...flights.map((flight, n) => ({
          label: n === 0 ? "simulated" : flight.run.name,
          ink: INKS[n % INKS.length],
          dash: [6, 3 + 3 * n],
          values: alike(flight, flight.list("simulated")[k], first),
        })),
        { label: "residual", ink: "residual", values: first.residual(k) },
      ],
    }),
  );
  const inputs = INPUTS.map(
    (names, group): PlotSpec => ({
      key: group === 0 ? "muscle" : "damping",
      title: group === 0 ? "muscle input" : "damping coefficients",
      unit: "1",
      lines: names.map((label, k) => ({
        label,
        ink: ["measured", "simulated", "second"][k],
        dash: k ? [6, 3 * k] : undefined,
        values: first.list("inputs")[3 * group + k],
      })),
    }),
  );
  return [...channels, ...inputs];
}

/** Numbers of a flight at the times of another. */
function alike(flight: Flight, values: Float64Array, other: Flight): Float64Array {
  return flight === other ? values : other.time.map((time) => values[flight.row(time)]);
}

/** The numbers that a coach asks for. */
function summary(flights: Flight[]): HTMLElement {
  const names = ["", ...flights.map((flight) => flight.run.name)];
  const table = element("table", {}, element("tr", {}, ...names.map((name) => element("th", {}, name))));
  const row = (label: string, value: (flight: Flight) => string) =>
    table.append(
      element("tr", {}, element("td", {}, label), ...flights.map((flight) => element("td", {}, value(flight)))),
    );
  const mean = (list: Float64Array) => list.reduce((sum, value) => sum + value, 0) / list.length;
  const most = (list: Float64Array) => list.reduce((high, value) => Math.max(high, Math.abs(value)), 0);
  row("length (s)", (flight) => (flight.end - flight.time[0]).toFixed(1));
  row("fall rate, measured (m/s)", (flight) => (-mean(flight.list("measured")[6])).toFixed(1));
  row("fall rate, simulated (m/s)", (flight) => (-mean(flight.list("simulated")[6])).toFixed(1));
  row("fastest turn, measured (rad/s)", (flight) => most(flight.list("measured")[3]).toFixed(2));
  for (const { key, label, unit } of CHANNELS)
    row(`RMS ${label} (${unit})`, (flight) => flight.run.rms[key]?.toFixed(3) ?? "");
  return element("section", {}, element("h2", {}, "Summary"), table);
}
