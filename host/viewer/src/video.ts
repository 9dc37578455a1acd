// A video of the flight beside the body, in step with it. The reader chooses the file; it stays on the reader's machine unless
// the reader embeds it in the page.
import { button, element } from "./dom";
import type { Video } from "./types";

/** Difference from the time of the flight beyond which a playing video is set again (s). */
const APART = 0.15;

export class VideoBeside {
  readonly button: HTMLButtonElement;
  readonly place = element("div", { class: "over video", id: "video" });
  private readonly screen = element("video", { playsinline: "", preload: "auto" });
  private readonly title = element("span", { class: "faint" });
  private readonly begins = element("input", { type: "number", step: "0.01", "aria-label": "video begins at (s)" });
  private readonly embed = element("input", { type: "checkbox", "aria-label": "embed the video" });
  private readonly file = element("input", { type: "file", accept: "video/*", "aria-label": "video" });
  private readonly acts: (() => void)[] = [];
  private name = "";
  private content: string | null = null;
  private last: [time: number, pace: number] = [0, 0];

  constructor(given: Video | null) {
    this.button = button("video", "A video of the flight from your disk, in step with the body", () =>
      this.file.click(),
    );
    this.file.addEventListener("change", () => {
      const chosen = this.file.files?.[0];
      if (chosen) this.open(chosen.name, chosen);
      this.changed();
    });
    // The volume of a video of a fall is wind.
    this.screen.muted = true;
    this.screen.addEventListener("error", () => {
      if (this.screen.src) this.title.textContent = `${this.name}: this browser cannot play it`;
    });
    this.screen.addEventListener("loadeddata", () => this.follow(...this.last));
    this.begins.addEventListener("input", () => this.changed());
    this.embed.addEventListener("change", () => this.read());
    const nudge = (by: number, sign: string) =>
      button(sign, `Begin the video ${sign} s`, () => {
        this.begins.value = (Number(this.begins.value) + by).toFixed(2);
        this.changed();
      });
    this.place.append(
      this.screen,
      element(
        "div",
        {},
        this.title,
        element("label", {}, " begins at ", this.begins, " s "),
        nudge(-0.04, "−0.04"),
        nudge(0.04, "+0.04"),
        element("label", { title: "Write the video into the page when it is saved" }, this.embed, " embed"),
        button("close", "Close the video", () => this.close()),
      ),
    );
    this.place.hidden = true;
    this.begins.value = String(given?.begins_s ?? 0);
    if (given) this.restore(given);
  }

  /** What is saved with the page. */
  get kept(): Video | null {
    if (!this.name) return null;
    return { name: this.name, begins_s: Number(this.begins.value) || 0, content: this.content };
  }

  /** Calls `act` after each change by the reader. */
  onChange(act: () => void): void {
    this.acts.push(act);
  }

  /** Shows the picture of a time (s) of the flight, which passes at a pace; 0 if it is still. */
  follow(time: number, pace: number): void {
    this.last = [time, pace];
    const { screen } = this;
    if (this.place.hidden || !(screen.duration > 0)) return;
    const wanted = time - (Number(this.begins.value) || 0);
    const within = Math.max(0, Math.min(screen.duration, wanted));
    if (pace === 0 || within !== wanted) {
      if (!screen.paused) screen.pause();
      if (Math.abs(screen.currentTime - within) > 0.001) screen.currentTime = within;
      return;
    }
    screen.playbackRate = pace;
    if (Math.abs(screen.currentTime - within) > APART * Math.max(1, pace)) screen.currentTime = within;
    // A browser may refuse to play; the pictures are then set one by one.
    if (screen.paused)
      screen.play().catch(() => {
        screen.currentTime = within;
      });
  }

  private changed(): void {
    this.follow(...this.last);
    for (const act of this.acts) act();
  }

  private open(name: string, content: Blob): void {
    URL.revokeObjectURL(this.screen.src);
    this.name = name;
    this.title.textContent = name;
    this.screen.src = URL.createObjectURL(content);
    this.place.hidden = false;
    this.embed.checked = false;
    this.content = null;
  }

  private restore({ name, content }: Video): void {
    if (content === null) {
      this.name = name;
      this.button.textContent = `video: ${name}`;
      this.button.title = `The notes are about the video ${name}: choose it from your disk`;
      return;
    }
    this.open(name, new Blob([Uint8Array.from(atob(content), (letter) => letter.charCodeAt(0))]));
    this.embed.checked = true;
    this.content = content;
  }

  /** Reads the file into memory, or forgets it, as the reader wishes. */
  private read(): void {
    this.content = null;
    const file = this.file.files?.[0];
    if (!this.embed.checked || !file) {
      this.changed();
      return;
    }
    const reader = new FileReader();
    reader.onload = () => {
      this.content = String(reader.result).split(",")[1] ?? null;
      this.changed();
    };
    reader.readAsDataURL(file);
  }

  private close(): void {
    URL.revokeObjectURL(this.screen.src);
    this.screen.removeAttribute("src");
    this.place.hidden = true;
    this.name = "";
    this.content = null;
    this.changed();
  }
}
