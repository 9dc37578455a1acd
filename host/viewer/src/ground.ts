// The height above the ground: a warning when it is low, and the end of the flight.
import { element } from "./dom";
import { written } from "./ticks";
import { length } from "./units";

export class Ground {
  readonly place = element("div", { class: "banner", id: "ground", role: "alert" });

  constructor(
    /** Height below which to warn (m). */
    private readonly warning: number,
  ) {
    this.place.hidden = true;
  }

  /** Shows what a height (m) and the time (s) of the flight mean. */
  show(height: number, time: number, isOver: boolean): void {
    const words = isOver
      ? `The flight has ended at the ground after ${written(time, 1)} s: restart (0).`
      : `Below ${length(this.warning)}: open the parachute.`;
    this.place.hidden = !isOver && height >= this.warning;
    if (!this.place.hidden && this.place.textContent !== words) this.place.textContent = words;
  }
}
