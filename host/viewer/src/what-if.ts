// What if: joints, mass and area of the flight shown changed by sliders, and what the changes do.
import { type ChangedFlight, type Changes, type JointChange, Simulator } from "./changed";
import { asShown } from "./channels";
import { button, element } from "./dom";
import type { Flight } from "./flight";
import { written } from "./ticks";
import { shown } from "./units";

const DEGREES = 180 / Math.PI;
/** Largest change of a joint (degrees). */
const MOST = 90;
/** Most joints at once, as in the core. */
const JOINTS = 16;
/** Ranges of the factors on mass and area: those of the effects of the same names. */
const [MASS, AREA] = [
  [0.6, 1.7],
  [0.5, 2],
];

export class WhatIf {
  readonly place = element("details", { class: "choose", id: "what-if" });
  private readonly joint: HTMLSelectElement;
  private readonly bend = slider("joint", -MOST, MOST, 1);
  private readonly windowed = element("input", { type: "checkbox", id: "windowed" });
  private readonly mass = slider("mass", MASS[0], MASS[1], 0.01);
  private readonly area = slider("area", AREA[0], AREA[1], 0.01);
  private readonly inputs = element("input", { type: "checkbox", id: "without-inputs" });
  private readonly said = element("p", { id: "what-if-said", role: "status" });
  private readonly command = element("code", { id: "what-if-command" });
  private readonly joints = new Map<number, JointChange>();
  private simulator: Promise<Simulator> | null = null;
  private due = false;

  constructor(
    private readonly flight: Flight,
    private readonly range: () => [number, number],
    private readonly act: (changed: ChangedFlight | null) => void,
  ) {
    const { angles, full_rate: full } = flight.run;
    this.place.append(element("summary", {}, "what if"));
    const words = angles.map(({ name, joint }) => `${joint} (${name})`);
    this.joint = element(
      "select",
      { "aria-label": "joint", id: "what-if-joint" },
      ...words.map((name, k) => element("option", { value: String(k) }, name)),
    );
    const why = full?.model ? null : (full?.no_model ?? "the page was written with --light");
    if (why !== null) {
      this.place.append(element("p", { class: "faint" }, `This flight cannot be changed here: ${why}.`));
      return;
    }
    this.build();
  }

  private build(): void {
    const knee = this.flight.run.angles.findIndex(({ name }) => name === "l_shank.bend");
    this.joint.value = String(Math.max(0, knee));
    this.joint.addEventListener("change", () => this.show());
    this.bend.input.addEventListener("input", () => this.turn());
    this.windowed.addEventListener("change", () => this.turn());
    for (const input of [this.mass.input, this.area.input]) {
      input.value = "1";
      input.addEventListener("input", () => this.changed());
    }
    this.inputs.addEventListener("change", () => this.changed());
    this.place.append(
      element("div", { class: "joints" }, this.joint, this.bend.place),
      element("label", {}, this.windowed, " only in the time range of the plots"),
      element("div", { class: "joints" }, this.mass.place, this.area.place),
      element("label", {}, this.inputs, " without the known inputs"),
      element(
        "div",
        {},
        button("reset changes", "The flight as recorded", () => this.reset()),
      ),
      this.said,
      this.command,
    );
    this.show();
  }

  /** What is changed, or null if nothing is. */
  get changes(): Changes | null {
    const [massFactor, areaFactor] = [Number(this.mass.input.value), Number(this.area.input.value)];
    const withoutInputs = this.inputs.checked;
    const joints = [...this.joints.values()];
    const isNone = joints.length === 0 && massFactor === 1 && areaFactor === 1 && !withoutInputs;
    return isNone ? null : { joints, massFactor, areaFactor, withoutInputs };
  }

  private get index(): number {
    return Number(this.joint.value);
  }

  private turn(): void {
    const by = Number(this.bend.input.value) / DEGREES;
    const [from, to] = this.range();
    const window: [number, number] | null =
      this.windowed.checked && Number.isFinite(from) ? [Number(from.toFixed(2)), Number(to.toFixed(2))] : null;
    if (by === 0) this.joints.delete(this.index);
    else if (this.joints.has(this.index) || this.joints.size < JOINTS)
      this.joints.set(this.index, { index: this.index, by, window });
    this.changed();
  }

