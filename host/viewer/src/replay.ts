// Replay: body, plots and exports on a common timeline.

import type { ChangedFlight } from "./changed";
import { sense } from "./channels";
import { chooser } from "./chooser";
import { rowAt } from "./data";
import { type Discovery, discoveryPanel } from "./discovery";
import { button, element, onRecolour } from "./dom";
import { film, saveCsv, savePng, saveSvg, strip } from "./exports";
import { Flight } from "./flight";
import { CAMERA_KEYS, help } from "./help";
import { Instruments, reading } from "./instruments";
import { TopView } from "./map";
import { Notes } from "./notes";
import { PLAYER_KEYS, Player, type Scene } from "./player";
import { type Line, type PlotSpec, Plots } from "./plots";
import { doubts, provenance, shell } from "./shell";
import { Stage } from "./stage";
import { written } from "./ticks";
import { CHANNELS, type PageData } from "./types";
import { unitChoice } from "./unit-choice";
import { shown as display, length, units } from "./units";
import { VideoBeside } from "./video";
import { WhatIf } from "./what-if";

/** Depth of the drawn ground below the lowest point of a flight (m). */
const GROUND_BELOW = 800;
/** Number of pictures in a strip. */
const SNAPSHOTS = 5;
const INKS = ["simulated", "second", "text"];
/** Colours of the residuals of each flight. */
const RESIDUAL_INKS = ["residual", "left", "text"];
const AXES = ["pitch", "yaw", "roll"];
const INPUTS = [
  ["muscle pitch", "muscle yaw", "muscle roll"],
  ["damping pitch", "damping yaw", "damping roll"],
];

export async function replay(data: PageData): Promise<void> {
  const flights = await Promise.all(data.runs.map((run) => Flight.of(run)));
  new Replay(data, flights).open();
  document.documentElement.dataset.ready = "replay";
}

/** The page of a replay. */
class Replay implements Scene {
  private shown: Flight;
  private readonly name: string;
  private readonly stage: Stage;
  private readonly map = new TopView();
  private readonly instruments = new Instruments();
  private readonly specs: PlotSpec[];
  private readonly plots: Plots;
  private readonly player: Player;
  private readonly notes: Notes;
  private readonly video: VideoBeside;
  private readonly summary: HTMLElement;
  /** Flights with the reader's changes. */
  private readonly changed = new Map<Flight, ChangedFlight>();
  /** Sliders of the flights that were shown; they keep their changes while another flight is. */
  private readonly sliders = new Map<Flight, WhatIf>();
  private readonly whatIf = element("div");

  constructor(
    data: PageData,
    private readonly flights: Flight[],
  ) {
    const first = flights[0];
    const { header, main, aside, footer } = shell(data);
    this.shown = first;
    this.name = data.title || "flight";
    this.stage = new Stage(main, first.run, true);
    this.stage.drawer.ground = ground(flights);
    this.stage.listenToKeys();
    this.video = new VideoBeside(data.video);
    main.append(element("div", { class: "over top" }, this.map.canvas), this.instruments.place, this.video.place);

    const seek = (to: number) => this.player.seek(to);
    aside.append(...doubts(data.runs));
    if (data.discovery) aside.append(discoveryPanel(data.discovery as Discovery, seek));
    this.specs = plotSpecs(flights);
    const room = () => aside.clientHeight - 8;
    this.plots = new Plots({ place: aside, time: first.time, seek, room }, this.specs);
    this.notes = new Notes(data, this.video, () => this.player.time, seek);
    this.summary = summary(flights);
    aside.append(chooser(this.specs, this.plots), this.whatIf, this.notes.place, this.summary, provenance(data));
    this.whatIf.append(this.slidersOf(first).place);

    const end = Math.max(...flights.map((flight) => flight.end));
    this.player = new Player(footer, first.time[0], end, this);
    onRecolour(() => {
      this.trail();
      this.player.show();
    });
    units.onChoice(() => {
      this.summary.replaceChildren(...summary(flights).children);
      this.trail();
      this.player.show();
    });
    if (flights.length > 1) header.append(this.choice());
    header.append(
      element("span", { style: "flex:1" }),
      unitChoice(),
      this.video.button,
      ...this.tools(),
      help(["Time", PLAYER_KEYS], ["Picture", CAMERA_KEYS]),
    );
  }

