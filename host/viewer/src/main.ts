// Entry point; the data selects the mode.
import { compare } from "./compare";
import { BadData, pageData } from "./data";
import { fly } from "./fly";
import { live } from "./live";
import { replay } from "./replay";
import { keepPage } from "./saving";
import { problem } from "./shell";
import "./style.css";

async function main(): Promise<void> {
  keepPage();
  const data = pageData();
  if (data.mode === "replay" && data.runs.length > 0) await replay(data);
  else if (data.mode === "fly" && data.fly) fly(data, data.fly);
  else if (data.mode === "compare" && data.beside) await compare(data, data.beside);
  else if (data.mode === "live") live(data);
  else throw new BadData("This page contains no flight.");
}

main().catch((error: unknown) => {
  problem(error instanceof Error ? error.message : String(error));
  if (!(error instanceof BadData)) console.error(error);
});
