// Exports of a replay: CSV, SVG, PNG, WebM.

import type { Columns } from "./data";
import { save } from "./dom";
import type { Flight } from "./flight";
import type { PlotSpec } from "./plots";
import type { Stage } from "./stage";
import { svg } from "./svg";
import { CHANNELS } from "./types";

/** All channels of the rows between two times, as CSV with the columns and signs of `bodyflight simulate --out`. */
function csv(columns: Columns, [from, to]: [number, number]): string {
  const names = CHANNELS.flatMap(({ key }) => [`measured_${key}`, `simulated_${key}`]);
  const lines = [["time_s", ...names].join(",")];
  const list = (name: string) => columns.get(name) ?? [];
  const [measured, simulated, [times]] = [list("measured"), list("simulated"), list("time_s")];
  times.forEach((time, row) => {
    if (time < from || time > to) return;
    const values = CHANNELS.flatMap((_, k) => [measured[k][row], simulated[k][row]]);
    lines.push([time.toFixed(6), ...values.map((value) => value.toFixed(4))].join(","));
  });
  return `${lines.join("\n")}\n`;
}

/** Saves the channels at the rate of the recording, if the page has them. */
export async function saveCsv(name: string, flight: Flight, range: [number, number]): Promise<void> {
  const columns = (await flight.atFullRate()) ?? flight.columns;
  save(`${name}.csv`, new Blob([csv(columns, range)], { type: "text/csv" }));
}

export function saveSvg(name: string, time: ArrayLike<number>, specs: PlotSpec[]): void {
  save(`${name}.svg`, new Blob([svg(name, time, specs)], { type: "image/svg+xml" }));
}

export function savePng(name: string, canvas: HTMLCanvasElement): void {
  canvas.toBlob((blob) => blob && save(`${name}.png`, blob), "image/png");
}

/** Evenly spaced snapshots side by side, as in the paper's figures. */
export function strip(stage: Stage, times: number[], seek: (time: number) => void): HTMLCanvasElement {
  const source = stage.drawer.canvas;
  const made = document.createElement("canvas");
  const each = Math.round(source.height * 0.8);
  made.width = each * times.length;
  made.height = source.height;
  const context = made.getContext("2d");
  times.forEach((time, k) => {
    seek(time);
    context?.drawImage(source, (source.width - each) / 2, 0, each, source.height, k * each, 0, each, source.height);
    if (context) {
      context.font = `${Math.round(source.height / 25)}px sans-serif`;
      context.fillStyle = getComputedStyle(document.documentElement).getPropertyValue("--text");
      context.fillText(`${time.toFixed(1)} s`, k * each + 10, made.height - 12);
    }
  });
  return made;
}

/** Records the picture as video until the returned function is called. */
export function film(name: string, canvas: HTMLCanvasElement): (() => void) | null {
  if (typeof MediaRecorder === "undefined") return null;
  const recorder = new MediaRecorder(canvas.captureStream(30), { mimeType: "video/webm" });
  const parts: Blob[] = [];
  recorder.ondataavailable = (event) => parts.push(event.data);
  recorder.onstop = () => save(`${name}.webm`, new Blob(parts, { type: "video/webm" }));
  recorder.start();
  return () => recorder.stop();
}
