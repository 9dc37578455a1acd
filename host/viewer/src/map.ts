// Ground track seen from above, north up.
import { colour, element } from "./dom";
import { shown } from "./units";

export interface Way {
  north: ArrayLike<number>;
  west: ArrayLike<number>;
  ink: string;
}

export class TopView {
  readonly canvas = element("canvas", {
    width: "300",
    height: "300",
    role: "img",
    "aria-label": "trajectory from above, north up",
  });

  private readonly tracks = document.createElement("canvas");
  private place = (_north: number, _west: number): [number, number] => [0, 0];

  /** Draws the tracks and the scale, which stay the same while time passes. */
  lay(ways: Way[]): void {
    const size = this.canvas.width;
    this.tracks.width = this.tracks.height = size;
    const context = this.tracks.getContext("2d");
    if (!context) return;
    let [low, high] = [
      [Infinity, Infinity],
      [-Infinity, -Infinity],
    ];
    for (const { north, west } of ways)
      for (let k = 0; k < north.length; k++) {
        low = [Math.min(low[0], north[k]), Math.min(low[1], west[k])];
        high = [Math.max(high[0], north[k]), Math.max(high[1], west[k])];
      }
    const extent = Math.max(1, high[0] - low[0], high[1] - low[1]) * 1.15;
    const centre = [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2];
    this.place = (north, west) => [
      size / 2 - ((west - centre[1]) / extent) * size,
      size / 2 - ((north - centre[0]) / extent) * size,
    ];
    context.lineWidth = 3;
    for (const { north, west, ink } of ways) {
      context.strokeStyle = colour(ink);
      context.beginPath();
      for (let k = 0; k < north.length; k++) context.lineTo(...this.place(north[k], west[k]));
      context.stroke();
    }
    context.fillStyle = colour("text");
    context.font = "20px system-ui";
    const { unit, factor } = shown("m");
    const step = 10 ** Math.floor(Math.log10((extent / 2) * factor));
    context.fillRect(10, size - 12, (step / factor / extent) * size, 3);
    context.fillText(`${step} ${unit}`, 10, size - 18);
    context.fillText("N ↑", size - 44, 24);
  }

  /** Marks a position (m) on the tracks. */
  mark(north: number, west: number): void {
    const context = this.canvas.getContext("2d");
    if (!context || this.tracks.width === 0) return;
    context.clearRect(0, 0, this.canvas.width, this.canvas.height);
    context.drawImage(this.tracks, 0, 0);
    context.fillStyle = colour("bad");
    context.beginPath();
    context.arc(...this.place(north, west), 6, 0, 7);
    context.fill();
  }
}
