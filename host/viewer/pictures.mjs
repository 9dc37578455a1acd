// Creates the pictures of the documentation: cargo xtask viewer --pictures.
import { join } from "node:path";
import { begin, browser, open, run, scratch } from "./tests/browser.mjs";

const docs = new URL("../../docs/", import.meta.url).pathname;
const folder = scratch("pictures");
const chromium = await browser();
const keep = (page, name) => page.screenshot({ path: join(docs, `${name}.jpg`), type: "jpeg", quality: 72 });

await run("synth", "rotations", "--seed", "1", "--out", join(folder, "rotations"));
await run("view", join(folder, "rotations", "flight.toml"), "--out", join(folder, "view.html"));
const replay = (await open(chromium, `file://${folder}/view.html#t=13`)).page;
await replay.waitForSelector("html[data-ready=replay]");
await keep(replay, "viewer-replay");
await replay.close();

const program = begin("fly", "--save", folder, "--json");
const fly = (await open(chromium, await program.line(/"url":"([^"]+)"/), { colorScheme: "dark" })).page;
await fly.waitForSelector("html[data-ready=fly]");
await fly.keyboard.down("a");
await fly.waitForTimeout(3000);
await fly.keyboard.up("a");
await fly.waitForTimeout(1000);
await keep(fly, "viewer-fly");
await fly.close();
program.child.kill("SIGINT");

await run("hide", "wind", "--out", join(folder, "lab"), "--duration", "20");
const [first, second] = [0, 1].map((k) => join(folder, "lab", `flight-${k}`, "flight.toml"));
await run("discover", first, "--hold-out", second, "--out", join(folder, "found"));
await run(
  "view",
  first,
  "--model",
  join(folder, "found", "model.toml"),
  "--discovery",
  join(folder, "found", "report.json"),
  "--out",
  join(folder, "found.html"),
);
const found = (await open(chromium, `file://${folder}/found.html#t=8`)).page;
await found.waitForSelector("html[data-ready=replay]");
await keep(found, "viewer-discrepancy");
await chromium.close();
