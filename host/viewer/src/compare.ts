// Two flights beside each other: both bodies in one picture, joints and channels over each other.

import { allAsShown, sense, unwrapped, unwrappedBeside } from "./channels";
import { chooser } from "./chooser";
import { type Columns, unpack } from "./data";
import { button, element } from "./dom";
import { savePng, saveSvg } from "./exports";
import type { Picture, Pose, Segments } from "./figure";
import { CAMERA_KEYS, help } from "./help";
import { Moment } from "./moment";
import { Notes } from "./notes";
import { PLAYER_KEYS, Player, type Scene } from "./player";
import { type PlotSpec, Plots } from "./plots";
import { doubts, provenance, shell } from "./shell";
import { Stage } from "./stage";
import { type Beside, CHANNELS, type PageData } from "./types";
import { unitChoice } from "./unit-choice";
import { VideoBeside } from "./video";

const INKS = ["simulated", "measured"];
/** Depth of the drawn ground below the lowest point (m). */
const GROUND_BELOW = 800;

export async function compare(data: PageData, beside: Beside): Promise<void> {
  new Compare(data, beside, await unpack(beside.series));
  document.documentElement.dataset.ready = "compare";
}

class Compare implements Scene {
  private readonly time: Float64Array;
  private readonly stage: Stage;
  private readonly plots: Plots;
  private readonly player: Player;
  private readonly notes: Notes;
  private readonly video: VideoBeside;

  constructor(
    data: PageData,
    private readonly beside: Beside,
    private readonly columns: Columns,
  ) {
    const { header, main, aside, footer } = shell(data);
    this.time = this.list("time_s")[0];
    const [a, b] = beside.people;
    this.stage = new Stage(main, a, true, b);
    const heights = [...this.list("a_position_m")[2], ...this.list("b_position_m")[2]];
    this.stage.drawer.ground = heights.reduce((low, height) => Math.min(low, height)) - GROUND_BELOW;
    this.stage.listenToKeys();
    const [x, y, z] = this.list("a_position_m");
    this.stage.drawer.setTrail(x, y, z);
    const seek = (to: number) => this.player.seek(to);
    aside.append(...doubts(beside.people), words(beside, seek));
    const specs = this.specs();
    const room = () => aside.clientHeight - 8;
    this.plots = new Plots({ place: aside, time: this.time, seek, room }, specs);
    this.video = new VideoBeside(data.video);
    main.append(this.video.place);
    this.notes = new Notes(data, this.video, () => this.player.time, seek);
    aside.append(chooser(specs, this.plots), this.notes.place, provenance(data));
    this.player = new Player(footer, this.time[0], this.time[this.time.length - 1], this);
    const name = data.title || "compare";
    header.append(
      element("span", { style: "flex:1" }),
      unitChoice(),
      this.video.button,
      button("SVG", "The plots as one figure", () => saveSvg(name, this.time, this.plots.specs)),
      button("PNG", "The picture", () => savePng(name, this.stage.drawer.canvas)),
      help(["Time", PLAYER_KEYS], ["Picture", CAMERA_KEYS]),
    );
    this.player.seek(beside.begins_s[0] ?? this.player.begin);
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
    this.video.follow(time, pace);
    this.stage.draw(this.picture(time));
    this.plots.mark(time);
  }

  private list(name: string): Float64Array[] {
    return this.columns.get(name) ?? [];
  }

  private picture(time: number): Picture {
    const now = new Moment(this.columns, time);
    const pose = (side: string): Pose => ({
      position: now.vector(`${side}_position_m`),
      attitude: now.quaternion(`${side}_attitude`),
    });
    const segments = (side: string): Segments => {
      const each = <V>(value: (segment: number) => V) => this.beside.people[0].shapes.map((_, k) => value(k));
      return {
        attitude: each((k) => now.quaternion(`${side}_segment_attitude`, 4 * k)),
        cg: each((k) => now.vector(`${side}_segment_cg_m`, 3 * k)),
        force: each((k) => now.vector(`${side}_segment_force_n`, 3 * k)),
      };
    };
    return {
      simulated: pose("a"),
      measured: pose("b"),
      segments: segments("a"),
      other: segments("b"),
      cg: [0, 0, 0],
      wind: this.beside.air_velocity_mps,
    };
  }

  private specs(): PlotSpec[] {
    const names = this.beside.people.map((person) => person.name);
    const pair = (values: ArrayLike<number>[]) =>
      values.map((list, k) => ({
        label: `${"AB"[k]} ${names[k]}`,
        ink: INKS[k],
        dash: k ? [6, 3] : undefined,
        values: list,
      }));
    const angles = this.beside.angles.map(({ name, least_named_rad: least }, k): PlotSpec => {
      const [a, b] = ["a_angles", "b_angles"].map((side) => this.list(side)[k]);
      const [one, two] = pair([a, b]);
      return {
        key: `angle-${k}`,
        title: name,
        unit: "rad",
        note: "band: what the suits explain",
        lines: [{ ...one, spread: a.map(() => least) }, two],
      };
    });
    const channels = CHANNELS.map(({ key, label, unit, angle }, k): PlotSpec => {
      const [a, b] = ["a_channels", "b_channels"].map((side) => this.list(side)[k]);
      const both = angle ? [unwrapped(a), unwrappedBeside(b, a)] : [a, b];
      return { key, title: label, unit, note: sense(k), lines: pair(both.map((values) => allAsShown(k, values))) };
    });
    return [...angles, ...channels];
  }
}

/** What the comparison says; a click goes to where the difference begins. */
function words(beside: Beside, seek: (time: number) => void): HTMLElement {
  const [first, ...rest] = beside.words;
  const items = rest.map((text) => {
    const from = /from (-?[\d.]+) s/.exec(text)?.[1];
    const item = element("li", {}, text, " ");
    if (from) item.append(button("show", `Go to ${from} s`, () => seek(Number(from))));
    return item;
  });
  return element(
    "section",
    { id: "words" },
    element("h2", {}, "Differences of B from A"),
    element("p", {}, first),
    element("ol", {}, ...items),
  );
}
