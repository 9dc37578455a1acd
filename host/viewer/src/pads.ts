// Touch controls in place of keys.
import { element } from "./dom";
import { KEYS, type Keyboard } from "./keyboard";

/** Keys of the pads: rows for the left and the right thumb. */
const PADS: [string, string][][][] = [
  [
    [
      ["q", "⇠ slide"],
      ["w", "forward"],
      ["e", "slide ⇢"],
    ],
    [
      ["a", "↶ turn"],
      ["s", "back"],
      ["d", "turn ↷"],
    ],
  ],
  [
    [
      ["r", "arch"],
      ["g", "press"],
    ],
    [
      ["f", "de-arch"],
      ["b", "arms"],
    ],
  ],
];

/** Two pads, shown on touch screens or on request. */
export function pads(keyboard: Keyboard): HTMLElement {
  const pad = ([key, label]: [string, string]) => {
    const title = KEYS.find((entry) => entry.key === key)?.does ?? label;
    const made = element("button", { type: "button", class: "pad", "data-hold": key, title, tabindex: "-1" }, label);
    const hold = (on: boolean) => {
      keyboard.hold(key, on);
      made.classList.toggle("held", on);
    };
    made.addEventListener("pointerdown", (event) => {
      event.preventDefault();
      made.setPointerCapture(event.pointerId);
      hold(true);
    });
    for (const end of ["pointerup", "pointercancel", "lostpointercapture"] as const)
      made.addEventListener(end, () => hold(false));
    made.addEventListener("contextmenu", (event) => event.preventDefault());
    return made;
  };
  const groups = PADS.map((rows) =>
    element("div", { class: "thumb" }, ...rows.map((row) => element("div", {}, ...row.map(pad)))),
  );
  const made = element("div", { class: "pads", id: "pads" }, ...groups);
  made.hidden = !matchMedia("(pointer: coarse)").matches;
  return made;
}
