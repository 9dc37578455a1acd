// Marks in time with notes of the reader, saved with the page.
import { button, element } from "./dom";
import { savePage } from "./saving";
import type { Note, PageData } from "./types";
import type { VideoBeside } from "./video";

export class Notes {
  readonly place = element("section", { id: "notes" });
  private notes: Note[];
  private isSaved = true;
  private readonly list = element("ul");
  private readonly text = element("input", {
    type: "text",
    placeholder: "a note at this time",
    "aria-label": "note",
    maxlength: "500",
  });
  private readonly saving: HTMLButtonElement;

  constructor(
    private readonly data: PageData,
    private readonly video: VideoBeside,
    private readonly now: () => number,
    private readonly seek: (time: number) => void,
  ) {
    this.notes = [...data.notes];
    this.text.addEventListener("keydown", (event) => {
      if (event.key === "Enter") this.add();
    });
    this.saving = button("save page", "Save this page, with notes and the place of the video", () => this.save());
    video.onChange(() => this.changed());
    const mark = button("mark", "Mark the present time with the note (M writes one)", () => this.add());
    this.place.append(
      element("h2", {}, "Notes"),
      this.list,
      element("div", { class: "joints" }, this.text, mark, this.saving),
    );
    addEventListener("beforeunload", (event) => {
      if (!this.isSaved) event.preventDefault();
    });
    this.show();
  }

  /** Begins a note. */
  write(): void {
    this.text.focus();
  }

  private add(): void {
    this.notes.push({ time_s: this.now(), text: this.text.value.trim() });
    this.notes.sort((a, b) => a.time_s - b.time_s);
    this.text.value = "";
    this.text.blur();
    this.changed();
  }

  private changed(): void {
    this.isSaved = false;
    this.show();
  }

  private save(): void {
    savePage(this.data, { notes: this.notes, video: this.video.kept });
    this.isSaved = true;
    this.show();
  }

  private show(): void {
    this.saving.textContent = this.isSaved ? "save page" : "save page (changed)";
    this.list.replaceChildren(
      ...this.notes.map((note) => {
        const time = `${note.time_s.toFixed(2)} s`;
        const remove = button("remove", `Remove the note at ${time}`, () => {
          this.notes = this.notes.filter((other) => other !== note);
          this.changed();
        });
        const go = button(time, `Go to ${time}`, () => this.seek(note.time_s));
        return element("li", {}, go, ` ${note.text} `, remove);
      }),
    );
  }
}
