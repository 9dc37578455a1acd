// The divider between the picture and what is beside or below it; the browser keeps its place.
import { element } from "./dom";

const KEPT = "bodyflight-split";
/** Shares of the page that the part beside the picture may take, and the step of the arrow keys. */
const [LEAST, MOST, STEP] = [0.15, 0.85, 0.02];

/** The divider of the page. */
export function splitter(app: HTMLElement): HTMLElement {
  const bar = element("div", {
    class: "splitter",
    role: "separator",
    tabindex: "0",
    "aria-label": "divider between picture and plots",
    title: "Drag to divide the page; double-click for the default",
  });
  const apply = (share: number | null) => {
    if (share === null) app.style.removeProperty("--beside");
    else app.style.setProperty("--beside", `${(100 * share).toFixed(2)}%`);
    bar.setAttribute("aria-valuenow", String(Math.round(100 * place())));
    dispatchEvent(new Event("resize"));
  };
  const isBeside = () => bar.offsetHeight > bar.offsetWidth;
  /** Share of the page beyond the bar. */
  const place = () => {
    const [whole, at] = [app.getBoundingClientRect(), bar.getBoundingClientRect()];
    return isBeside() ? (whole.right - at.right) / whole.width : (whole.bottom - at.bottom) / whole.height;
  };
  const set = (share: number) => {
    const within = Math.max(LEAST, Math.min(MOST, share));
    apply(within);
    try {
      localStorage.setItem(KEPT, String(within));
    } catch {
      // A browser that keeps nothing divides the page in the default way.
    }
  };
  bar.addEventListener("pointerdown", (event) => bar.setPointerCapture(event.pointerId));
  bar.addEventListener("pointermove", (event) => {
    if (!bar.hasPointerCapture(event.pointerId)) return;
    const whole = app.getBoundingClientRect();
    const beyond = (whole.right - event.clientX) / whole.width;
    set(isBeside() ? beyond : (whole.bottom - event.clientY) / whole.height);
  });
  bar.addEventListener("dblclick", () => {
    localStorage.removeItem(KEPT);
    apply(null);
  });
  bar.addEventListener("keydown", (event) => {
    const by = { ArrowLeft: STEP, ArrowUp: STEP, ArrowRight: -STEP, ArrowDown: -STEP }[event.key];
    if (by === undefined) return;
    event.preventDefault();
    // The arrows otherwise step through time.
    event.stopPropagation();
    set(place() + by);
  });
  try {
    const kept = Number(localStorage.getItem(KEPT));
    if (kept >= LEAST && kept <= MOST) apply(kept);
  } catch {
    // As above.
  }
  return bar;
}
