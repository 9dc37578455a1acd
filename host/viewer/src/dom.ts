// Small steps with the page's elements.

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
    // A pointer leaves no focus behind: the space bar is that of the page again.
    if (event.detail > 0) made.blur();
    act();
  });
  return made;
}

/** A button that stays pressed. */
export function toggle(label: string, title: string, on: boolean, act: (on: boolean) => void): HTMLButtonElement {
  const made = button(label, title, () => {
    on = !on;
    made.setAttribute("aria-pressed", String(on));
    act(on);
  });
  made.setAttribute("aria-pressed", String(on));
  return made;
}

export function colour(name: string): string {
  return getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
}

export function save(name: string, content: Blob): void {
  const link = element("a", { href: URL.createObjectURL(content), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}

/** Whether keys belong to a field that is being filled in. */
export function typing(event: KeyboardEvent): boolean {
  const target = event.target as HTMLElement;
  return target.tagName === "SELECT" || (target.tagName === "INPUT" && target.getAttribute("type") !== "range");
}
