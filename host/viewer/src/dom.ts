// Helpers for the page's elements.

export function element<K extends keyof HTMLElementTagNameMap>(
  tag: K,
  attributes: Record<string, string> = {},
  ...children: (Node | string)[]
): HTMLElementTagNameMap[K] {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  made.append(...children);
  return made;
}

export function button(label: string, title: string, act: () => void): HTMLButtonElement {
  const made = element("button", { type: "button", title }, label);
  made.addEventListener("click", (event) => {
    // Drop the focus after a click so that the space bar controls the page again.
    if (event.detail > 0) made.blur();
    act();
  });
  return made;
}

/** A toggle button. */
export function toggle(label: string, title: string, on: boolean, act: (on: boolean) => void): HTMLButtonElement {
  const made = button(label, title, () => {
    on = !on;
    made.setAttribute("aria-pressed", String(on));
    act(on);
  });
  made.setAttribute("aria-pressed", String(on));
  return made;
}

const scheme = matchMedia("(prefers-color-scheme: dark)");
const colours = new Map<string, string>();
scheme.addEventListener("change", () => colours.clear());

/** Returns a colour of the style sheet. */
export function colour(name: string): string {
  let known = colours.get(name);
  if (known === undefined) {
    known = getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
    colours.set(name, known);
  }
  return known;
}

/** Calls `act` after a change between light and dark colours. */
export function onRecolour(act: () => void): void {
  scheme.addEventListener("change", act);
}

export function save(name: string, content: Blob): void {
  const link = element("a", { href: URL.createObjectURL(content), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}

/** Returns whether a key event belongs to an input field. */
export function typing(event: KeyboardEvent): boolean {
  const target = event.target as HTMLElement;
  return target.tagName === "SELECT" || (target.tagName === "INPUT" && target.getAttribute("type") !== "range");
}
