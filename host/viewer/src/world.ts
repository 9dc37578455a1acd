// The 3D picture, drawn with three.js.
import {
  ArrowHelper,
  BufferAttribute,
  BufferGeometry,
  DirectionalLight,
  Group,
  HemisphereLight,
  Line,
  LineBasicMaterial,
  Mesh,
  MeshLambertMaterial,
  PerspectiveCamera,
  Points,
  PointsMaterial,
  Scene,
  SphereGeometry,
  Vector2,
  Vector3,
  WebGLRenderer,
} from "three";
import { colour, onRecolour } from "./dom";
import type { Picture, Pose, Segments, Vector, View } from "./figure";
import { kind } from "./flesh";
import { Ghost } from "./ghost";
import { cloth, Person, Surface } from "./person";
import { Place } from "./place";
import type { Shape, Worn } from "./types";

/** Scale of force arrows (N/m). */
export const NEWTONS_PER_METRE = 250;
const FIELD_OF_VIEW = 40;
const GRID = 3;
const CELLS = 7;

/** A superellipsoid of exponent 2.5 with these half extents. */
function solid(half: Vector): BufferGeometry {
  const geometry = new SphereGeometry(1, 20, 14);
  const places = geometry.getAttribute("position");
  const bulge = (value: number) => Math.sign(value) * Math.abs(value) ** 0.8;
  for (let k = 0; k < places.count; k++) {
    places.setXYZ(k, bulge(places.getX(k)) * half[0], bulge(places.getY(k)) * half[1], bulge(places.getZ(k)) * half[2]);
  }
  geometry.computeVertexNormals();
  return geometry;
}

/** Segments drawn in the light tone, so that neighbours differ. */
const LIGHT = ["abdomen", "head", "upperarm", "hand", "thigh", "foot"];

/** The sixteen segments as the aerodynamic model represents them, in place of the skin. */
class SegmentCage {
  readonly root = new Group();
  private readonly meshes: Mesh[];
  private readonly tones = [new MeshLambertMaterial(), new MeshLambertMaterial()];

  constructor(shapes: Shape[]) {
    this.meshes = shapes.map((shape) => {
      const tone = this.tones[LIGHT.includes(kind(shape.name)) ? 1 : 0];
      return new Mesh(solid(shape.half_extents_m), tone);
    });
    this.root.add(...this.meshes);
    this.recolour();
  }

  recolour(): void {
    for (const [k, tone] of this.tones.entries()) tone.color.set(colour(["segment", "segment-light"][k]));
  }

  show(segments: Segments): void {
    this.meshes.forEach((mesh, k) => {
      const [w, x, y, z] = segments.attitude[k];
      mesh.position.set(...segments.cg[k]);
      mesh.quaternion.set(x, y, z, w);
    });
  }
}

export class World {
  readonly canvas: HTMLCanvasElement;
  private readonly renderer: WebGLRenderer;
  private readonly scene = new Scene();
  private readonly camera = new PerspectiveCamera(FIELD_OF_VIEW, 1, 0.1, 400);
  private readonly surface: Surface;
  private readonly body: Person;
  private readonly ghost: Ghost;
  /** The surface of the ghost, if it is another person's. */
  private readonly other: Surface | null;
  /** The body of a flight with changes, made when it is first drawn. */
  private changed: Ghost | null = null;
  private changedSurface: Surface | null = null;
  private readonly cage: SegmentCage;
  private readonly place = new Place();
  private readonly dots: Points<BufferGeometry, PointsMaterial>;
  private readonly arrows: ArrowHelper[];
  private readonly wind = new ArrowHelper(new Vector3(1, 0, 0), new Vector3(), 1, colour("wind"), 0.25, 0.15);
  private readonly cg = new Mesh(
    new SphereGeometry(0.04, 12, 8),
    new MeshLambertMaterial({ color: 0xffffff, emissive: 0x333333, depthTest: false }),
  );
  private readonly trail = new Line(new BufferGeometry(), new LineBasicMaterial());
  /** Temporary values, to avoid allocations per picture. */
  private readonly direction = new Vector3();
  private readonly size = new Vector2();
  showForces = true;
  showGhost = true;
  showSegments = false;
  together = true;
  /** Height of the ground (m). */
  ground = 0;

