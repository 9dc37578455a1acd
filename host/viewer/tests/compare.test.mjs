import assert from "node:assert/strict";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { browser, open, run, scratch, shot } from "./browser.mjs";

const folder = scratch("compare");
const at = (name) => join(folder, name);
let chromium;

before(async () => {
  await run("synth", "rotations", "--seed", "1", "--noise", "0.3", "--out", at("student"));
  await run("synth", "rw-suit-turns", "--seed", "1", "--noise", "0.3", "--out", at("expert"));
  await run("compare", at("student"), at("expert"), "--to", "9", "--page", at("compare.html"));
  chromium = await browser();
});
after(() => chromium?.close());

test("both bodies are shown with their own postures, and a difference is where it begins", async () => {
  const { page, wrong } = await open(chromium, `file://${at("compare.html")}`, {
    viewport: { width: 1280, height: 720 },
  });
  await page.waitForSelector("html[data-ready=compare]");
  const said = await page.textContent("#words");
  assert.match(said, /shoulder \([lr]_upperarm\.phi\) \d+ \+- \d+ degrees (more|less) from/);
  assert.match(await page.textContent("#key"), /A student.*B expert \(outline\)/);
  assert.match(await page.textContent("#plot-legend"), /student/);
  // Without the other body the picture is another one.
  await page.waitForTimeout(300);
  const picture = () => page.locator("main canvas").first().screenshot();
  const both = await picture();
  await page.click("button:text-is('other')");
  await page.waitForTimeout(300);
  assert.ok(!both.equals(await picture()), "the other body is drawn");
  await page.click("button:text-is('other')");
  const before = await page.textContent("#time");
  await page.keyboard.press("End");
  assert.notEqual(await page.textContent("#time"), before);
  await page.click("#words button >> nth=0");
  const from = /from (-?[\d.]+) s/.exec(await page.textContent("#words li >> nth=0"))[1];
  assert.ok(Math.abs(Number.parseFloat(await page.textContent("#time")) - Number(from)) < 0.02);
  await shot(page, "compare");
  assert.deepEqual(wrong, []);
  await page.close();
});
