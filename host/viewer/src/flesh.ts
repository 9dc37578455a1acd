// The body as smoothly blended solids that the skin is wrapped around, sized to the subject.
import type { Quaternion, Vector } from "./figure";
import { rotated } from "./figure";
import type { Shape, Worn } from "./types";

/** Material of a part of the surface; the colours are in the style sheet. */
export type Stuff = "suit" | "sleeve" | "leg" | "skin" | "glove" | "shoe" | "helmet" | "visor";

/** A rounded cone with elliptic cross-sections, in segment axes. */
interface Solid {
  segment: number;
  stuff: Stuff;
  from: Vector;
  to: Vector;
  /** Half widths at both ends along the segment's X and Y (m). */
  first: [number, number];
  last: [number, number];
}

export interface Flesh {
  solids: Solid[];
  shapes: Shape[];
}

const SEGMENT: Record<string, (shape: Shape) => Omit<Solid, "segment">[]> = {
  pelvis: (shape) => trunk(shape, "suit", 0.98, 1.0),
  abdomen: (shape) => trunk(shape, "suit", 1.0, 0.92),
  thorax: (shape) => [...trunk(shape, "suit", 0.9, 0.98), ...shoulders(shape)],
  head: (shape) => head(shape),
  upperarm: (shape) => limb(shape, "sleeve", 1.12, 0.86),
  forearm: (shape) => limb(shape, "sleeve", 1.14, 0.74),
  hand: (shape) => hand(shape),
  thigh: (shape) => limb(shape, "leg", 1.18, 0.8),
  shank: (shape) => [...limb(shape, "leg", 1.02, 0.66), calf(shape)],
  foot: (shape) => foot(shape),
};

/** Name of a segment without its side. */
export const kind = (name: string) => name.replace(/^[lr]_/, "");

/** Returns the solids of all segments. */
export function flesh(shapes: Shape[], worn: Worn): Flesh {
  const bare = (stuff: Stuff): Stuff => {
    if (stuff === "shoe" && !worn.shoes) return "skin";
    if (stuff === "helmet" && !worn.helmet) return "skin";
    return stuff;
  };
  const solids = shapes.flatMap((shape, segment) =>
    (SEGMENT[kind(shape.name)]?.(shape) ?? []).map((solid) => ({ ...solid, segment, stuff: bare(solid.stuff) })),
  );
  return { solids, shapes };
}

/** Returns the proximal and distal ends of a segment along its Z axis. */
function ends(shape: Shape): [number, number] {
  const [middle, half] = [shape.person_middle_m[2], shape.person_half_extents_m[2]];
  return middle < 0 ? [0, middle - half] : [0, middle + half];
}

function limb(shape: Shape, stuff: Stuff, first: number, last: number): Omit<Solid, "segment">[] {
  const [x, y] = shape.person_half_extents_m;
  const [joint, end] = ends(shape);
  // Rounded ends protrude by their radius.
  const short = Math.sign(end) * 0.5 * last * Math.min(x, y);
  return [
    {
      stuff,
      from: [0, 0, joint],
      to: [0, 0, end - short],
      first: [x * first, y * first],
      last: [x * last, y * last],
    },
  ];
}

function calf(shape: Shape): Omit<Solid, "segment"> {
  const [x, y] = shape.person_half_extents_m;
  const [, end] = ends(shape);
  return {
    stuff: "leg",
    from: [0, 0.35 * y, 0.16 * end],
    to: [0, 0.2 * y, 0.5 * end],
    first: [x * 0.85, y * 0.9],
    last: [x * 0.7, y * 0.7],
  };
}

function trunk(shape: Shape, stuff: Stuff, first: number, last: number): Omit<Solid, "segment">[] {
  const [x, y, z] = shape.person_half_extents_m;
  const [mx, my, mz] = shape.person_middle_m;
  const inner = Math.max(0, z - 0.5 * y);
  const wide = x - 0.8 * y;
  // Two columns side by side give the broad, flat shape of a trunk.
  return [1, -1].map((side) => ({
    stuff,
    from: [mx + side * wide * first * 0.9, my, mz - inner],
    to: [mx + side * wide * last, my, mz + inner],
    first: [y * first, y * first],
    last: [y * last, y * last],
  }));
}

