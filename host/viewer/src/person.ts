// A person: one skin over sixteen segments, and what is worn.
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

/** The surface of a subject, made once for all bodies that it draws. */
export class Surface {
  readonly made: Skin;
  readonly colours: BufferAttribute;
  readonly triangles: BufferAttribute;

  constructor(
    readonly shapes: Shape[],
    readonly worn: Worn,
  ) {
    this.made = skin(new Field(flesh(shapes, worn)));
    this.colours = new BufferAttribute(new Float32Array(this.made.positions.length), 3);
    this.triangles = new BufferAttribute(this.made.triangles, 1);
    this.recolour();
  }

  /** Takes the colours of the style sheet. */
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
}

/** A body that shows a pose. The skin is moved here, not on the graphics card: that costs less where graphics are software. */
export class Person {
  readonly root = new Group();
  protected readonly geometry = new BufferGeometry();
  private readonly bones: Group[];
  /** Skin from the posture of rest to the pose shown, for each segment. */
  private readonly moves: Matrix4[];
  private readonly back: Matrix4[];

  constructor(
    private readonly surface: Surface,
    material: Material,
    dressed: boolean,
    order = 0,
  ) {
    const { shapes, worn, made } = surface;
    this.bones = shapes.map(() => new Group());
    this.moves = shapes.map(() => new Matrix4());
    this.back = shapes.map(({ rest_joint_m: joint, rest_attitude: [w, x, y, z] }) =>
      new Matrix4().compose(new Vector3(...joint), new Turn(x, y, z, w), new Vector3(1, 1, 1)).invert(),
    );
    const moving = (list: Float32Array) => new BufferAttribute(list.slice(), 3).setUsage(DynamicDrawUsage);
    this.geometry.setAttribute("position", moving(made.positions));
    this.geometry.setAttribute("normal", moving(made.normals));
    this.geometry.setAttribute("color", surface.colours);
    this.geometry.setIndex(surface.triangles);
    this.add(material, order);
    if (dressed) this.root.add(...this.bones);
    if (dressed && worn.rig) {
      const chest = shapes.findIndex((shape) => kind(shape.name) === "thorax");
      this.bones[chest]?.add(rig(shapes[chest]));
    }
  }

  /** The body once more, in another material; later ones lie above. */
  protected add(material: Material, order: number): void {
    const mesh = new Mesh(this.geometry, material);
    mesh.frustumCulled = false;
    mesh.renderOrder = order;
    this.root.add(mesh);
  }

  show(pose: Pose, segments: Segments): void {
    const [w, x, y, z] = pose.attitude;
    this.root.position.set(...pose.position);
    this.root.quaternion.set(x, y, z, w);
    this.surface.shapes.forEach((shape, k) => {
      const turn = segments.attitude[k];
      // From the centre of gravity back to the joint.
      const [cx, cy, cz] = rotated(turn, shape.cg_m as Vector);
      const [px, py, pz] = segments.cg[k];
      const bone = this.bones[k];
      bone.position.set(px - cx, py - cy, pz - cz);
      bone.quaternion.set(turn[1], turn[2], turn[3], turn[0]);
      bone.updateMatrix();
      this.moves[k].multiplyMatrices(bone.matrix, this.back[k]);
    });
    this.move();
  }

  /** Moves each vertex with its segments, by their weights. */
  private move(): void {
    const { positions, normals, segments, weights } = this.surface.made;
    const [place, normal] = ["position", "normal"].map((name) => this.geometry.getAttribute(name) as BufferAttribute);
    const [to, up] = [place.array, normal.array];
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
    place.needsUpdate = true;
    normal.needsUpdate = true;
  }
}

/** How skin and suit take the light. */
export const cloth = () => new MeshLambertMaterial({ vertexColors: true });
