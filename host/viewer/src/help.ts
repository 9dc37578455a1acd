// The list of keys, opened with "?".
import { button, element, typing } from "./dom";

/** Keys and their actions. */
export type Keys = [string, string][];

export const CAMERA_KEYS: Keys = [
  ["V", "camera free"],
  ["T", "camera trailing"],
  ["X  Y  Z", "from the north, the west, above"],
  ["B", "the sixteen segments"],
];

/** A button that opens the list, like the key "?". */
export function help(...groups: [string, Keys][]): HTMLElement {
  const dialog = element("dialog", { id: "help", "aria-label": "keys" });
  for (const [title, keys] of groups) {
    const list = element("dl");
    for (const [key, does] of keys)
      list.append(element("dt", {}, element("span", { class: "key" }, key)), element("dd", {}, does));
    dialog.append(element("h2", {}, title), list);
  }
  dialog.append(button("close", "Close (Esc)", () => dialog.close()));
  document.body.append(dialog);
  const flip = () => (dialog.open ? dialog.close() : dialog.showModal());
  addEventListener("keydown", (event) => {
    if (event.key === "?" && !typing(event)) flip();
  });
  return button("?", "Keys (?)", flip);
}
