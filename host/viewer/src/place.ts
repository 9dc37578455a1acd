// Surroundings: sky, horizon, and a grid on the ground.
import {
  BackSide,
  BufferAttribute,
  BufferGeometry,
  CircleGeometry,
  Color,
  Group,
  LineBasicMaterial,
  LineSegments,
  Mesh,
  MeshBasicMaterial,
  SphereGeometry,
  type Vector3,
} from "three";
import { colour } from "./dom";

/** Radius of the background (m); its size is not visible. */
const FAR = 300;
/** Grid lines on either side of the centre. */
const LINES = 30;
/** Colours of the sky by the sine of the elevation. */
const GRADES: [number, string][] = [
  [-1, "ground"],
  [-0.12, "ground"],
  [-0.015, "haze"],
  [0.03, "haze"],
  [0.3, "sky"],
  [1, "zenith"],
];

export class Place {
  readonly root = new Group();
  private readonly sky = new Mesh(
    new SphereGeometry(FAR, 24, 96).rotateX(Math.PI / 2),
    new MeshBasicMaterial({ vertexColors: true, side: BackSide, depthTest: false, depthWrite: false }),
  );
  private readonly lines = new LineSegments(
    new BufferGeometry(),
    new LineBasicMaterial({ vertexColors: true, transparent: true, depthTest: false, depthWrite: false }),
  );
  /** A spot vertically below the camera. */
  private readonly spot = new Mesh(
    new CircleGeometry(1, 20),
    new MeshBasicMaterial({ transparent: true, opacity: 0.3, depthTest: false, depthWrite: false }),
  );

  constructor() {
    this.sky.renderOrder = -3;
    this.lines.renderOrder = -2;
    this.spot.renderOrder = -1;
    for (const part of [this.sky, this.lines, this.spot]) part.frustumCulled = false;
    this.root.add(this.sky, this.lines, this.spot);
    this.grid();
    this.recolour();
  }

  recolour(): void {
    const places = this.sky.geometry.getAttribute("position");
    const colours = new Float32Array(places.count * 3);
    const [from, to] = [new Color(), new Color()];
    for (let k = 0; k < places.count; k++) {
      const height = places.getZ(k) / FAR;
      const above = Math.max(
        1,
        GRADES.findIndex(([grade]) => grade >= height),
      );
      const [[low, a], [high, b]] = [GRADES[above - 1], GRADES[above]];
      from.set(colour(a)).lerp(to.set(colour(b)), Math.min(1, Math.max(0, (height - low) / (high - low))));
      colours.set([from.r, from.g, from.b], 3 * k);
    }
    this.sky.geometry.setAttribute("color", new BufferAttribute(colours, 3));
    this.spot.material.color.set(colour("grid"));
    this.shade();
  }

  /** Grid lines of unit spacing, in short pieces so that they can fade out. */
  private grid(): void {
    const places: number[] = [];
    for (let k = -LINES; k <= LINES; k++)
      for (let piece = -LINES; piece < LINES; piece += 2)
        places.push(k, piece, 0, k, piece + 2, 0, piece, k, 0, piece + 2, k, 0);
    this.lines.geometry.setAttribute("position", new BufferAttribute(Float32Array.from(places), 3));
  }

  /** Fades the grid into the haze. */
  private shade(): void {
    const places = this.lines.geometry.getAttribute("position");
    const colours = new Float32Array(places.count * 4);
    const ink = new Color(colour("grid"));
    for (let k = 0; k < places.count; k++) {
      const away = Math.hypot(places.getX(k), places.getY(k)) / LINES;
      colours.set([ink.r, ink.g, ink.b, 0.75 * Math.max(0, 1 - away) ** 1.5], 4 * k);
    }
    this.lines.geometry.setAttribute("color", new BufferAttribute(colours, 4));
  }

  /** Places the surroundings around a camera, with the ground at a height (m). */
  show(camera: Vector3, ground: number): void {
    this.sky.position.copy(camera);
    const height = Math.max(1, camera.z - ground);
    // Scaled down and moved closer: the same picture, within the camera's far plane.
    const step = height > 1200 ? 500 : 100;
    const shrink = Math.min(1, FAR / (LINES * step));
    const offset = (value: number) => (Math.round(value / step) * step - value) * shrink;
    this.lines.scale.setScalar(step * shrink);
    this.lines.position.set(camera.x + offset(camera.x), camera.y + offset(camera.y), camera.z - height * shrink);
    this.spot.scale.setScalar(0.12 * step * shrink);
    this.spot.position.set(camera.x, camera.y, camera.z - height * shrink);
  }
}
