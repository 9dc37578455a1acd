// A person: one skin over sixteen segments, with gear.
import {
  BufferAttribute,
  BufferGeometry,
  Color,
  DynamicDrawUsage,
  Group,
  type Material,
  Matrix4,
  Mesh,
  MeshLambertMaterial,
  type Object3D,
  Quaternion as Turn,
  Vector3,
} from "three";
import { colour } from "./dom";
import type { Pose, Segments, Vector } from "./figure";
import { rotated } from "./figure";
import { Field, flesh, kind, type Stuff } from "./flesh";
import { rig } from "./gear";
import { type Skin, skin } from "./skin";
import type { Shape, Worn } from "./types";

const ONE = new Vector3(1, 1, 1);

/** The surface of a subject in a posture, in body axes. It is shared by all bodies drawn with it. */
export class Surface {
  readonly geometry = new BufferGeometry();
  /** Pose of each segment. */
  readonly bones: Matrix4[];
  private readonly made: Skin;
  private readonly colours: BufferAttribute;
  private readonly place: BufferAttribute;
  private readonly normal: BufferAttribute;
  /** Transform from the rest posture to the current one, for each segment. */
  private readonly moves: Matrix4[];
  private readonly back: Matrix4[];
  private shown: Segments | null = null;

  constructor(
    readonly shapes: Shape[],
    readonly worn: Worn,
  ) {
    this.made = skin(new Field(flesh(shapes, worn)));
    this.bones = shapes.map(() => new Matrix4());
    this.moves = shapes.map(() => new Matrix4());
    this.back = shapes.map(({ rest_joint_m: joint, rest_attitude: [w, x, y, z] }) =>
      new Matrix4().compose(new Vector3(...joint), new Turn(x, y, z, w), ONE).invert(),
    );
    const moving = (list: Float32Array) => new BufferAttribute(list.slice(), 3).setUsage(DynamicDrawUsage);
    this.place = moving(this.made.positions);
    this.normal = moving(this.made.normals);
    this.colours = new BufferAttribute(new Float32Array(this.made.positions.length), 3);
    this.geometry.setAttribute("position", this.place);
    this.geometry.setAttribute("normal", this.normal);
    this.geometry.setAttribute("color", this.colours);
    this.geometry.setIndex(new BufferAttribute(this.made.triangles, 1));
    this.recolour();
  }

  /** Applies the colours of the style sheet. */
  recolour(): void {
    const inks = new Map<Stuff, Color>();
    this.made.stuff.forEach((stuff, n) => {
      let ink = inks.get(stuff);
      if (!ink) {
        ink = new Color(colour(`on-${stuff}`));
        inks.set(stuff, ink);
      }
      this.colours.setXYZ(n, ink.r, ink.g, ink.b);
    });
    this.colours.needsUpdate = true;
  }

  /** Sets the posture. Returns at once if it is unchanged, as when only the camera moves. */
  pose(segments: Segments): void {
    if (segments === this.shown) return;
    this.shown = segments;
    const [turn, joint] = [new Turn(), new Vector3()];
    this.shapes.forEach((shape, k) => {
      const [w, x, y, z] = segments.attitude[k];
      // From the centre of gravity to the joint.
      const [cx, cy, cz] = rotated(segments.attitude[k], shape.cg_m as Vector);
      const [px, py, pz] = segments.cg[k];
      this.bones[k].compose(joint.set(px - cx, py - cy, pz - cz), turn.set(x, y, z, w), ONE);
      this.moves[k].multiplyMatrices(this.bones[k], this.back[k]);
    });
    this.move();
  }

  /**
   * Moves each vertex with its segments, by their weights. This runs on the CPU because that is faster than a vertex
   * shader with software rendering.
   */
  private move(): void {
    const { positions, normals, segments, weights } = this.made;
    const [to, up] = [this.place.array, this.normal.array];
    for (let n = 0; n < positions.length / 3; n++) {
      const [x, y, z] = [positions[3 * n], positions[3 * n + 1], positions[3 * n + 2]];
      const [u, v, w] = [normals[3 * n], normals[3 * n + 1], normals[3 * n + 2]];
      let [px, py, pz, nx, ny, nz] = [0, 0, 0, 0, 0, 0];
      for (let k = 4 * n; k < 4 * n + 4; k++) {
        const share = weights[k];
        if (share === 0) break;
        const m = this.moves[segments[k]].elements;
        px += share * (m[0] * x + m[4] * y + m[8] * z + m[12]);
        py += share * (m[1] * x + m[5] * y + m[9] * z + m[13]);
        pz += share * (m[2] * x + m[6] * y + m[10] * z + m[14]);
        nx += share * (m[0] * u + m[4] * v + m[8] * w);
        ny += share * (m[1] * u + m[5] * v + m[9] * w);
        nz += share * (m[2] * u + m[6] * v + m[10] * w);
      }
      to[3 * n] = px;
      to[3 * n + 1] = py;
      to[3 * n + 2] = pz;
      up[3 * n] = nx;
      up[3 * n + 1] = ny;
      up[3 * n + 2] = nz;
    }
    this.place.needsUpdate = true;
    this.normal.needsUpdate = true;
  }
}

/** A body drawn with a surface. */
export class Person {
  readonly root = new Group();
  private readonly rig: Group | null = null;
  private readonly own: Object3D[] = [];
  private readonly chest: number;

  constructor(
    private readonly surface: Surface,
    material: Material,
    dressed: boolean,
    order = 0,
  ) {
    const { shapes, worn } = surface;
    this.chest = shapes.findIndex((shape) => kind(shape.name) === "thorax");
    this.add(material, order);
    if (dressed && worn.rig && this.chest >= 0) {
      this.rig = new Group().add(rig(shapes[this.chest]));
      this.own.push(this.rig);
      this.root.add(this.rig);
    }
  }

  /** Hides skin and rig, and leaves what is attached to the body. */
  undress(on: boolean): void {
    for (const part of this.own) part.visible = !on;
  }

  /** Draws the body again in another material; higher orders are drawn on top. */
  protected add(material: Material, order: number): void {
    const mesh = new Mesh(this.surface.geometry, material);
    mesh.frustumCulled = false;
    mesh.renderOrder = order;
    this.own.push(mesh);
    this.root.add(mesh);
  }

  /** Sets position and attitude; the posture is the surface's. */
  show({ position, attitude: [w, x, y, z] }: Pose): void {
    this.root.position.set(...position);
    this.root.quaternion.set(x, y, z, w);
    const { rig } = this;
    if (rig) this.surface.bones[this.chest].decompose(rig.position, rig.quaternion, rig.scale);
  }
}

/** Material of skin and suit. */
export const cloth = () => new MeshLambertMaterial({ vertexColors: true });
