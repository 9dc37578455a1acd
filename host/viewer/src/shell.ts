// Page structure shared by all modes.

import { element } from "./dom";
import { splitter } from "./splitter";
import type { PageData } from "./types";

export interface Shell {
  header: HTMLElement;
  main: HTMLElement;
  aside: HTMLElement;
  footer: HTMLElement;
}

export function shell(data: PageData): Shell {
  const app = document.getElementById("app") as HTMLElement;
  document.title = `${data.title || data.mode} - bodyflight`;
  const header = element("header", {}, element("h1", {}, data.title || data.mode));
  const parts = { header, main: element("main"), aside: element("aside"), footer: element("footer") };
  app.replaceChildren(parts.header, parts.main, splitter(app), parts.aside, parts.footer);
  return parts;
}

export function provenance(data: PageData): HTMLElement {
  const { version, command, inputs } = data.provenance;
  const list = element(
    "dl",
    { id: "provenance" },
    element("dt", {}, "bodyflight"),
    element("dd", {}, version),
    element("dt", {}, "command"),
    element("dd", {}, command),
  );
  for (const { file, sha256 } of inputs)
    list.append(element("dt", {}, file), element("dd", { title: sha256 }, `sha256 ${sha256.slice(0, 12)}`));
  return element("section", {}, element("h2", {}, "Where this page comes from"), list);
}

/** Why flights should not be trusted, a sentence for each; empty if all are. */
export function doubts(flights: { name: string; doubt: string | null }[]): HTMLElement[] {
  const doubted = flights.filter((flight) => flight.doubt);
  if (doubted.length === 0) return [];
  const sentences = doubted.map(({ name, doubt }) => element("p", {}, `Do not trust ${name}: ${doubt}`));
  return [element("section", { id: "doubt", role: "alert" }, ...sentences)];
}

/** Shows an error instead of the page. */
export function problem(message: string): void {
  const app = document.getElementById("app") as HTMLElement;
  app.replaceChildren(element("div", { class: "banner", role: "alert", id: "problem" }, message));
}