function shoulders(shape: Shape): Omit<Solid, "segment">[] {
  const [x, y, z] = shape.person_half_extents_m;
  const [, my, mz] = shape.person_middle_m;
  const top = mz + 0.72 * z;
  return [
    {
      stuff: "suit",
      from: [-x, my, top],
      to: [x, my, top],
      first: [0.5 * y, 0.5 * y],
      last: [0.5 * y, 0.5 * y],
    },
    // The neck and its slope to the shoulders.
    {
      stuff: "skin",
      from: [0, my + 0.1 * y, top],
      to: [0, my * 0.5, mz + z + 0.07],
      first: [0.72 * y, 0.66 * y],
      last: [0.055, 0.058],
    },
  ];
}

function head(shape: Shape): Omit<Solid, "segment">[] {
  const [x, y, z] = shape.person_half_extents_m;
  const [mx, my, mz] = shape.person_middle_m;
  const at = (dy: number, dz: number): Vector => [mx, my + dy * y, mz + dz * z];
  return [
    {
      stuff: "helmet",
      from: at(0.08, 0.28),
      to: at(0.02, 0.16),
      first: [0.98 * x, 0.9 * y],
      last: [0.98 * x, 0.92 * y],
    },
    { stuff: "helmet", from: at(-0.2, -0.5), to: at(-0.12, 0), first: [0.72 * x, 0.6 * y], last: [0.86 * x, 0.78 * y] },
    // The face is on the ventral side, -Y.
    {
      stuff: "visor",
      from: at(-0.42, -0.2),
      to: at(-0.42, 0.3),
      first: [0.68 * x, 0.56 * y],
      last: [0.76 * x, 0.56 * y],
    },
    {
      stuff: "skin",
      from: [mx, my * 0.5, mz - 1.1 * z],
      to: at(-0.05, -0.5),
      first: [0.055, 0.055],
      last: [0.06, 0.06],
    },
  ];
}

function hand(shape: Shape): Omit<Solid, "segment">[] {
  const [x, y] = shape.person_half_extents_m;
  const [, end] = ends(shape);
  const [broad, flat] = [Math.max(x, y), Math.min(x, y)];
  const side = Math.sign(shape.rest_joint_m[0]);
  const across = (a: number, b: number): [number, number] => (x >= y ? [a, b] : [b, a]);
  const to = (share: number): Vector => [0, 0, share * end];
  return [
    {
      stuff: "glove",
      from: to(0.05),
      to: to(0.55),
      first: across(0.72 * broad, 0.9 * flat),
      last: across(0.95 * broad, 0.85 * flat),
    },
    {
      stuff: "glove",
      from: to(0.55),
      to: to(0.92),
      first: across(0.9 * broad, 0.7 * flat),
      last: across(0.6 * broad, 0.5 * flat),
    },
    {
      stuff: "glove",
      from: [-side * 0.25 * x, -0.4 * y, 0.2 * end],
      to: [-side * 0.8 * x, -1.2 * y, 0.5 * end],
      first: [0.014, 0.014],
      last: [0.011, 0.011],
    },
  ];
}

function foot(shape: Shape): Omit<Solid, "segment">[] {
  const [x, y, z] = shape.person_half_extents_m;
  const [mx, my, mz] = shape.person_middle_m;
  // The foot points along whichever axis is longer.
  const low = mz - 0.25 * z;
  return [
    {
      stuff: "shoe",
      from: [mx, my + 0.72 * y, low],
      to: [mx, my - 0.62 * y, mz - 0.4 * z],
      first: [0.78 * x, 0.6 * z],
      last: [0.92 * x, 0.5 * z],
    },
    {
      stuff: "shoe",
      from: [0, 0, 0],
      to: [mx, my + 0.2 * y, mz],
      first: [0.75 * x, 0.75 * x],
      last: [0.8 * x, 0.7 * x],
    },
  ];
}

/** Signed distance to a solid (m), negative inside, accurate near the surface. `place` is in segment axes. */
function distance(solid: Solid, [x, y, z]: Vector): number {
  const { from, to, first, last } = solid;
  const [dx, dy, dz] = [to[0] - from[0], to[1] - from[1], to[2] - from[2]];
  const [px, py, pz] = [x - from[0], y - from[1], z - from[2]];
  const square = dx * dx + dy * dy + dz * dz || 1e-9;
  const share = Math.max(0, Math.min(1, (px * dx + py * dy + pz * dz) / square));
  const [qx, qy, qz] = [px - share * dx, py - share * dy, pz - share * dz];
  const a = first[0] + share * (last[0] - first[0]);
  const b = first[1] + share * (last[1] - first[1]);
  // Scaled to a circle of the mean radius: exact on the surface, approximate near it.
  const r = Math.sqrt(a * b);
  const along = Math.abs(dy) > Math.abs(dz) && Math.abs(dy) > Math.abs(dx);
  const [u, v, w] = along ? [qx / a, qz / b, qy / Math.min(a, b)] : [qx / a, qy / b, qz / Math.min(a, b)];
  return (Math.sqrt(u * u + v * v + w * w) - 1) * Math.min(r, 1.4 * Math.min(a, b));
}

