// What is needed to draw a body, independent of the renderer.

export type Vector = [number, number, number];
/** w, x, y, z. */
export type Quaternion = [number, number, number, number];

export interface Pose {
  position: Vector;
  attitude: Quaternion;
}

export interface Segments {
  /** body_from_segment. */
  attitude: Quaternion[];
  /** Body axes (m). */
  cg: Vector[];
  /** Body axes (N). */
  force: Vector[];
}

export interface Picture {
  simulated: Pose;
  measured: Pose | null;
  segments: Segments;
  /** The posture of the measured body, if it has another one. */
  other?: Segments;
  /** A third body: the flight with changes. */
  changed?: { pose: Pose; segments: Segments };
  cg: Vector;
  wind: Vector;
}

export interface View {
  /** Azimuth and elevation (rad), distance (m). */
  azimuth: number;
  elevation: number;
  distance: number;
}

export function rotated([w, x, y, z]: Quaternion, [a, b, c]: Vector): Vector {
  const [tx, ty, tz] = [2 * (y * c - z * b), 2 * (z * a - x * c), 2 * (x * b - y * a)];
  return [a + w * tx + y * tz - z * ty, b + w * ty + z * tx - x * tz, c + w * tz + x * ty - y * tx];
}

/** Interpolates between two rotations. */
export function between(from: Quaternion, to: Quaternion, share: number): Quaternion {
  const sign = from.reduce((sum, q, k) => sum + q * to[k], 0) < 0 ? -1 : 1;
  const mixed = from.map((q, k) => q + (sign * to[k] - q) * share) as Quaternion;
  const size = Math.hypot(...mixed) || 1;
  return mixed.map((q) => q / size) as Quaternion;
}
