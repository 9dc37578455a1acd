// The picture and its camera, drawn with WebGL or, without it, as a stick figure.

import { button, element, onRecolour, toggle, typing } from "./dom";
import type { Picture, View } from "./figure";
import { Key } from "./key";
import { Sticks } from "./stick";
import type { Shape, Worn } from "./types";
import { NEWTONS_PER_METRE, World } from "./world";

type Follow = "free" | "trailing" | "front" | "side" | "top";

const FOLLOWS: { follow: Follow; key: string; label: string; view: Partial<View> }[] = [
  { follow: "free", key: "v", label: "free", view: {} },
  { follow: "trailing", key: "t", label: "trailing", view: { elevation: 0.25 } },
  { follow: "front", key: "x", label: "from the north", view: { azimuth: 0, elevation: 0 } },
  { follow: "side", key: "y", label: "from the west", view: { azimuth: Math.PI / 2, elevation: 0 } },
  { follow: "top", key: "z", label: "from above", view: { azimuth: Math.PI, elevation: 1.56 } },
];

/** A person to draw. */
interface Drawn {
  name?: string;
  shapes: Shape[];
  worn: Worn;
}

export class Stage {
  readonly view: View = { azimuth: 0.67, elevation: 0.2, distance: 3.6 };
  readonly place: HTMLElement;
  readonly drawer: World | Sticks;
  readonly tools = element("div", { class: "over tools" });
  /** Drawing time of the last picture (ms). */
  cost = 0;
  private picture: Picture | null = null;
  private follow: Follow = "free";
  private readonly cameras = new Map<Follow, HTMLButtonElement>();
  /** Last positions of the pointers that are down. */
  private readonly fingers = new Map<number, [number, number]>();

  private readonly key: Key;
  private readonly segments: HTMLButtonElement;

  /** With another person, the outlined body is theirs, and both are named. */
  constructor(place: HTMLElement, person: Drawn, measured: boolean, other?: Drawn) {
    const { shapes, worn } = person;
    this.place = place;
    let drawer: World | Sticks;
    try {
      drawer = new World(shapes, worn, other);
    } catch {
      drawer = new Sticks(shapes);
      place.append(
        element(
          "div",
          { class: "banner", role: "alert", id: "no-webgl" },
          "This browser has no WebGL: the body is drawn as a stick figure. Plots, timeline and exports work.",
        ),
      );
    }
    this.drawer = drawer;
    place.prepend(this.drawer.canvas);
    this.drawer.canvas.tabIndex = 0;
    place.append(this.tools);
    for (const { follow, key, label } of FOLLOWS) {
      const camera = button(label, `Camera ${label} (${key.toUpperCase()})`, () => this.watch(follow));
      this.cameras.set(follow, camera);
      this.tools.append(camera);
    }
    this.markCamera();
    this.tools.append(
      toggle("forces", `Aerodynamic force on each segment; 1 m is ${NEWTONS_PER_METRE} N`, true, (on) => {
        this.drawer.showForces = on;
        this.redraw();
      }),
    );
    this.segments = toggle(
      "segments",
      "The sixteen segments of the aerodynamic model in place of the skin (B)",
      false,
      (on) => {
        this.drawer.showSegments = on;
        this.redraw();
      },
    );
    const names = other && [`A ${person.name}`, `B ${other.name} (outline)`];
    this.key = new Key(NEWTONS_PER_METRE, measured, names);
    place.append(this.key.place);
    this.tools.append(
      this.segments,
      toggle("key", "Key to colours and arrows", true, (on) => (this.key.place.hidden = !on)),
    );
    if (measured) this.addGhostTools(other ? "other" : "measured");
    this.listen();
    addEventListener("resize", () => this.redraw());
    onRecolour(() => this.redraw());
  }

  private addGhostTools(name: string): void {
    this.tools.append(
      toggle(name, `The ${name} body, as an outline`, true, (on) => {
        this.drawer.showGhost = on;
        this.redraw();
      }),
      toggle("together", "Both bodies at one position, or each at its own", true, (on) => {
        this.drawer.together = on;
        this.redraw();
      }),
    );
  }

  watch(follow: Follow): void {
    this.follow = follow;
    Object.assign(this.view, FOLLOWS.find((entry) => entry.follow === follow)?.view);
    this.markCamera();
    this.redraw();
  }

  private markCamera(): void {
    for (const [follow, camera] of this.cameras) camera.setAttribute("aria-pressed", String(follow === this.follow));
  }

  draw(picture: Picture): void {
    this.picture = picture;
    if (this.follow === "trailing") {
      // Behind the body: belly to earth, its dorsal axis points up and its cranial axis forward.
      const { w, x, y, z } = quaternion(picture.simulated.attitude);
      this.view.azimuth = Math.atan2(2 * (y * z - w * x), 2 * (x * z + w * y)) + Math.PI;
    }
    const begin = performance.now();
    this.drawer.draw(picture, this.view);
    this.cost = performance.now() - begin;
    this.key.show(this.view, this.drawer.scale(this.view), picture.changed !== undefined);
  }

  redraw(): void {
    if (this.picture) this.draw(this.picture);
  }

  private listen(): void {
    const canvas = this.drawer.canvas;
    const { fingers } = this;
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      fingers.set(event.pointerId, [event.clientX, event.clientY]);
    });
    for (const end of ["pointerup", "pointercancel"] as const)
      canvas.addEventListener(end, (event) => fingers.delete(event.pointerId));
    canvas.addEventListener("pointermove", (event) => {
      const before = fingers.get(event.pointerId);
      if (!before) return;
      const apart = this.apart();
      fingers.set(event.pointerId, [event.clientX, event.clientY]);
      if (apart > 0) this.zoom(apart / Math.max(1, this.apart()));
      else this.turn(event.clientX - before[0], event.clientY - before[1]);
    });
    canvas.addEventListener(
      "wheel",
      (event) => {
        event.preventDefault();
        this.zoom(Math.exp(event.deltaY * 0.001));
      },
      { passive: false },
    );
  }

  /** Distance between two fingers (px); 0 if there are not two. */
  private apart(): number {
    const [a, b] = [...this.fingers.values()];
    return b ? Math.hypot(a[0] - b[0], a[1] - b[1]) : 0;
  }

  private turn(right: number, down: number): void {
    this.view.azimuth -= right * 0.008;
    this.view.elevation = Math.max(-1.56, Math.min(1.56, this.view.elevation + down * 0.008));
    // Turning the camera by hand sets it free.
    if (this.follow !== "trailing") {
      this.follow = "free";
      this.markCamera();
    }
    this.redraw();
  }

  private zoom(factor: number): void {
    this.view.distance = Math.max(2, Math.min(60, this.view.distance * factor));
    this.redraw();
  }

  /** Enables the camera keys, in modes that do not use these keys otherwise. */
  listenToKeys(): void {
    addEventListener("keydown", (event) => {
      if (typing(event) || event.ctrlKey || event.metaKey || event.altKey) return;
      const entry = FOLLOWS.find(({ key }) => key === event.key.toLowerCase());
      if (entry) this.watch(entry.follow);
      else if (event.key.toLowerCase() === "b") this.segments.click();
    });
  }
}

function quaternion([w, x, y, z]: [number, number, number, number]) {
  return { w, x, y, z };
}