  private reset(): void {
    this.joints.clear();
    this.mass.input.value = this.area.input.value = "1";
    this.inputs.checked = this.windowed.checked = false;
    this.changed();
  }

  private changed(): void {
    this.show();
    if (this.due) return;
    this.due = true;
    // A slider that is dragged changes more often than a flight can be simulated.
    setTimeout(() => {
      this.due = false;
      this.simulate().catch((error: unknown) => {
        this.said.textContent = String(error);
      });
    }, 30);
  }

  private async simulate(): Promise<void> {
    const { changes, flight } = this;
    if (!changes) {
      this.said.textContent = "";
      this.act(null);
      return;
    }
    this.simulator ??= this.prepare();
    const changed = (await this.simulator).run(changes);
    this.act(changed);
    this.said.textContent = told(changed, flight);
  }

  private async prepare(): Promise<Simulator> {
    const { flight } = this;
    const [columns, model] = [await flight.atFullRate(), flight.run.full_rate?.model];
    if (!columns || !model) throw new Error("The page has no data for changes.");
    return new Simulator(flight, columns, model);
  }

  private show(): void {
    const joint = this.joints.get(this.index);
    const degrees = (joint?.by ?? 0) * DEGREES;
    this.bend.input.value = String(Math.round(degrees));
    this.windowed.checked = joint ? joint.window !== null : this.windowed.checked;
    this.bend.value.textContent = `${written(degrees, 0)}°`;
    const kilograms = (this.flight.run.full_rate?.model?.mass_kg ?? 0) * Number(this.mass.input.value);
    this.mass.value.textContent = `${written(kilograms, 1)} kg`;
    this.area.value.textContent = `${written(100 * Number(this.area.input.value), 0)} %`;
    this.command.textContent = this.changes ? command(this.changes, this.flight) : "";
  }
}

/** A labelled slider with its value. */
function slider(name: string, low: number, high: number, step: number) {
  const input = element("input", {
    type: "range",
    min: String(low),
    max: String(high),
    step: String(step),
    id: `what-if-${name}-value`,
    "aria-label": name,
  });
  const value = element("output");
  const words = name === "joint" ? "further by " : `${name} `;
  return { input, value, place: element("label", {}, words, input, " ", value) };
}

/** What the changes do, in words. */
function told({ turn, fall, diverged }: ChangedFlight, flight: Flight): string {
  if (diverged !== null)
    return `The simulation diverges at ${diverged.toFixed(2)} s: nothing after that means anything.`;
  const duration = flight.end - flight.time[0];
  const rate = shown("rad/s");
  const [before, after] = turn.map((value) => asShown(3, value) * rate.factor);
  const speed = shown("m/s");
  const falls = fall.map((value) => value * speed.factor);
  const number = (value: number) => written(value, 1);
  return (
    `Over ${duration.toFixed(1)} s: turn rate ${number(before)} → ${number(after)} ${rate.unit} to the right, ` +
    `fall rate ${number(falls[0])} → ${number(falls[1])} ${speed.unit}. The person does not react to the changes.`
  );
}

/** The command that simulates the same, for a program that has the recording. */
function command({ joints, massFactor, areaFactor, withoutInputs }: Changes, flight: Flight): string {
  const degrees = (by: number) => `${by > 0 ? "+" : ""}${Math.round(by * DEGREES)}`;
  const words = joints.map(({ index, by, window }) => {
    const when = window ? `@${window[0]}..${window[1]}` : "";
    return `--joint ${flight.run.angles[index].name}=${degrees(by)}${when}`;
  });
  if (withoutInputs) words.push("--inputs none");
  const effects: string[] = [];
  if (massFactor !== 1) effects.push(`mass: factor ${massFactor}`);
  if (areaFactor !== 1) effects.push(`drag, lift and moment: all factors ${areaFactor}`);
  if (effects.length) words.push(`--model model.toml (effects ${effects.join("; ")})`);
  return `bodyflight simulate FLIGHT ${words.join(" ")}`;
}
