// Meshes a distance field by surface nets: one vertex in each cell that the surface crosses.
import type { Vector } from "./figure";
import type { Field, Stuff } from "./flesh";

export interface Skin {
  positions: Float32Array;
  normals: Float32Array;
  /** Four segments per vertex, with their weights. */
  segments: Uint16Array;
  weights: Float32Array;
  stuff: Stuff[];
  triangles: Uint32Array;
}

/** Cell size (m). */
const CELL = 0.019;
const EDGES = [
  [0, 1],
  [0, 2],
  [0, 4],
  [1, 3],
  [1, 5],
  [2, 3],
  [2, 6],
  [3, 7],
  [4, 5],
  [4, 6],
  [5, 7],
  [6, 7],
];

/** Values of the field at the corners of a grid. */
class Grid {
  readonly size: Vector;
  readonly values: Float32Array;
  private readonly low: Vector;

  constructor(field: Field) {
    const [low, high] = field.bounds();
    this.low = low;
    this.size = low.map((value, k) => Math.ceil((high[k] - value) / CELL) + 1) as Vector;
    this.values = field.fill(low, CELL, this.size);
  }

  place(i: number, j: number, k: number): Vector {
    return [this.low[0] + i * CELL, this.low[1] + j * CELL, this.low[2] + k * CELL];
  }

  index(i: number, j: number, k: number): number {
    return i + this.size[0] * (j + this.size[1] * k);
  }
}

/** Vertices, and the map from cells to vertices. */
function vertices(grid: Grid): { places: Vector[]; of: Map<number, number> } {
  const [nx, ny, nz] = grid.size;
  const places: Vector[] = [];
  const of = new Map<number, number>();
  const corner = new Float32Array(8);
  for (let k = 0; k < nz - 1; k++)
    for (let j = 0; j < ny - 1; j++)
      for (let i = 0; i < nx - 1; i++) {
        let inside = 0;
        for (let c = 0; c < 8; c++) {
          corner[c] = grid.values[grid.index(i + (c & 1), j + ((c >> 1) & 1), k + (c >> 2))];
          if (corner[c] < 0) inside += 1;
        }
        if (inside === 0 || inside === 8) continue;
        const sum = [0, 0, 0];
        let count = 0;
        for (const [a, b] of EDGES) {
          if (corner[a] < 0 === corner[b] < 0) continue;
          const share = corner[a] / (corner[a] - corner[b]);
          for (let axis = 0; axis < 3; axis++) {
            const [from, to] = [(a >> axis) & 1, (b >> axis) & 1];
            sum[axis] += from + (to - from) * share;
          }
          count += 1;
        }
        const at = grid.place(i + sum[0] / count, j + sum[1] / count, k + sum[2] / count);
        of.set(grid.index(i, j, k), places.length);
        places.push(at);
      }
  return { places, of };
}

/** Two outward-facing triangles for each grid edge that the surface crosses. */
function faces(grid: Grid, of: Map<number, number>): Uint32Array {
  const [nx, ny, nz] = grid.size;
  const made: number[] = [];
  const steps = [grid.index(1, 0, 0), grid.index(0, 1, 0), grid.index(0, 0, 1)];
  for (let k = 1; k < nz - 1; k++)
    for (let j = 1; j < ny - 1; j++)
      for (let i = 1; i < nx - 1; i++) {
        const at = grid.index(i, j, k);
        for (let axis = 0; axis < 3; axis++) {
          const [here, there] = [grid.values[at] < 0, grid.values[at + steps[axis]] < 0];
          if (here === there) continue;
          const [u, v] = [steps[(axis + 1) % 3], steps[(axis + 2) % 3]];
          const [a, b, c, d] = [at - u - v, at - v, at, at - u].map((cell) => of.get(cell));
          if (a === undefined || b === undefined || c === undefined || d === undefined) continue;
          made.push(...(here ? [a, b, c, a, c, d] : [a, c, b, a, d, c]));
        }
      }
  return Uint32Array.from(made);
}

export function skin(field: Field): Skin {
  const grid = new Grid(field);
  const { places, of } = vertices(grid);
  const count = places.length;
  const made: Skin = {
    positions: new Float32Array(3 * count),
    normals: new Float32Array(3 * count),
    segments: new Uint16Array(4 * count),
    weights: new Float32Array(4 * count),
    stuff: [],
    triangles: faces(grid, of),
  };
  const step = 0.006;
  for (const [n, place] of places.entries()) {
    made.positions.set(place, 3 * n);
    const slope = [0, 1, 2].map((axis) => {
      const [more, less] = [[...place] as Vector, [...place] as Vector];
      more[axis] += step;
      less[axis] -= step;
      return field.at(more) - field.at(less);
    });
    const size = Math.hypot(...slope) || 1;
    made.normals.set(
      slope.map((value) => value / size),
      3 * n,
    );
    const { stuff, weights } = field.surface(place);
    made.stuff.push(stuff);
    const heaviest = [...weights].sort((a, b) => b[1] - a[1]).slice(0, 4);
    const sum = heaviest.reduce((all, [, weight]) => all + weight, 0) || 1;
    for (const [k, [segment, weight]] of heaviest.entries()) {
      made.segments[4 * n + k] = segment;
      made.weights[4 * n + k] = weight / sum;
    }
  }
  return made;
}
