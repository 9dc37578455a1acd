// The picture with its camera: whoever can draws it, and says so where it is sticks.

import { button, element, toggle, typing } from "./dom";
import type { Picture, View } from "./figure";
import { Sticks } from "./stick";
import type { Shape } from "./types";
import { NEWTONS_PER_METRE, World } from "./world";

type Follow = "free" | "trailing" | "front" | "side" | "top";

const FOLLOWS: { follow: Follow; key: string; label: string; view: Partial<View> }[] = [
  { follow: "free", key: "v", label: "free", view: {} },
  { follow: "trailing", key: "t", label: "trailing", view: { elevation: 0.25 } },
  { follow: "front", key: "x", label: "from the north", view: { azimuth: 0, elevation: 0 } },
  { follow: "side", key: "y", label: "from the west", view: { azimuth: Math.PI / 2, elevation: 0 } },
  { follow: "top", key: "z", label: "from above", view: { azimuth: Math.PI, elevation: 1.56 } },
];

export class Stage {
  readonly view: View = { azimuth: 0.67, elevation: 0.35, distance: 3.8 };
  readonly place: HTMLElement;
  readonly drawer: World | Sticks;
  readonly tools = element("div", { class: "over tools" });
  /** Time that the last picture took (ms), and from one to the next. */
  cost = 0;
  private picture: Picture | null = null;
  private follow: Follow = "free";

  constructor(place: HTMLElement, shapes: Shape[]) {
    this.place = place;
    let drawer: World | Sticks;
    try {
      drawer = new World(shapes);
    } catch {
      drawer = new Sticks(shapes);
      place.append(
        element(
          "div",
          { class: "banner", role: "alert", id: "no-webgl" },
          "This browser has no WebGL: the body is drawn as sticks. Plots, timeline and exports work.",
        ),
      );
    }
    this.drawer = drawer;
    place.prepend(this.drawer.canvas);
    this.drawer.canvas.tabIndex = 0;
    place.append(this.tools);
    for (const { follow, key, label } of FOLLOWS) {
      this.tools.append(button(label, `Camera ${label} (${key.toUpperCase()})`, () => this.watch(follow)));
    }
    this.tools.append(
      toggle("forces", `Force of the air on each segment; 1 m is ${NEWTONS_PER_METRE} N`, true, (on) => {
        this.drawer.showForces = on;
        this.redraw();
      }),
    );
    this.listen();
    addEventListener("resize", () => this.redraw());
  }

  addGhostTools(): void {
    this.tools.append(
      toggle("measured", "The measured body, half transparent", true, (on) => {
        this.drawer.showGhost = on;
        this.redraw();
      }),
      toggle("together", "Both bodies at one place, or each where it flew", true, (on) => {
        this.drawer.together = on;
        this.redraw();
      }),
    );
  }

  watch(follow: Follow): void {
    this.follow = follow;
    Object.assign(this.view, FOLLOWS.find((entry) => entry.follow === follow)?.view);
    this.redraw();
  }

  draw(picture: Picture): void {
    this.picture = picture;
    if (this.follow === "trailing") {
      // Behind the body: its dorsal axis points up when belly to earth, its cranial axis forward.
      const { w, x, y, z } = quaternion(picture.simulated.attitude);
      this.view.azimuth = Math.atan2(2 * (y * z - w * x), 2 * (x * z + w * y)) + Math.PI;
    }
    const begin = performance.now();
    this.drawer.draw(picture, this.view);
    this.cost = performance.now() - begin;
  }

  redraw(): void {
    if (this.picture) this.draw(this.picture);
  }

  private listen(): void {
    const canvas = this.drawer.canvas;
    canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId));
    canvas.addEventListener("pointermove", (event) => {
      if (event.buttons !== 1) return;
      this.view.azimuth -= event.movementX * 0.008;
      this.view.elevation = Math.max(-1.56, Math.min(1.56, this.view.elevation + event.movementY * 0.008));
      this.redraw();
    });
    canvas.addEventListener(
      "wheel",
      (event) => {
        event.preventDefault();
        this.view.distance = Math.max(2, Math.min(60, this.view.distance * Math.exp(event.deltaY * 0.001)));
        this.redraw();
      },
      { passive: false },
    );
  }

  /** Camera keys, where the mode leaves them free. */
  listenToKeys(): void {
    addEventListener("keydown", (event) => {
      if (typing(event) || event.ctrlKey || event.metaKey || event.altKey) return;
      const entry = FOLLOWS.find(({ key }) => key === event.key.toLowerCase());
      if (entry) this.watch(entry.follow);
    });
  }
}

function quaternion([w, x, y, z]: [number, number, number, number]) {
  return { w, x, y, z };
}
