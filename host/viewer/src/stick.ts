// A stick figure on a 2D canvas, for browsers without WebGL.

import { colour, element } from "./dom";
import { type Picture, type Pose, rotated, type Segments, type Vector, type View } from "./figure";
import type { Shape } from "./types";

export class Sticks {
  readonly canvas = element("canvas", { "aria-label": "stick figure" });
  showForces = true;
  showGhost = true;
  showSegments = false;
  together = true;
  ground = 0;

  constructor(private readonly shapes: Shape[]) {}

  setTrail(): void {}

  /** Pixels per metre. */
  scale(view: View): number {
    return this.canvas.clientHeight / view.distance;
  }

  draw(picture: Picture, view: View): void {
    const box = this.canvas.parentElement;
    this.canvas.width = box?.clientWidth ?? 640;
    this.canvas.height = box?.clientHeight ?? 360;
    if (picture.measured && this.showGhost) this.body(picture, picture.measured, view, colour("ghost"));
    if (picture.changed) this.body(picture, picture.changed.pose, view, colour("second"));
    this.body(picture, picture.simulated, view, colour("on-suit"));
  }

  private body(picture: Picture, pose: Pose, view: View, ink: string): void {
    const context = this.canvas.getContext("2d");
    if (!context) return;
    const { width, height } = this.canvas;
    const scale = height / view.distance;
    const [ca, sa] = [Math.cos(view.azimuth), Math.sin(view.azimuth)];
    const [ce, se] = [Math.cos(view.elevation), Math.sin(view.elevation)];
    // Right and up in the camera's view.
    const flat = (place: Vector): [number, number] => {
      const [x, y, z] = rotated(pose.attitude, place);
      return [width / 2 + scale * (ca * y - sa * x), height / 2 - scale * (ce * z - se * (ca * x + sa * y))];
    };
    context.strokeStyle = ink;
    context.lineCap = "round";
    this.shapes.forEach((shape, k) => {
      const { attitude, cg } = postureOf(picture, pose);
      const half = rotated(attitude[k], [0, 0, shape.half_extents_m[2]]);
      const end = (sign: number): Vector => [
        cg[k][0] + sign * half[0],
        cg[k][1] + sign * half[1],
        cg[k][2] + sign * half[2],
      ];
      context.lineWidth = Math.max(2, 1.2 * scale * Math.min(shape.half_extents_m[0], shape.half_extents_m[1]));
      context.beginPath();
      context.moveTo(...flat(end(-1)));
      context.lineTo(...flat(end(1)));
      context.stroke();
    });
  }
}

/** The posture of the body with a pose. */
function postureOf(picture: Picture, pose: Pose): Segments {
  if (pose === picture.changed?.pose) return picture.changed.segments;
  return (pose === picture.measured && picture.other) || picture.segments;
}
