// Gear worn over the suit: the parachute rig.
import {
  BoxGeometry,
  type BufferGeometry,
  Color,
  CylinderGeometry,
  Group,
  Mesh,
  MeshLambertMaterial,
  Vector3,
} from "three";
import { colour } from "./dom";
import type { Shape } from "./types";

/** A mesh in one colour of the style sheet. */
function plain(geometry: BufferGeometry, ink: string): Mesh {
  return new Mesh(geometry, new MeshLambertMaterial({ color: new Color(colour(ink)) }));
}

/** A box with rounded edges. */
function padded(width: number, depth: number, height: number, taper: number) {
  const geometry = new BoxGeometry(width, depth, height, 6, 4, 8);
  const places = geometry.getAttribute("position");
  const place = new Vector3();
  const [hx, hy, hz] = [width / 2, depth / 2, height / 2];
  const round = 0.42 * Math.min(hx, hy, hz);
  for (let k = 0; k < places.count; k++) {
    place.fromBufferAttribute(places, k);
    const inner = new Vector3(
      Math.max(-hx + round, Math.min(hx - round, place.x)),
      Math.max(-hy + round, Math.min(hy - round, place.y)),
      Math.max(-hz + round, Math.min(hz - round, place.z)),
    );
    place.sub(inner);
    if (place.length() > 0) place.setLength(round);
    place.add(inner);
    place.x *= 1 - taper * (0.5 - place.z / height);
    places.setXYZ(k, place.x, place.y, place.z);
  }
  geometry.computeVertexNormals();
  return geometry;
}

/** Container with reserve and main, shoulder straps and handle, in thorax axes. */
export function rig(thorax: Shape): Group {
  const [x, y, z] = thorax.person_half_extents_m;
  const [mx, my, mz] = thorax.person_middle_m;
  const made = new Group();
  const height = Math.min(0.52, 2.6 * z);
  const back = my + 0.86 * y;
  const container = plain(padded(Math.min(0.34, 1.7 * x), 0.13, height, 0.18), "on-rig");
  container.position.set(mx, back + 0.05, mz + z - 0.5 * height - 0.02);
  const flap = plain(padded(0.24, 0.05, 0.2, 0.1), "on-flap");
  flap.position.set(mx, back + 0.1, mz + z - 0.15);
  const low = plain(padded(0.22, 0.04, 0.15, 0.2), "on-flap");
  low.position.set(mx, back + 0.1, mz + z - height + 0.11);
  made.add(container, flap, low);
  for (const side of [1, -1]) {
    const down = plain(new CylinderGeometry(0.016, 0.016, 1.1 * z, 6), "on-rig");
    down.rotation.x = Math.PI / 2;
    down.position.set(mx + side * 0.45 * x, my - 0.98 * y, mz + 0.1 * z);
    made.add(down);
  }
  return made;
}
