// The measured body over the simulated one: its outline, and a veil inside it. Neither cuts into what is below.
import {
  Color,
  MeshBasicMaterial,
  type MeshBasicMaterialParameters,
  NotEqualStencilFunc,
  ReplaceStencilOp,
} from "three";
import { colour } from "./dom";
import type { Pose, Segments } from "./figure";
import { Person, type Surface } from "./person";

/** Width of the outline (share of the distance). */
const OUTLINE = 0.0035;

/** Drawn over everything, each place once. */
function layer(parameters: MeshBasicMaterialParameters): MeshBasicMaterial {
  return new MeshBasicMaterial({
    transparent: true,
    depthTest: false,
    depthWrite: false,
    stencilWrite: true,
    ...parameters,
  });
}

export class Ghost extends Person {
  private readonly width = { value: 0 };
  private readonly veil: MeshBasicMaterial;
  private readonly outline: MeshBasicMaterial;

  constructor(surface: Surface) {
    // Whatever comes first at a place marks it, and nothing is drawn there any more.
    const once = { stencilRef: 1, stencilFunc: NotEqualStencilFunc, stencilZPass: ReplaceStencilOp };
    const veil = layer({ ...once, opacity: 0.16 });
    super(surface, veil, false, 11);
    this.veil = veil;
    this.outline = layer({ ...once, opacity: 0.95 });
    this.outline.onBeforeCompile = (shader) => {
      shader.uniforms.outlineWidth = this.width;
      shader.vertexShader = `uniform float outlineWidth;\n${shader.vertexShader}`.replace(
        "#include <begin_vertex>",
        "#include <begin_vertex>\n transformed += normal * outlineWidth;",
      );
    };
    this.add(this.outline, 12);
    this.recolour();
  }

  recolour(): void {
    for (const material of [this.veil, this.outline]) material.color = new Color(colour("ghost"));
  }

  /** As wide an outline from near and from far. */
  override show(pose: Pose, segments: Segments, distance = 4): void {
    super.show(pose, segments);
    this.width.value = OUTLINE * distance;
  }
}
