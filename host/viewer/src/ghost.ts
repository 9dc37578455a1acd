// The measured body over the simulated one: an outline and a translucent fill, drawn on top of everything.
import {
  Color,
  MeshBasicMaterial,
  type MeshBasicMaterialParameters,
  NotEqualStencilFunc,
  ReplaceStencilOp,
} from "three";
import { colour } from "./dom";
import type { Pose } from "./figure";
import { Person, type Surface } from "./person";

/** Width of the outline (fraction of the camera distance). */
const OUTLINE = 0.0035;

/** A material drawn on top of everything, once per pixel. */
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

  constructor(
    surface: Surface,
    private readonly ink = "ghost",
  ) {
    // The first fragment marks its pixel in the stencil buffer; later ones are discarded.
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
    for (const material of [this.veil, this.outline]) material.color = new Color(colour(this.ink));
  }

  /** Keeps the outline equally wide on screen at every distance. */
  override show(pose: Pose, distance = 4): void {
    super.show(pose);
    this.width.value = OUTLINE * distance;
  }
}
