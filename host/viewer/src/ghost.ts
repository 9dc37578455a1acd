// The measured body over the simulated one: its outline, and a veil inside it. Neither cuts into what is below.
import {
  AlwaysStencilFunc,
  Color,
  EqualStencilFunc,
  IncrementStencilOp,
  MeshBasicMaterial,
  type MeshBasicMaterialParameters,
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
    const shadow = layer({
      colorWrite: false,
      stencilRef: 1,
      stencilFunc: AlwaysStencilFunc,
      stencilZPass: ReplaceStencilOp,
    });
    super(surface, shadow, false);
    const once = { stencilFunc: EqualStencilFunc, stencilZPass: IncrementStencilOp };
    this.veil = layer({ ...once, stencilRef: 1, opacity: 0.16 });
    this.outline = layer({ ...once, stencilRef: 0, opacity: 0.95 });
    this.outline.onBeforeCompile = (shader) => {
      shader.uniforms.outlineWidth = this.width;
      shader.vertexShader = `uniform float outlineWidth;\n${shader.vertexShader}`.replace(
        "#include <begin_vertex>",
        "#include <begin_vertex>\n transformed += normal * outlineWidth;",
      );
    };
    this.add(this.veil, 11);
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
