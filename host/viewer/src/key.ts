// Key of the picture: colours and arrows, the scale of forces, and the directions of the axes.
import { colour, element, onRecolour } from "./dom";
import type { View } from "./figure";

/** Force shown by the scale bar (N). */
const FORCE = 100;
const ENTRIES: [string, string, boolean][] = [
  ["on-suit", "simulated", false],
  ["ghost", "measured (outline)", true],
  ["cg", "centre of gravity (white ball)", false],
  ["force", "aerodynamic force", false],
  ["wind", "wind", false],
  ["simulated", "flight path", false],
];

/** The key of the picture. */
export class Key {
  readonly place = element("div", { class: "over key-box", id: "key" });
  private readonly bar = element("span", { class: "bar" });
  private readonly axes = element("canvas", {
    width: "120",
    height: "120",
    role: "img",
    "aria-label": "north, west, up",
  });
  private readonly changed = element(
    "div",
    {},
    element("i", { style: "background:var(--second)" }),
    "with changes (outline)",
  );
  /** View direction of the last drawing. */
  private drawn: [number, number] | null = null;
  private length = "";

  constructor(
    private readonly newtonsPerMetre: number,
    measured: boolean,
    names: string[] = [],
  ) {
    const rows = ENTRIES.filter(([, , isMeasured]) => measured || !isMeasured).map(([ink, words], k) =>
      element("div", {}, element("i", { class: ink, style: `background:var(--${ink})` }), names[k] ?? words),
    );
    const scale = element("div", {}, this.bar, ` ${FORCE} N, ${FORCE / newtonsPerMetre} m`);
    this.changed.hidden = true;
    this.place.append(this.axes, element("div", {}, ...rows, this.changed, scale));
    onRecolour(() => {
      this.drawn = null;
    });
  }

  /** Updates the key for a view with this many pixels per metre, with or without a flight with changes. */
  show(view: View, pixels: number, isChanged: boolean): void {
    if (this.changed.hidden === isChanged) this.changed.hidden = !isChanged;
    const length = `${Math.min(160, (pixels * FORCE) / this.newtonsPerMetre).toFixed(0)}px`;
    if (length !== this.length) this.bar.style.width = length;
    this.length = length;
    const { azimuth, elevation } = view;
    if (this.drawn?.[0] === azimuth && this.drawn[1] === elevation) return;
    this.drawn = [azimuth, elevation];
    this.triad(view);
  }

  private triad({ azimuth, elevation }: View): void {
    const context = this.axes.getContext("2d");
    if (!context) return;
    const [ca, sa] = [Math.cos(azimuth), Math.sin(azimuth)];
    const [ce, se] = [Math.cos(elevation), Math.sin(elevation)];
    const axes: [string, number, number, number, string][] = [
      ["N", 1, 0, 0, "bad"],
      ["W", 0, 1, 0, "second"],
      ["up", 0, 0, 1, "accent"],
    ];
    context.clearRect(0, 0, 120, 120);
    context.font = "bold 20px system-ui";
    context.textAlign = "center";
    context.textBaseline = "middle";
    context.lineWidth = 4;
    for (const [name, x, y, z, ink] of axes) {
      const right = ca * y - sa * x;
      const up = ce * z - se * (ca * x + sa * y);
      context.strokeStyle = colour(ink);
      context.fillStyle = colour(ink);
      context.beginPath();
      context.moveTo(60, 62);
      context.lineTo(60 + 38 * right, 62 - 38 * up);
      context.stroke();
      context.fillText(name, 60 + 50 * right, 62 - 50 * up);
    }
  }
}