/** Blending distance between two solids (m). */
const SOFT = 0.03;
const SHARE = 0.42 * SOFT;

/** Smooth minimum of distances, which rounds the joins. */
const nearness = (d: number) => (d < 3 * SOFT ? Math.exp(-d / SHARE) : 0);
const softened = (sum: number) => (sum > 0 ? -Math.log(sum) * SHARE : 3 * SOFT);

/** Signed distance field of the body in its rest posture. */
export class Field {
  private readonly parts: { solid: Solid; joint: Vector; back: Quaternion; middle: Vector; reach: number }[];

  constructor({ solids, shapes }: Flesh) {
    this.parts = solids.map((solid) => {
      const { rest_joint_m: joint, rest_attitude: turn } = shapes[solid.segment];
      const middle = solid.from.map((value, k) => (value + solid.to[k]) / 2) as Vector;
      const at = rotated(turn as Quaternion, middle);
      const length = Math.hypot(...solid.from.map((value, k) => value - solid.to[k]));
      return {
        solid,
        joint: joint as Vector,
        back: [turn[0], -turn[1], -turn[2], -turn[3]] as Quaternion,
        middle: [at[0] + joint[0], at[1] + joint[1], at[2] + joint[2]] as Vector,
        reach: length / 2 + 1.2 * Math.max(...solid.first, ...solid.last) + 3 * SOFT,
      };
    });
  }

  /** Bounding box. */
  bounds(): [Vector, Vector] {
    const [low, high]: [Vector, Vector] = [
      [Infinity, Infinity, Infinity],
      [-Infinity, -Infinity, -Infinity],
    ];
    for (const { middle, reach } of this.parts)
      for (let k = 0; k < 3; k++) {
        low[k] = Math.min(low[k], middle[k] - reach + 2 * SOFT);
        high[k] = Math.max(high[k], middle[k] + reach - 2 * SOFT);
      }
    return [low, high];
  }

  /** Signed distance to the surface (m); a large value far from it. */
  at(place: Vector): number {
    let sum = 0;
    for (const part of this.parts) sum += nearness(this.to(part, place));
    return softened(sum);
  }

  /** Distances at the points of a grid. Each solid only evaluates the points around it. */
  fill(low: Vector, cell: number, [nx, ny, nz]: Vector): Float32Array {
    const values = new Float32Array(nx * ny * nz);
    const place: Vector = [0, 0, 0];
    for (const part of this.parts) {
      const first = low.map((value, k) => Math.max(0, Math.floor((part.middle[k] - part.reach - value) / cell)));
      const last = low.map((value, k) =>
        Math.min([nx, ny, nz][k] - 1, Math.ceil((part.middle[k] + part.reach - value) / cell)),
      );
      for (let k = first[2]; k <= last[2]; k++)
        for (let j = first[1]; j <= last[1]; j++)
          for (let i = first[0]; i <= last[0]; i++) {
            place[0] = low[0] + i * cell;
            place[1] = low[1] + j * cell;
            place[2] = low[2] + k * cell;
            values[i + nx * (j + ny * k)] += nearness(this.to(part, place));
          }
    }
    for (let k = 0; k < values.length; k++) values[k] = softened(values[k]);
    return values;
  }

  /** Material of the surface at a point, and the weights of the segments that move it. */
  surface(place: Vector): { stuff: Stuff; weights: Map<number, number> } {
    let [least, stuff]: [number, Stuff] = [Infinity, "suit"];
    const nearest = new Map<number, number>();
    for (const part of this.parts) {
      const d = this.to(part, place);
      if (d < least) [least, stuff] = [d, part.solid.stuff];
      nearest.set(part.solid.segment, Math.min(nearest.get(part.solid.segment) ?? Infinity, d));
    }
    const weights = new Map<number, number>();
    for (const [segment, d] of nearest) {
      const weight = Math.exp(-(d - least) / 0.016);
      if (weight > 0.02) weights.set(segment, weight);
    }
    return { stuff, weights };
  }

  private to(part: (typeof this.parts)[number], [x, y, z]: Vector): number {
    const { middle, reach, joint, back, solid } = part;
    const [mx, my, mz] = [x - middle[0], y - middle[1], z - middle[2]];
    if (mx * mx + my * my + mz * mz > reach * reach) return 1;
    return distance(solid, rotated(back, [x - joint[0], y - joint[1], z - joint[2]]));
  }
}
