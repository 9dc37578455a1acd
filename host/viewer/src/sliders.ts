// Sliders for single joints, and fields for damping.
import type { Core } from "./core";
import { button, element } from "./dom";
import { written } from "./ticks";
import type { FlyData } from "./types";

const DEGREES = 180 / Math.PI;
/** The paper's angles, and the axes of the joint's parent about which they turn. */
const ANGLES = [
  ["psi", "Z"],
  ["theta", "Y"],
  ["phi", "X"],
];

/** How much further than in its pose each joint is turned, one joint at a time. */
export class JointSliders {
  readonly place = element("section", { id: "joints" });
  private readonly joint: HTMLSelectElement;
  private readonly turned = element("span", { class: "faint", id: "turned", role: "status" });
  /** Angles of all joints (rad). */
  private angles = new Map<number, number[]>();
  private readonly sliders = ANGLES.map(([name, axis], k) => {
    const slider = element("input", {
      type: "range",
      min: "-90",
      max: "90",
      step: "1",
      "aria-label": `${name} (degrees)`,
    });
    const value = element("output");
    slider.addEventListener("input", () => this.turn(k, Number(slider.value)));
    return {
      slider,
      value,
      label: element("label", { title: `about ${axis} of the parent` }, `${name} `, slider, value),
    };
  });

  constructor(
    private readonly core: Core,
    data: FlyData,
  ) {
    const names = data.shapes.map((shape, k) => `${data.joints[k]} (${shape.name})`);
    this.joint = element(
      "select",
      { "aria-label": "joint" },
      // The pelvis has no joint to a parent.
      ...names.map((name, k) => element("option", { value: String(k) }, name)).slice(1),
    );
    this.joint.addEventListener("change", () => this.show());
    this.place.append(
      element("h2", {}, "Single joint"),
      element(
        "div",
        { class: "joints" },
        this.joint,
        ...this.sliders.map(({ label }) => label),
        button("reset joint", "Return this joint to its pose", () => this.reset([this.chosen])),
        button("reset all", "Return all joints to the pose", () => this.reset([...this.angles.keys()])),
        this.turned,
      ),
    );
    this.show();
  }

  /** Forgets all angles, for a flight that starts anew. */
  clear(): void {
    this.angles = new Map();
    this.show();
  }

  private get chosen(): number {
    return Number(this.joint.value);
  }

  private turn(axis: number, degrees: number): void {
    const angles = this.angles.get(this.chosen) ?? [0, 0, 0];
    angles[axis] = degrees / DEGREES;
    this.angles.set(this.chosen, angles);
    this.core.exports.joint(this.chosen, axis, angles[axis]);
    this.show();
  }

  private reset(joints: number[]): void {
    for (const joint of joints) {
      for (const axis of ANGLES.keys()) this.core.exports.joint(joint, axis, 0);
      this.angles.delete(joint);
    }
    this.show();
  }

  private show(): void {
    const angles = this.angles.get(this.chosen) ?? [0, 0, 0];
    for (const [k, { slider, value }] of this.sliders.entries()) {
      slider.value = String(Math.round(angles[k] * DEGREES));
      value.textContent = ` ${written(angles[k] * DEGREES, 0)}°`;
    }
    const others = [...this.angles].filter(([, angles]) => angles.some((angle) => angle !== 0));
    const name = (joint: number) => this.joint.querySelector(`option[value="${joint}"]`)?.textContent ?? "";
    this.turned.textContent = others.length ? `turned: ${others.map(([joint]) => name(joint)).join(", ")}` : "";
  }
}

/** Damping of relaxed limbs; a novice has little. */
export class DampingFields {
  readonly place: HTMLElement;
  private readonly fields = ["pitch", "yaw", "roll"].map((name) => {
    const field = element("input", {
      type: "number",
      min: "-1",
      max: "30",
      step: "0.1",
      "aria-label": `damping ${name}`,
      style: "width:5em",
    });
    field.addEventListener("change", () => this.set(this.fields.map(({ field }) => Number(field.value))));
    return { field, label: element("label", {}, `${name} `, field) };
  });
  /** Those with which the flight started. */
  private first: number[] = [];

  constructor(private readonly core: Core) {
    const reset = button("reset damping", "Return to the damping of the start", () => this.set(this.first));
    this.place = element(
      "section",
      { id: "damping" },
      element("h2", {}, "Damping coefficients"),
      element("div", { class: "joints" }, ...this.fields.map(({ label }) => label), reset),
    );
  }

  /** Shows the damping of a flight that starts anew. */
  clear(): void {
    this.first = [...this.core.layout.part(this.core.frame(), "damping")].map((value) => Math.round(value * 100) / 100);
    this.show(this.first);
  }

  private set(values: number[]): void {
    this.core.exports.damping(values[0], values[1], values[2]);
    this.show(values);
  }

  private show(values: number[]): void {
    for (const [k, { field }] of this.fields.entries()) field.value = String(values[k]);
  }
}
