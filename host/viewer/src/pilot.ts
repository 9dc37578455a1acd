// The autopilot of poses that fall over: switched on with them, and what it says.
import type { Core } from "./core";
import { element, toggle } from "./dom";

/** Beyond this the pose is lost (rad). */
const LOST = 0.7;

export class Pilot {
  readonly switch: HTMLButtonElement;
  readonly message = element("span", { id: "holding", role: "status", class: "faint" });
  private on = true;
  private said = "";

  constructor(private readonly core: Core) {
    const title =
      "Holds a sit by moving arms, legs and trunk, with no time to react: no person is so quick. The heading stays yours (H)";
    this.switch = toggle("autopilot", title, true, (on) => {
      this.on = on;
      this.apply();
    });
    this.switch.id = "autopilot";
  }

  /** Takes hold of the flight that begins. */
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
    let words = "the air holds this pose";
    if (exports.can_hold() && !this.on) words = `autopilot off: ${degrees}° off the pose`;
    else if (exports.can_hold() && exports.tilt() > LOST) words = "autopilot lost the pose: start again (0)";
    else if (exports.can_hold()) words = `autopilot holds the pose: ${degrees}° off`;
    if (words !== this.said) this.message.textContent = words;
    this.said = words;
  }
}
