import assert from "node:assert/strict";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { begin, browser, colours, inked, open, run, scratch, shot } from "./browser.mjs";

const folder = scratch("live");
const SECONDS = 14;
let chromium;

before(async () => {
  await run("synth", "tracking", "--seed", "1", "--out", folder);
  chromium = await browser();
});
after(() => chromium?.close());

test("a stream is shown while it runs: bodies, latency, counters, estimates", async () => {
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
  await page.click('button:text-is("restart")');
  await page.waitForFunction(() => document.querySelector("#legend").textContent.includes("restarted once"));
  await page.waitForSelector("[data-plot=latency] canvas");
  await page.waitForTimeout(1500);
  const number = async (name) => Number.parseFloat(await page.textContent(`#${name}`));
  const [rate, latency] = [await number("frames-per-second"), await number("latency")];
  console.log(`live: ${rate} frames a second, latency ${latency} ms`);
  assert.ok(rate > 10, `${rate} frames a second`);
  assert.ok(latency > 0 && latency < 1000, `latency ${latency} ms`);
  const dropped = await number("dropped");
  assert.ok((await colours(page, "main > canvas")) > 100);
  assert.equal(await page.locator(".plot").count(), 12);
  // Two bodies, one of them simulated.
  const remark = await page.textContent("#legend");
  assert.match(remark, /simulated from the postures alone for \d+\.\d s/);
  assert.match(remark, /fall rate \d+\.\d \(measured \d+\.\d\)/);
  const both = ["measured", "simulated"].map((ink) => inked(page, "[data-plot=vertical_velocity_mps] canvas", ink));
  for (const count of await Promise.all(both)) assert.ok(count > 30, "both fall rates are drawn");
  assert.ok((await inked(page, "[data-plot=latency] canvas", "measured")) > 30, "the latency is drawn");
  assert.ok((await inked(page, '[data-plot="muscle pitch"] canvas', "simulated")) > 30, "the estimate is drawn");
  await page.click('footer button:text-is("pause")');
  const held = await page.textContent("#time");
  await page.waitForTimeout(400);
  assert.equal(await page.textContent("#time"), held);
  await page.click('footer button:text-is("continue")');
  await shot(page, "live");
  const { code, out, err } = await program.end;
  const report = JSON.parse(out);
  // A busy machine may drop samples, but the counts must be right.
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

test("a streaming suit without a unit is shown next to a simulated body", async () => {
  const program = begin(
    "--json",
    "mvn",
    "listen",
    "--bind",
    "127.0.0.1:0",
    "--frames",
    "1200",
    "--view",
    "--flight",
    join(folder, "flight.toml"),
  );
  const address = await program.line(/"listening":\s*"([^"]+)"/);
  const url = await program.line(/(http:\/\/127\.0\.0\.1:\S+)/);
  const { page, wrong } = await open(chromium, url);
  await page.waitForSelector("html[data-ready=live]");
  const sender = begin("mvn", "send", join(folder, "flight.mvnx"), "--to", address);
  await page.waitForFunction(() => Number(document.querySelector("#frames-received")?.textContent) > 700);
  assert.match(await page.textContent("#legend"), /simulated from the postures alone for \d+\.\d s/);
  assert.equal(await page.locator(".plot").count(), 5);
  assert.equal(await page.locator("#latency").count(), 0);
  assert.ok((await colours(page, "main > canvas")) > 100);
  await shot(page, "listen");
  const { code, out } = await program.end;
  assert.equal(code, 0, out);
  sender.child.kill();
  await sender.end;
  assert.deepEqual(wrong, []);
  await page.close();
});

/** Whether the legend and the values of a plot agree on both fall rates. Runs in the page. */
function legendMatches(plot) {
  const number = (text) => Number(text.replace("−", "-"));
  const text = document.querySelector("#legend").textContent;
  const legend = /fall rate (−?\d+\.\d) \(measured (−?\d+\.\d)\)/.exec(text);
  const values = [...document.querySelectorAll(`${plot} .value`)].map((value) => number(value.textContent));
  return legend && values.length > 1 && values.every((value, k) => Math.abs(value + number(legend[2 - k])) < 0.06);
}

test("a streamed recording of a real flight is shown with a simulated body", async () => {
  // A recorded somersault with two twists: 1.14 s at 200 Hz, not produced by the model.
  const real = (name) => join(import.meta.dirname, "../../../verbs/data/acrobatics", name);
  const frames = 228;
  const program = begin(
    ...["--json", "mvn", "listen", "--bind", "127.0.0.1:0", "--frames", String(frames)],
    ...["--view", "--flight", real("flight-1.toml")],
  );
  const address = await program.line(/"listening":\s*"([^"]+)"/);
  const url = await program.line(/(http:\/\/127\.0\.0\.1:\S+)/);
  const { page, wrong } = await open(chromium, url);
  await page.waitForSelector("html[data-ready=live]");
  await run("mvn", "send", real("flight-1.toml"), "--to", address, "--speed", "0.25");
  const { code, out, err } = await program.end;
  assert.equal(code, 0, err);
  const { totals } = JSON.parse(out.trim().split("\n").pop());
  assert.equal(totals.frames, frames, out);
  await page.waitForFunction(() => document.querySelector("#state").textContent.includes("ended"));
  await page.waitForFunction(() => / alone for 1\.\d s$/.test(document.querySelector("#legend").textContent));

  // Plots and legend both show the last frame once all is drawn, with both bodies.
  const plot = "[data-plot=vertical_velocity_mps]";
  await page.waitForFunction(legendMatches, plot, { timeout: 20_000 });

  // The simulation started with the second frame and falls like the person.
  const remark = await page.textContent("#legend");
  const [, alone] = /simulated from the postures alone for (\d+\.\d) s$/.exec(remark) ?? assert.fail(remark);
  assert.ok(Number(alone) >= 1 && Number(alone) <= 1.2, remark);
  const falling = /fall rate (−?\d+\.\d) \(measured (−?\d+\.\d)\)/.exec(remark) ?? assert.fail(remark);
  const [simulated, measured] = falling.slice(1).map((text) => Number(text.replace("−", "-")));
  console.log(`real flight: ${alone} s alone, fall rate ${simulated} m/s, measured ${measured} m/s`);
  assert.ok(measured > 3, "the recording ends on the way down");
  // Gravity has added more than 10 m/s.
  assert.ok(Math.abs(simulated - measured) < 1, remark);

  for (const ink of ["measured", "simulated"])
    assert.ok((await inked(page, `${plot} canvas`, ink)) > 20, `the ${ink} fall rate is drawn`);

  // The picture shows the outline of the measured body; without it the simulated body is left, and moves.
  const outlined = await inked(page, "main > canvas", "ghost");
  await page.click('button:text-is("measured")');
  const plain = await inked(page, "main > canvas", "ghost");
  assert.ok(outlined > plain + 100, `${outlined} pixels of the outline, without it ${plain}`);
  const picture = () => page.evaluate(() => document.querySelector("main > canvas").toDataURL());
  const last = await picture();
  await page.evaluate(() => {
    const slider = document.querySelector("footer input");
    slider.value = "3";
    slider.dispatchEvent(new Event("input"));
  });
  await page.waitForFunction(() => / alone for 0\.\d s$/.test(document.querySelector("#legend").textContent));
  assert.notEqual(await picture(), last);
  await page.click('button:text-is("measured")');
  await shot(page, "real");
  assert.deepEqual(wrong, []);
  await page.close();
});
