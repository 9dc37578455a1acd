// Exports the selected plots as one SVG, in the displayed units.
import { colour } from "./dom";
import type { Line, PlotSpec } from "./plots";
import { part, STRIP } from "./strip";
import { span, ticks, written } from "./ticks";
import { shown } from "./units";

const [WIDTH, EACH, LEFT, RIGHT] = [900, 150, 70, 840];
const HEAD = 60;

const clean = (text: string) => text.replace(/[<&>"]/g, (c) => `&#${c.charCodeAt(0)};`);

/** Points of the polylines of a line, which is split at NaN. */
function parts(line: Line, place: (row: number) => string): string[] {
  const made: string[][] = [[]];
  for (let row = 0; row < line.values.length; row++) {
    if (Number.isNaN(line.values[row])) made.push([]);
    else made[made.length - 1].push(place(row));
  }
  return made.filter((part) => part.length > 1).map((part) => part.join(" "));
}

function axis(low: number, high: number, y: (value: number) => string, right: boolean): string {
  const { values, decimals } = ticks(low, high, right ? 3 : 5);
  const [x, anchor] = right ? [RIGHT + 6, "start"] : [LEFT - 6, "end"];
  return values
    .map((value) => {
      const grid = right
        ? ""
        : `<path d="M${LEFT} ${y(value)}H${RIGHT}" stroke="${colour("line")}" stroke-width="0.5"/>`;
      return `${grid}<text x="${x}" y="${(Number(y(value)) + 4).toFixed(2)}" text-anchor="${anchor}">${written(value, decimals)}</text>`;
    })
    .join("");
}

function panel(spec: PlotSpec, row: number, time: ArrayLike<number>, last: boolean): string {
  const { unit, factor, least } = shown(spec.unit);
  const [top, bottom] = [HEAD + row * EACH + 20, HEAD + (row + 1) * EACH - 12];
  const [from, to] = [time[0], time[time.length - 1]];
  const x = (t: number) => (LEFT + ((t - from) / (to - from || 1)) * (RIGHT - LEFT)).toFixed(2);
  const isDivided = spec.lines.some((line) => line.right);
  const drawn = [false, true].map((right) => {
    const lines = spec.lines.filter((line) => Boolean(line.right) === right);
    if (lines.length === 0) return "";
    const [low, high] = span(
      lines.map((line) => line.values),
      least / factor,
    );
    const [under, over] = part(isDivided, right);
    const y = (value: number) => {
      const share = under + ((value / factor - low) / (high - low)) * (over - under);
      return (bottom - share * (bottom - top)).toFixed(2);
    };
    const curves = lines.map((line) => {
      const dash = line.dash ? ` stroke-dasharray="${line.dash}"` : "";
      return parts(line, (k) => `${x(time[k])},${y(line.values[k] * factor)}`)
        .map(
          (points) =>
            `<polyline fill="none" stroke="${colour(line.ink)}"${dash} points="${points}"><title>${clean(line.label)}</title></polyline>`,
        )
        .join("");
    });
    return axis(low * factor, high * factor, y, right) + curves.join("");
  });
  const divide = bottom - STRIP * (bottom - top);
  if (isDivided) drawn.push(`<path d="M${LEFT} ${divide.toFixed(2)}H${RIGHT}" stroke="${colour("faint")}"/>`);
  const seconds = ticks(from, to, 8);
  const below = seconds.values
    .map((value) => {
      const mark = `<path d="M${x(value)} ${bottom}v4" stroke="${colour("faint")}"/>`;
      const label = `<text x="${x(value)}" y="${bottom + 17}" text-anchor="middle">${written(value, seconds.decimals)}</text>`;
      return mark + (last ? label : "");
    })
    .join("");
  return (
    `<rect x="${LEFT}" y="${top}" width="${RIGHT - LEFT}" height="${bottom - top}" fill="none" stroke="${colour("faint")}"/>` +
    `<text x="${LEFT}" y="${top - 5}" font-weight="bold">${clean(spec.title)} (${clean(unit)})</text>${drawn.join("")}${below}`
  );
}

/** Legend with each line once. */
function legend(specs: PlotSpec[]): string {
  const names = new Map(specs.flatMap(({ lines }) => lines.map((line) => [line.label, line] as const)));
  let x = LEFT;
  return [...names.values()]
    .map((line) => {
      const dash = line.dash ? ` stroke-dasharray="${line.dash}"` : "";
      const words = `${line.label}${line.right ? " (below)" : ""}`;
      const made = `<path d="M${x} 40h24" stroke="${colour(line.ink)}" stroke-width="2"${dash}/><text x="${x + 30}" y="44">${clean(words)}</text>`;
      x += 46 + 7 * words.length;
      return made;
    })
    .join("");
}

export function svg(title: string, time: ArrayLike<number>, specs: PlotSpec[]): string {
  const height = HEAD + specs.length * EACH + 34;
  const panels = specs.map((spec, row) => panel(spec, row, time, row === specs.length - 1));
  return (
    `<svg xmlns="http://www.w3.org/2000/svg" width="${WIDTH}" height="${height}" viewBox="0 0 ${WIDTH} ${height}" font-family="sans-serif" font-size="12">` +
    `<rect width="100%" height="100%" fill="${colour("back")}"/><g fill="${colour("text")}"><text x="${LEFT}" y="22" font-size="15">${clean(title)}</text>${legend(specs)}${panels.join("")}` +
    `<text x="${(LEFT + RIGHT) / 2}" y="${height - 8}" text-anchor="middle">time (s)</text></g></svg>`
  );
}