  /** Throws without WebGL. */
  constructor(shapes: Shape[], worn: Worn, other?: { shapes: Shape[]; worn: Worn }) {
    this.renderer = new WebGLRenderer({ antialias: true, preserveDrawingBuffer: true, stencil: true });
    this.canvas = this.renderer.domElement;
    this.surface = new Surface(shapes, worn);
    this.body = new Person(this.surface, cloth(), true);
    this.other = other ? new Surface(other.shapes, other.worn) : null;
    this.ghost = new Ghost(this.other ?? this.surface);
    this.cage = new SegmentCage(shapes);
    this.cage.root.renderOrder = 3;
    this.body.root.add(this.cage.root);
    const places = new Float32Array((2 * CELLS + 1) ** 3 * 3);
    let k = 0;
    for (let x = -CELLS; x <= CELLS; x++)
      for (let y = -CELLS; y <= CELLS; y++)
        for (let z = -CELLS; z <= CELLS; z++) {
          places.set([x * GRID, y * GRID, z * GRID], k);
          k += 3;
        }
    const cloud = new BufferGeometry().setAttribute("position", new BufferAttribute(places, 3));
    this.dots = new Points(cloud, new PointsMaterial({ size: 0.09, transparent: true, opacity: 0.5 }));
    this.arrows = shapes.map(
      () => new ArrowHelper(new Vector3(0, 0, 1), new Vector3(), 0.1, colour("force"), 0.06, 0.04),
    );
    this.body.root.add(...this.arrows, this.cg);
    this.cg.renderOrder = 2;
    this.trail.frustumCulled = false;
    const sun = new DirectionalLight(0xffffff, 2.2);
    sun.position.set(3, 5, 8);
    this.scene.add(
      this.place.root,
      this.body.root,
      this.ghost.root,
      this.dots,
      this.wind,
      this.trail,
      sun,
      new HemisphereLight(0xdcebff, 0x8a7a66, 1.7),
    );
    this.camera.up.set(0, 0, 1);
    this.recolour();
    onRecolour(() => this.recolour());
  }

  private recolour(): void {
    this.place.recolour();
    this.surface.recolour();
    this.ghost.recolour();
    this.cage.recolour();
    this.changed?.recolour();
    this.dots.material.color.set(colour("dot"));
    for (const arrow of this.arrows) arrow.setColor(colour("force"));
    this.wind.setColor(colour("wind"));
    (this.trail.material as LineBasicMaterial).color.set(colour("simulated"));
  }

  /** Sets the flight path, as lists of x, y and z. */
  setTrail(x: ArrayLike<number>, y: ArrayLike<number>, z: ArrayLike<number>): void {
    const places = new Float32Array(x.length * 3);
    for (let k = 0; k < x.length; k++) places.set([x[k], y[k], z[k]], 3 * k);
    this.trail.geometry.dispose();
    this.trail.geometry = new BufferGeometry().setAttribute("position", new BufferAttribute(places, 3));
  }

  /** Pixels per metre at the body. */
  scale(view: View): number {
    return this.canvas.clientHeight / (2 * Math.tan((FIELD_OF_VIEW * Math.PI) / 360) * view.distance);
  }

  draw(picture: Picture, view: View): void {
    const box = this.canvas.parentElement;
    const [width, height] = box ? [box.clientWidth, box.clientHeight] : [640, 360];
    const size = this.renderer.getSize(this.size);
    if (size.x !== width || size.y !== height) {
      this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
      this.renderer.setSize(width, height, false);
      this.camera.aspect = width / Math.max(1, height);
      this.camera.updateProjectionMatrix();
    }
    this.render(picture, view);
  }

  /** Draws the outline of the flight with changes. */
  private showChanged({ changed, simulated }: Picture, view: View): void {
    if (changed && !this.changed) {
      this.changedSurface = new Surface(this.surface.shapes, this.surface.worn);
      this.changed = new Ghost(this.changedSurface, "second");
      this.scene.add(this.changed.root);
    }
    if (this.changed) this.changed.root.visible = changed !== undefined;
    if (!changed) return;
    const pose: Pose = this.together ? { ...changed.pose, position: simulated.position } : changed.pose;
    this.changedSurface?.pose(changed.segments);
    this.changed?.show(pose, view.distance);
  }

  private render(picture: Picture, view: View): void {
    const { simulated, measured, segments } = picture;
    this.surface.pose(segments);
    if (picture.other) this.other?.pose(picture.other);
    this.body.show(simulated);
    this.cage.root.visible = this.showSegments;
    this.body.undress(this.showSegments);
    if (this.showSegments) this.cage.show(segments);
    this.ghost.root.visible = measured !== null && this.showGhost;
    if (measured) {
      this.ghost.show(this.together ? { ...measured, position: simulated.position } : measured, view.distance);
    }
    this.showChanged(picture, view);
    this.cg.position.set(...picture.cg);
    this.arrows.forEach((arrow, k) => {
      const force = this.direction.set(...segments.force[k]);
      const length = force.length() / NEWTONS_PER_METRE;
      arrow.visible = this.showForces && length > 0.02;
      arrow.position.set(...segments.cg[k]);
      arrow.setDirection(force.normalize());
      arrow.setLength(length, Math.min(0.08, 0.4 * length), Math.min(0.05, 0.25 * length));
    });
    const [x, y, z] = simulated.position;
    const wind = this.direction.set(...picture.wind);
    this.wind.visible = wind.length() > 0.1;
    this.wind.position.set(x, y, z + 1.4);
    this.wind.setLength(Math.max(0.3, wind.length() / 10), 0.2, 0.12);
    this.wind.setDirection(wind.normalize());
    const cell = (value: number) => Math.round(value / GRID) * GRID;
    this.dots.position.set(cell(x), cell(y), cell(z));
    const level = Math.cos(view.elevation) * view.distance;
    this.camera.position.set(
      x + level * Math.cos(view.azimuth),
      y + level * Math.sin(view.azimuth),
      z + Math.sin(view.elevation) * view.distance,
    );
    this.camera.lookAt(x, y, z);
    this.place.show(this.camera.position, this.ground);
    this.renderer.render(this.scene, this.camera);
  }
}
