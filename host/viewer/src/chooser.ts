// Selects which plots are shown, and in which order.
import { button, element } from "./dom";
import type { PlotSpec, Plots } from "./plots";

/** List of channels with checkboxes, and arrows to reorder them. */
export function chooser(all: PlotSpec[], plots: Plots): HTMLElement {
  const rows = element("ul", { id: "channels" });
  const apply = () => {
    const items = [...rows.children] as HTMLElement[];
    const wanted = items.filter((item) => item.querySelector("input")?.checked);
    plots.choose(wanted.map((item) => item.dataset.key ?? ""));
  };
  for (const spec of all) {
    const box = element("input", { type: "checkbox", "aria-label": `show ${spec.title}` });
    box.checked = !spec.aside;
    box.addEventListener("change", apply);
    const item = element("li", { "data-key": spec.key });
    const move = (name: string, sign: string, by: (item: Element) => void) =>
      button(sign, `Move ${spec.title} ${name}`, () => {
        by(item);
        apply();
      });
    item.append(
      element("label", {}, box, ` ${spec.title}`),
      move("up", "↑", (at) => at.previousElementSibling?.before(at)),
      move("down", "↓", (at) => at.nextElementSibling?.after(at)),
    );
    rows.append(item);
  }
  return element("details", { class: "choose" }, element("summary", {}, "channels"), rows);
}
