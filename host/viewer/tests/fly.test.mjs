import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { existsSync } from "node:fs";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { begin, browser, inked, NATIVE, open, run, scratch, shot } from "./browser.mjs";

const folder = scratch("fly");
let chromium;
let program;
let url;

before(async () => {
  chromium = await browser();
  program = begin("fly", "--save", folder, "--json");
  url = await program.line(/"url":"([^"]+)"/);
});
after(async () => {
  await chromium?.close();
  program?.child.kill("SIGINT");
  assert.equal((await program?.end)?.code, 130, "Ctrl-C is the way to end");
});

const ready = (page) => page.waitForSelector("html[data-ready=fly]");
const yawRate = (page) =>
  page.evaluate(() => {
    const { core } = window.bodyflight;
    return core.layout.part(core.frame(), "observation")[3];
  });

test("a held turn key turns, and releasing it slows the turn", async () => {
  const { page, wrong } = await open(chromium, url);
  await ready(page);
  assert.ok(Math.abs(await yawRate(page)) < 0.01);
  await page.keyboard.down("a");
  await page.waitForTimeout(2500);
  const turning = await yawRate(page);
  await shot(page, "fly");
  assert.ok((await inked(page, "[data-plot=yaw_rate_radps] canvas", "simulated")) > 30, "the plot draws the turn");
  await page.keyboard.up("a");
  console.log(`yaw rate after holding A for 2.5 s: ${turning.toFixed(2)} rad/s`);
  assert.ok(Math.abs(turning) > 0.1, String(turning));
  await page.waitForTimeout(3000);
  assert.ok(Math.abs(await yawRate(page)) < Math.abs(turning));
  await page.keyboard.press("0");
  assert.ok(Math.abs(await yawRate(page)) < 0.05);
  assert.deepEqual(wrong, []);
  await page.close();
});

test("the core in the page is bit-identical to the native one", async () => {
  const { page, wrong } = await open(chromium, url);
  await ready(page);
  const script = [
    "begin 0",
    "step 240",
    "see",
    "command 0 1",
    "step 480",
    "see",
    "command 0 -0.5",
    "command 3 0.7",
    "joint 4 2 0.3",
    "step 2400",
    "see",
    "muscle -1.2 0.5 2",
    "damping 0.2 0.5 6",
    "step 1200",
    "see",
    "begin 5",
    "step 4800",
    "see",
    "begin 2",
    "hold 1",
    "command 2 1",
    "step 2400",
    "see",
  ];
  const { setup, frames } = await page.evaluate((script) => {
    const { core, flight } = window.bodyflight;
    const bits = (numbers) =>
      [...new Uint32Array(Float32Array.from(numbers).buffer)].map((n) => n.toString(16).padStart(8, "0")).join(" ");
    const frames = [];
    for (const line of script) {
      const [order, ...numbers] = line.split(" ");
      if (order === "see") frames.push(bits(core.frame()));
      else core.exports[order](...numbers.map(Number));
    }
    return { setup: bits(flight.setup), frames };
  }, script);
  const native = spawnSync(NATIVE, { input: `${[setup, ...script].join("\n")}\n`, encoding: "utf8" });
  assert.equal(native.status, 0, native.stderr);
  const expected = native.stdout.trim().split("\n");
  assert.equal(frames.length, 6);
  for (const [k, frame] of frames.entries()) assert.equal(frame, expected[k], `frame ${k}`);
  assert.ok(new Set(frames).size === 6);
  console.log("11520 steps, 6 frames of 257 numbers: the same bits");
  assert.deepEqual(wrong, []);
  await page.close();
});

test("the novice oscillates, and every start works", async () => {
  const { page, wrong } = await open(chromium, url);
  await ready(page);
  const pitches = await page.evaluate(() => {
    const { core, flight } = window.bodyflight;
    const swing = (start) => {
      core.exports.begin(start);
      core.exports.step(2400);
      let [low, high] = [Infinity, -Infinity];
      for (let k = 0; k < 80; k++) {
        core.exports.step(24);
        const pitch = core.layout.part(core.frame(), "observation")[1];
        [low, high] = [Math.min(low, pitch), Math.max(high, pitch)];
      }
      return high - low;
    };
    return Object.fromEntries(flight.starts.map((name, k) => [name, swing(k)]));
  });
  console.log("pitch from lowest to highest (rad):", pitches);
  assert.ok(pitches.novice > 0.3 && pitches.neutral < 0.05);
  assert.ok(Object.values(pitches).every(Number.isFinite));
  await page.selectOption("#start", { label: "track" });
  await page.waitForTimeout(300);
  await shot(page, "fly-track");
  assert.deepEqual(wrong, []);
  await page.close();
});

