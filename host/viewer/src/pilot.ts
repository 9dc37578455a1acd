// Switch and status of the autopilot that holds unstable poses.
import type { Core } from "./core";
import { element, toggle } from "./dom";

/** Tilt beyond which the pose is lost (rad). */
const LOST = 0.7;

export class Pilot {
  readonly switch: HTMLButtonElement;
  readonly message = element("span", { id: "holding", role: "status", class: "faint" });
  private on = true;
  private said = "";

  constructor(private readonly core: Core) {
    const title =
      "Holds a sit by moving arms, legs and trunk, without any reaction time: no person is that quick. You control the heading (H)";
    this.switch = toggle("autopilot", title, true, (on) => {
      this.on = on;
      this.apply();
    });
    this.switch.id = "autopilot";
  }

  /** Applies the switch to a new flight. */
  apply(): void {
    const { exports } = this.core;
    this.switch.disabled = !exports.can_hold();
    exports.hold(this.on ? 1 : 0);
  }

  flip(): void {
    if (!this.switch.disabled) this.switch.click();
  }

  say(): void {
    const { exports } = this.core;
    const degrees = ((exports.tilt() * 180) / Math.PI).toFixed(0);
    let words = "this pose is stable without the autopilot";
    if (exports.can_hold() && !this.on) words = `autopilot off: ${degrees}° off the pose`;
    else if (exports.can_hold() && exports.tilt() > LOST) words = "autopilot lost the pose: restart (0)";
    else if (exports.can_hold()) words = `autopilot holds the pose: ${degrees}° off`;
    if (words !== this.said) this.message.textContent = words;
    this.said = words;
  }
}
