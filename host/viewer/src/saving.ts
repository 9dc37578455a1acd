// Saves the page itself, with what its reader added.
import { save } from "./dom";
import type { Note, PageData, Video } from "./types";

/** What a reader adds to a page. */
export interface Added {
  notes: Note[];
  video: Video | null;
}

const DATA = /(<script type="application\/json" id="bodyflight-data">)[^<]*(<\/script>)/;

/** The page as it was opened. */
let opened = "";

/** Keeps the page as it is, before anything is added to it. */
export function keepPage(): void {
  opened = `<!doctype html>\n${document.documentElement.outerHTML}\n`;
}

/** The page as opened, with other data. */
function page(data: PageData): string {
  // Texts come from users, and must not be able to end the script.
  const json = JSON.stringify(data).replaceAll("<", "\\u003c");
  return opened.replace(DATA, (_, begin: string, end: string) => begin + json + end);
}

/** Saves the page with what its reader added. */
export function savePage(data: PageData, added: Added): void {
  const name = `${data.title || data.mode}.html`;
  save(name, new Blob([page({ ...data, ...added })], { type: "text/html" }));
}
