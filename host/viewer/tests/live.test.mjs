import assert from "node:assert/strict";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { begin, browser, colours, inked, open, run, scratch, shot } from "./browser.mjs";

const folder = scratch("live");
const SECONDS = 8;
let chromium;

before(async () => {
  await run("synth", "tracking", "--seed", "1", "--out", folder);
  chromium = await browser();
});
after(() => chromium?.close());

test("a stream is seen while it goes: body, latency, counters, estimates", async () => {
  const program = begin(
    "--json",
    "stream",
    join(folder, "flight.toml"),
    "--virtual",
    "--view",
    "--seconds",
    String(SECONDS),
  );
  const url = await program.line(/(http:\/\/127\.0\.0\.1:\S+)/);
  const { page, wrong } = await open(chromium, url);
  await page.waitForSelector("html[data-ready=live]");
  await page.waitForFunction(() => Number(document.querySelector("#estimates")?.textContent) > 100);
  await page.waitForSelector("[data-plot=latency] canvas");
  await page.waitForTimeout(1500);
  const number = async (name) => Number.parseFloat(await page.textContent(`#${name}`));
  const [rate, latency] = [await number("frames-a-second"), await number("latency")];
  console.log(`live: ${rate} frames a second, latency ${latency} ms`);
  assert.ok(rate > 10, `${rate} frames a second`);
  assert.ok(latency > 0 && latency < 1000, `latency ${latency} ms`);
  const dropped = await number("dropped");
  assert.ok((await colours(page, "main > canvas")) > 100);
  assert.equal(await page.locator(".plot").count(), 7);
  assert.ok((await inked(page, "[data-plot=latency] canvas", "measured")) > 30, "the latency is drawn");
  assert.ok((await inked(page, '[data-plot="muscle pitch"] canvas', "simulated")) > 30, "the estimate is drawn");
  await page.click('footer button:text-is("pause")');
  const held = await page.textContent("#time");
  await page.waitForTimeout(400);
  assert.equal(await page.textContent("#time"), held);
  await page.click('footer button:text-is("go on")');
  await shot(page, "live");
  const { code, out, err } = await program.end;
  const report = JSON.parse(out);
  // A busy machine may be late; what it says must still be right.
  assert.equal(code, report.unit.dropped_oldest === 0 ? 0 : 4, err);
  assert.ok(report.sent > 240 * (SECONDS - 1), out);
  assert.ok(dropped <= report.unit.dropped_oldest, `the page says ${dropped} were dropped: ${out}`);
  await page.waitForFunction(() => document.querySelector("#state").textContent.includes("ended"));
  await page.evaluate(() => {
    const slider = document.querySelector("footer input");
    slider.value = "10";
    slider.dispatchEvent(new Event("input"));
  });
  await page.waitForFunction(() => Number.parseFloat(document.querySelector("#time").textContent) < 1);
  assert.deepEqual(wrong, []);
  await page.close();
});