  /** Opens the page at the time given in the address. */
  open(): void {
    this.trail();
    this.player.seek(Number(/#t=([\d.]+)/.exec(location.hash)?.[1] ?? this.player.begin));
  }

  get cost(): number {
    return this.stage.cost;
  }

  range(): [number, number] {
    return this.plots.range();
  }

  note(): void {
    this.notes.write();
  }

  show(time: number, pace: number): void {
    const { shown } = this;
    const picture = shown.picture(time);
    const changed = this.changed.get(shown);
    if (changed) picture.changed = changed.at(time);
    this.video.follow(time, pace);
    this.stage.draw(picture);
    this.plots.mark(time);
    const row = shown.row(time);
    const at = (side: string) => reading(shown.list(side).map((channel) => channel[row]));
    const climbed = shown.list("simulated_position_m")[2];
    const height = `since the start ${length(climbed[row] - climbed[0])}`;
    this.instruments.show(at("simulated"), at("measured"), [height]);
    this.map.mark(picture.simulated.position[0], picture.simulated.position[1]);
  }

  /** Offers changes of a flight. */
  private slidersOf(flight: Flight): WhatIf {
    const known = this.sliders.get(flight);
    if (known) return known;
    const [first] = this.flights;
    const label = this.flights.length > 1 ? `with changes, ${flight.run.name}` : "with changes";
    const lines = CHANNELS.map((): Line => ({ label, ink: "second", dash: [2, 2], values: [] }));
    const whatIf = new WhatIf(
      flight,
      () => this.plots.range(),
      (changed) => {
        const was = this.changed.has(flight);
        if (changed) this.changed.set(flight, changed);
        else this.changed.delete(flight);
        for (const [k, line] of lines.entries()) {
          line.values = changed ? alike(flight, flight.beside(k, changed.channels[k]), first) : [];
          const spec = this.specs[k];
          if (changed && !was) spec.lines.splice(2, 0, line);
          if (!changed) spec.lines = spec.lines.filter((other) => other !== line);
        }
        if (was === Boolean(changed)) this.plots.update();
        else this.plots.refresh();
        this.player.show();
      },
    );
    this.sliders.set(flight, whatIf);
    return whatIf;
  }

  /** Draws the tracks of the flight shown, in the picture and on the map. */
  private trail(): void {
    const [x, y, z] = this.shown.list("simulated_position_m");
    this.stage.drawer.setTrail(x, y, z);
    const [north, west] = this.shown.list("measured_position_m");
    this.map.lay([
      { north, west, ink: "measured" },
      { north: x, west: y, ink: "simulated" },
    ]);
  }

  /** Selects the flight shown. */
  private choice(): HTMLElement {
    const choice = element(
      "select",
      { "aria-label": "flight shown", id: "run" },
      ...this.flights.map((flight, k) => element("option", { value: String(k) }, flight.run.name)),
    );
    choice.addEventListener("change", () => {
      choice.blur();
      this.shown = this.flights[Number(choice.value)];
      this.whatIf.replaceChildren(this.slidersOf(this.shown).place);
      this.trail();
      this.player.show();
    });
    return choice;
  }

  /** Export buttons. */
  private tools(): HTMLElement[] {
    const { name, plots, stage } = this;
    const first = this.flights[0];
    return [
      button("CSV", "Values in the time range of the plots", () => saveCsv(name, this.shown, plots.range())),
      button("SVG", "The plots as one figure", () => saveSvg(name, first.time, plots.specs)),
      button("PNG", "The picture", () => savePng(name, stage.drawer.canvas)),
      button("strip", `${SNAPSHOTS} snapshots over the time range of the plots`, () => this.saveStrip()),
      this.filming(),
    ];
  }

  private saveStrip(): void {
    const { player, plots } = this;
    const [from, to] = plots.range();
    const [a, b] = [Math.max(from, player.begin), Math.min(to, player.end)];
    const times = Array.from({ length: SNAPSHOTS }, (_, k) => a + ((b - a) * k) / (SNAPSHOTS - 1));
    const back = player.time;
    savePng(
      `${this.name}-strip`,
      strip(this.stage, times, (time) => player.seek(time)),
    );
    player.seek(back);
  }

  private filming(): HTMLElement {
    let stop: (() => void) | null = null;
    const filming = button("WebM", "Record a video; click again to stop", () => {
      if (stop) {
        stop();
        stop = null;
        filming.removeAttribute("aria-pressed");
        return;
      }
      stop = film(this.name, this.stage.drawer.canvas);
      if (stop) {
        filming.setAttribute("aria-pressed", "true");
        this.player.start();
      }
    });
    return filming;
  }
}

/** Height of the drawn ground, below all flights; recordings do not contain the height above ground. */
function ground(flights: Flight[]): number {
  const lowest = flights.flatMap((flight) =>
    ["simulated_position_m", "measured_position_m"].map((side) => Math.min(...flight.list(side)[2])),
  );
  return Math.min(...lowest) - GROUND_BELOW;
}

function plotSpecs(flights: Flight[]): PlotSpec[] {
  const first = flights[0];
  const channels = CHANNELS.map(
    ({ key, label, unit }, k): PlotSpec => ({
      key,
      title: label,
      unit,
      note: sense(k),
      rms: flights.map((flight) => flight.run.rms[key]),
      lines: [
        { label: "measured", ink: "measured", values: first.plotted("measured", k) },
        ...flights.map((flight, n) => ({
          label: n === 0 ? "simulated" : flight.run.name,
          ink: INKS[n % INKS.length],
          dash: [6, 3 + 3 * n],
          values: alike(flight, flight.plotted("simulated", k), first),
        })),
        ...flights.map((flight, n) => ({
          label: n === 0 ? "residual" : `residual, ${flight.run.name}`,
          ink: RESIDUAL_INKS[n % RESIDUAL_INKS.length],
          values: alike(flight, flight.residual(k), first),
          right: true,
        })),
      ],
    }),
  );
  const inputs = INPUTS.map(
    (names, group): PlotSpec => ({
      key: group === 0 ? "muscle" : "damping",
      title: group === 0 ? "muscle input" : "damping coefficients",
      unit: "1",
      // Inputs that do not change show nothing, and known ones are hidden next to estimated ones.
      aside:
        first.estimated !== null ||
        first
          .list("inputs")
          .slice(3 * group, 3 * group + 3)
          .every(isConstant),
      lines: names.map((label, k) => ({
        label: label.split(" ")[1],
        ink: AXES[k],
        dash: k ? [6, 3 * k] : undefined,
        values: first.list("inputs")[3 * group + k],
      })),
    }),
  );
  const estimated = flights.flatMap((flight) => estimates(flight, first));
  return [...channels, ...inputs, ...estimated, ...forms(flights), ...joints(first)];
}

const isConstant = (values: Float64Array) => values.every((value) => value === values[0]);

/** Load factor and normalised fall rate; hidden unless selected. */
function forms(flights: Flight[]): PlotSpec[] {
  const [first] = flights;
  const simulated = (name: string, place: number) =>
    flights.map(
      (flight, n): Line => ({
        label: n === 0 ? "simulated" : flight.run.name,
        ink: INKS[n % INKS.length],
        dash: [6, 3 + 3 * n],
        values: alike(flight, flight.list(name)[place], first),
      }),
    );
  const [measured] = first.list("normalised_fall_rate_mps");
  const rate = "normalised_fall_rate_mps";
  return [
    {
      key: "load_factor",
      title: "load factor",
      unit: "1",
      note: "aerodynamic force over weight",
      aside: true,
      lines: simulated("load_factor", 0),
    },
    {
      key: rate,
      title: "normalised fall rate",
      unit: "m/s",
      note: "standard atmosphere at 2000 m",
      aside: true,
      lines: [{ label: "measured", ink: "measured", values: measured }, ...simulated(rate, 1)],
    },
  ];
}

/** The angles of each joint; hidden unless selected. */
function joints(flight: Flight): PlotSpec[] {
  const { angles } = flight.run;
  const names = [...new Set(angles.map(({ name }) => name.split(".")[0]))];
  return names.map((joint): PlotSpec => {
    const own = angles.flatMap(({ name }, k) => (name.startsWith(`${joint}.`) ? [k] : []));
    return {
      key: `joint-${joint}`,
      title: `${angles[own[0]].joint} (${joint})`,
      unit: "rad",
      aside: true,
      lines: own.map((place, n) => ({
        label: angles[place].name.split(".")[1],
        ink: AXES[n],
        dash: n ? [6, 3 * n] : undefined,
        values: flight.list("joint_angles_rad")[place],
      })),
    };
  });
}

/** Estimates of a flight with their bands, at the times of the first flight. */
function estimates(flight: Flight, first: Flight): PlotSpec[] {
  const { estimated, run } = flight;
  if (!estimated) return [];
  const times = estimated.get("time_s")?.[0] ?? new Float64Array();
  const rows = Int32Array.from(first.time, (time) => rowAt(times, time));
  const list = (name: string, k: number) => {
    const values = estimated.get(name)?.[k] ?? new Float64Array();
    return Float64Array.from(rows, (row) => values[row] ?? NaN);
  };
  const whose = flight === first ? "" : `, ${run.name}`;
  return INPUTS.map(
    (names, group): PlotSpec => ({
      key: `estimated-${group === 0 ? "muscle" : "damping"}${whose}`,
      title: `${group === 0 ? "estimated muscle input" : "estimated damping"}${whose}`,
      unit: "1",
      note: run.estimated?.doubt ? "unreliable: see estimate" : "",
      lines: names.map((label, k) => ({
        label: label.split(" ")[1],
        ink: AXES[k],
        dash: k ? [6, 3 * k] : undefined,
        values: list("inputs", 3 * group + k),
        spread: list("deviation", 3 * group + k).map((deviation) => 2 * deviation),
      })),
    }),
  );
}

/** Values of a flight at the times of another. */
function alike(flight: Flight, values: Float64Array, other: Flight): Float64Array {
  return flight === other ? values : other.time.map((time) => values[flight.row(time)]);
}

/** Summary table. */
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
  const [speed, rate] = [display("m/s"), display("rad/s")];
  for (const side of ["measured", "simulated"])
    row(`fall rate, ${side} (${speed.unit})`, (flight) =>
      written(-mean(flight.list(side)[6]) * speed.factor, speed.decimals),
    );
  row(`fastest turn, measured (${rate.unit})`, (flight) =>
    written(most(flight.list("measured")[3]) * rate.factor, rate.decimals),
  );
  for (const { key, label, unit } of CHANNELS) {
    const { unit: name, factor, decimals } = display(unit);
    row(`RMS ${label} (${name})`, (flight) => written(flight.run.rms[key] * factor, decimals));
  }
  return element("section", {}, element("h2", {}, "Summary"), table);
}
