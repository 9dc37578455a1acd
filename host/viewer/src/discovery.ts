// The report of bodyflight discover: where simulation and measurement disagree, and what explains it.
import { colour, element, onRecolour } from "./dom";
import { written } from "./ticks";

// See discovery/src/report.rs.
interface Named {
  name: string;
  parameters?: Record<string, number | null>;
  standard_errors?: Record<string, number | null>;
  log_odds?: number | null;
  rivals?: { name: string; share: number }[];
  separated_by?: string;
  imitated_by_inputs?: boolean;
}
interface Gap {
  before: (number | null)[];
  after: (number | null)[];
  floor: (number | null)[];
  /** Null if there was no gap to close. */
  closed_share?: number | null;
}
export interface Discovery {
  verdict: "named" | "calibrated" | "described" | "none" | "unexplained" | "thin";
  effects?: Named[];
  nearest?: Named[];
  gap?: Gap;
  held_out?: { gap: Gap }[];
  remainders?: { is_unexplained: boolean; in_words: string }[];
  fly_next?: string;
  residual_map?: { time_s: number; over_floor: number[]; over_floor_after: number[] }[];
}

const CHANNELS = [
  "attitude x (rad)",
  "attitude y (rad)",
  "attitude z (rad)",
  "angular velocity x (rad/s)",
  "angular velocity y (rad/s)",
  "angular velocity z (rad/s)",
  "velocity north (m/s)",
  "velocity west (m/s)",
  "velocity up (m/s)",
];
const VERDICTS = {
  named: "An effect missing from the model was found.",
  calibrated: "Model and data agree once joints, subject and coefficients are adjusted within their tolerances.",
  described: "A load that is not in the library was found.",
  none: "Model and data agree within the noise, without any change.",
  unexplained: "Model and data disagree, and no effect in the library explains it.",
  thin: "The flight is too short to distinguish effects.",
};

export function discoveryPanel(report: Discovery, seek: (time: number) => void): HTMLElement {
  const panel = element(
    "section",
    { id: "discovery" },
    element("h2", {}, `Discrepancy: ${report.verdict}`),
    element("p", {}, VERDICTS[report.verdict] ?? ""),
  );
  for (const left of report.remainders ?? []) {
    if (left.is_unexplained) panel.append(element("p", {}, `Left: ${left.in_words}.`));
  }
  if (report.fly_next) panel.append(element("p", { class: "faint" }, `Fly next: ${report.fly_next}.`));
  for (const named of report.effects ?? []) panel.append(effect(named));
  for (const named of report.nearest ?? []) panel.append(element("p", {}, "closest match, not used:"), effect(named));
  const table = element(
    "table",
    { id: "gap" },
    element("tr", {}, ...["channel", "before", "after", "floor"].map((name) => element("th", {}, name))),
  );
  const { before = [], after = [], floor = [] } = report.gap ?? {};
  CHANNELS.forEach((name, k) => {
    const cells = [before, after, floor].map((list) => element("td", {}, written(list[k], 3)));
    table.append(element("tr", {}, element("td", {}, name), ...cells));
  });
  panel.append(table);
  for (const [k, flight] of (report.held_out ?? []).entries()) {
    const closed = flight.gap?.closed_share;
    const words = Number.isFinite(closed)
      ? `${((closed as number) * 100).toFixed(0)} % of the gap closed`
      : "no gap to close";
    panel.append(element("p", {}, `Held-out flight ${k + 1}: ${words}.`));
  }
  if (report.residual_map?.length) {
    panel.append(
      element(
        "p",
        { class: "faint" },
        "Misfit relative to the noise floor over time, before (line) and after (filled); click to go to a time:",
      ),
      map(report, seek),
    );
  }
  return panel;
}

function effect(named: Named): HTMLElement {
  const list = element("dl");
  for (const [name, value] of Object.entries(named.parameters ?? {})) {
    const error = named.standard_errors?.[name];
    const text = `${value?.toPrecision(3) ?? "–"}${error ? ` ± ${error.toPrecision(2)}` : ""}`;
    list.append(element("dt", {}, name), element("dd", {}, text));
  }
  if (Number.isFinite(named.log_odds))
    list.append(element("dt", {}, "log odds"), element("dd", {}, `${named.log_odds?.toFixed(1)}`));
  const part = element("div", { class: "effect" }, element("b", {}, named.name), list);
  if (named.rivals?.length) {
    const rivals = named.rivals.map((rival) => rival.name).join(", ");
    const advice = named.separated_by ? `; fly: ${named.separated_by}` : "";
    part.append(element("p", {}, `Indistinguishable from ${rivals} in this flight${advice}.`));
  }
  if (named.imitated_by_inputs)
    part.append(element("p", { class: "faint" }, "An estimator would mistake it for muscle input and damping."));
  return part;
}

function map(report: Discovery, seek: (time: number) => void): HTMLCanvasElement {
  const canvas = element("canvas", {
    class: "map",
    width: "860",
    height: "240",
    role: "img",
    "aria-label": "misfit relative to the noise floor over time",
  });
  const spots = report.residual_map ?? [];
  const end = spots[spots.length - 1].time_s || 1;
  const worst = (list: number[]) => Math.max(...list);
  const high = Math.max(...spots.map((spot) => worst(spot.over_floor)));
  const draw = () => {
    const context = canvas.getContext("2d");
    if (!context) return;
    const { width, height } = canvas;
    context.clearRect(0, 0, width, height);
    const x = (time: number) => (time / end) * (width - 10) + 5;
    // Logarithmic; 1 is the noise floor.
    const y = (value: number) =>
      height - 20 - (Math.log10(Math.max(1, value)) / Math.log10(Math.max(10, high))) * (height - 40);
    context.fillStyle = colour("second");
    context.beginPath();
    context.moveTo(x(spots[0].time_s), height - 20);
    for (const spot of spots) context.lineTo(x(spot.time_s), y(worst(spot.over_floor_after)));
    context.lineTo(x(end), height - 20);
    context.fill();
    context.strokeStyle = colour("simulated");
    context.lineWidth = 3;
    context.beginPath();
    for (const spot of spots) context.lineTo(x(spot.time_s), y(worst(spot.over_floor)));
    context.stroke();
    context.fillStyle = colour("faint");
    context.font = "18px system-ui";
    context.fillText(`${high.toFixed(0)} x`, 5, 18);
    context.fillText(`0 to ${end.toFixed(0)} s`, width - 100, height - 2);
  };
  draw();
  onRecolour(draw);
  canvas.addEventListener("click", (event) => seek((event.offsetX / canvas.clientWidth) * end));
  return canvas;
}