test("a recorded flight is saved in a form that every verb reads", async () => {
  const { page, wrong } = await open(chromium, url);
  await ready(page);
  await page.click('button:text-is("record")');
  await page.keyboard.down("d");
  await page.waitForTimeout(2000);
  await page.keyboard.up("d");
  await page.click('button:text-is("save")');
  await page.waitForFunction(() => document.querySelector("#message").textContent !== "");
  assert.match(await page.textContent("#message"), /^Saved/);
  const flight = join(folder, "flown-0", "flight.toml");
  assert.ok(existsSync(flight));
  const report = JSON.parse(await run("--json", "simulate", flight));
  console.log(
    `saved ${report.frames} frames; flown again: yaw rate apart by ${report.rms.yaw_rate_radps.toExponential(1)} rad/s RMS`,
  );
  assert.ok(report.rms.yaw_rate_radps < 0.01, JSON.stringify(report.rms));
  assert.deepEqual(wrong, []);
  await page.close();
});

test("the space bar pauses and saves nothing", async () => {
  const { page, wrong } = await open(chromium, url);
  await ready(page);
  await page.click('button:text-is("record")');
  await page.waitForTimeout(200);
  await page.keyboard.press("Space");
  await page.waitForTimeout(200);
  assert.equal(await page.locator('button:text-is("save")').count(), 1);
  assert.equal(await page.textContent("#message"), "");
  const height = () => page.textContent("#legend");
  const held = await height();
  await page.waitForTimeout(200);
  assert.equal(await height(), held);
  assert.deepEqual(wrong, []);
  await page.close();
});

test("the autopilot holds a sit, which falls over without it; the air holds head-down", async () => {
  const { page, wrong } = await open(chromium, url);
  await ready(page);
  const tilts = async (name) => {
    await page.selectOption("#start", { label: name });
    const found = await page.evaluate((name) => {
      const { core, flight } = window.bodyflight;
      const most = (held) => {
        core.exports.begin(flight.starts.indexOf(name));
        core.exports.hold(held);
        let tilt = 0;
        for (let k = 0; k < 300; k++) {
          core.exports.step(24);
          tilt = Math.max(tilt, core.exports.tilt());
        }
        return (tilt * 180) / Math.PI;
      };
      return { held: most(1), free: most(0) };
    }, name);
    console.log(`${name}, 30 s: off by at most ${found.held.toFixed(1)} degrees held, ${found.free.toFixed(0)} not`);
    return found;
  };
  const sit = await tilts("sit");
  assert.ok(sit.held < 10 && sit.free > 60, JSON.stringify(sit));
  const headDown = await tilts("head-down");
  assert.ok(headDown.free < 10, JSON.stringify(headDown));
  await page.selectOption("#start", { label: "sit" });
  assert.equal(await page.getAttribute("#autopilot", "aria-pressed"), "true");
  await page.waitForTimeout(3000);
  assert.match(await page.textContent("#holding"), /^autopilot holds the pose/);
  await page.keyboard.press("h");
  await page.waitForFunction(() => /autopilot off/.test(document.querySelector("#holding").textContent));
  await page.selectOption("#start", { label: "neutral" });
  assert.equal(await page.isDisabled("#autopilot"), true);
  assert.deepEqual(wrong, []);
  await page.close();
});

test("another page cannot reach the server", async () => {
  const { page } = await open(chromium, "about:blank");
  const refused = await page.evaluate(
    (url) =>
      new Promise((resolve) => {
        const socket = new WebSocket(`${url.replace("http", "ws")}socket`);
        socket.onopen = () => resolve(false);
        socket.onerror = () => resolve(true);
      }),
    url,
  );
  assert.ok(refused);
});
