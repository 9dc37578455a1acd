import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { existsSync, mkdirSync, readdirSync, writeFileSync } from "node:fs";
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
    "muscle -0.3 0.2 0.5",
    "tension -0.5",
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

/** Presses keys at times of the flight (s), which advances as the page's own steps do, and saves the flight. */
async function flownByHand(page, start, seconds, hand) {
  await page.selectOption("#start", { label: start });
  await page.keyboard.press("Space");
  await page.click('button:text-is("record")');
  await page.keyboard.press("0");
  let now = 0;
  const until = async (time) => {
    const steps = Math.round(240 * time) - now;
    await page.evaluate((steps) => window.bodyflight.advance(steps), steps);
    now += steps;
  };
  for (const [time, act, keys] of hand) {
    await until(time);
    for (const key of keys) await page.keyboard[act](key);
  }
  await until(seconds);
  await page.click('button:text-is("save")');
  await page.waitForFunction(() => document.querySelector("#message").textContent !== "");
  const [, path] = /^Saved: (.*)$/.exec(await page.textContent("#message")) ?? assert.fail("not saved");
  return path;
}

/** Angle by which the pelvis of a saved flight turned about an axis of the body (degrees), by its simulation. */
async function flownAgain(path) {
  const report = JSON.parse(await run("--json", "simulate", path));
  for (const [channel, gap] of Object.entries(report.rms)) assert.ok(gap < 1e-3, `${channel}: ${gap}`);
  const estimate = JSON.parse(await run("--json", "estimate", path));
  return { report, estimate };
}

for (const [name, start, seconds, hand] of [
  [
    "barrel roll",
    "neutral",
    8,
    [
      [2, "down", ["j", "n", "t"]],
      [3, "up", ["j", "n", "t"]],
      [3, "down", ["y"]],
      [4.5, "up", ["y"]],
    ],
  ],
  ["sit", "sit", 20, []],
  [
    "layout",
    "track",
    9,
    [
      [2, "down", ["i", "t"]],
      [2.4, "up", ["i"]],
      [2.9, "up", ["t"]],
      [2.9, "down", ["y"]],
      [4.6, "up", ["y"]],
    ],
  ],
]) {
  test(`a ${name} by hand is saved with its inputs, and its estimate is consistent`, async () => {
    const { page, wrong } = await open(chromium, url);
    await ready(page);
    const path = await flownByHand(page, start, seconds, hand);
    const { report, estimate } = await flownAgain(path);
    const { consistent } = estimate.consistency;
    console.log(
      `${name}: ${report.frames} frames, flown again: angular velocity apart by ${report.rms.angular_velocity_radps.toExponential(1)} rad/s RMS; consistent ${(100 * consistent).toFixed(0)} % of the time`,
    );
    assert.equal(estimate.doubt, null);
    assert.ok(consistent > 0.95, String(consistent));
    await shot(page, `fly-${name.replace(" ", "-")}`);
    assert.deepEqual(wrong, []);
    await page.close();
  });
}

test("the page warns near the ground, and the flight ends there", async () => {
  const { page, wrong } = await open(chromium, url);
  await ready(page);
  const ground = () => page.evaluate(() => document.querySelector("#ground:not([hidden])")?.textContent ?? "");
  await page.keyboard.press("Space");
  assert.match(await page.textContent("#legend"), /height above ground/);
  assert.equal(await ground(), "");
  const low = await page.evaluate(() => {
    const { core, flight, advance } = window.bodyflight;
    while (core.layout.part(core.frame(), "position_m")[2] >= flight.warning_height_m) advance(24);
    return core.frame()[0];
  });
  await page.waitForFunction(() => document.querySelector("#ground:not([hidden])"));
  assert.match(await ground(), /^Below 1000 m: open the parachute/);
  await shot(page, "fly-low");
  await page.evaluate(() => window.bodyflight.advance(240 * 60));
  await page.waitForFunction(() => /ended at the ground/.test(document.querySelector("#ground").textContent));
  console.log(`low after ${low.toFixed(1)} s; ${await ground()}`);
  await page.keyboard.press("0");
  await page.waitForFunction(() => document.querySelector("#ground").hidden);
  assert.deepEqual(wrong, []);
  await page.close();
});

test("sliders show joint and angle, and can be reset", async () => {
  const { page, wrong } = await open(chromium, url);
  await ready(page);
  await page.keyboard.press("Space");
  await page.selectOption("#joints select", { label: "left knee (l_shank)" });
  const slider = page.locator('#joints input[aria-label="phi (degrees)"]');
  const turned = () => page.textContent("#turned");
  await slider.fill("30");
  assert.match(await page.textContent("#joints"), /30°/);
  await page.selectOption("#joints select", { label: "neck (head)" });
  assert.equal(await slider.inputValue(), "0", "each joint has its own angles");
  assert.match(await turned(), /left knee/);
  const knee = () =>
    page.evaluate(() => {
      const { core, flight, advance } = window.bodyflight;
      advance(240);
      const place = flight.shapes.findIndex(({ name }) => name === "l_shank");
      const [w, x] = core.layout.part(core.frame(), "segments").slice(place * 14);
      return (2 * Math.atan2(x, w) * 180) / Math.PI;
    });
  const bent = await knee();
  await page.click('button:text-is("reset all")');
  const reset = await knee();
  console.log(`knee: ${bent.toFixed(1)} degrees turned, ${reset.toFixed(1)} reset`);
  assert.ok(Math.abs(Math.abs(bent - reset) - 30) < 0.5, `${bent} ${reset}`);
  assert.equal(await turned(), "");
  const damping = page.locator('input[aria-label="damping pitch"]');
  const first = await damping.inputValue();
  await damping.fill("9");
  await damping.blur();
  await page.click('button:text-is("reset damping")');
  assert.equal(await damping.inputValue(), first);
  assert.deepEqual(wrong, []);
  await page.close();
});

test("a gamepad turns the body", async () => {
  const { page, wrong } = await open(chromium, url);
  await ready(page);
  await page.evaluate(() => {
    const buttons = Array.from({ length: 17 }, () => ({ value: 0 }));
    const pads = [{ mapping: "standard", axes: [-1, 0, 0, 0], buttons }];
    navigator.getGamepads = () => pads;
  });
  await page.waitForFunction(() => {
    const { core } = window.bodyflight;
    return core.layout.part(core.frame(), "observation")[3] > 0.1;
  });
  // A restart by a button that stays pressed is one restart.
  const before = await page.evaluate(() => {
    navigator.getGamepads()[0].buttons[8].value = 1;
    return window.bodyflight.core.frame()[0];
  });
  await page.waitForFunction((before) => window.bodyflight.core.frame()[0] < before, before);
  await page.waitForFunction(() => window.bodyflight.core.frame()[0] > 0.3);
  assert.deepEqual(wrong, []);
  await page.close();
});

test("a save that is interrupted leaves a whole flight or none", async () => {
  const place = scratch("cut");
  const server = begin("fly", "--save", place, "--json");
  const { page } = await open(chromium, await server.line(/"url":"([^"]+)"/));
  await ready(page);
  await page.evaluate(() => {
    const frame = window.bodyflight.core.frame();
    const all = new Float32Array(frame.length * 240 * 120);
    for (let k = 0; k < 240 * 120; k++) all.set(frame, k * frame.length);
    const socket = new WebSocket(`ws://${location.host}${location.pathname}socket`);
    socket.onopen = () => socket.send(all.buffer);
  });
  while (readdirSync(place).length === 0) await new Promise((resolve) => setTimeout(resolve, 5));
  server.child.kill("SIGINT");
  assert.equal((await server.end).code, 130);
  const left = readdirSync(place);
  console.log(`interrupted: ${left.length ? left : "nothing"} left`);
  if (left.length) {
    assert.deepEqual(left, ["flown-0"]);
    await run("--json", "simulate", join(place, "flown-0"));
  }
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

test("a page without a program saves a file of which the program makes a recording", async () => {
  const file = join(folder, "fly.html");
  await run("fly", "--out", file);
  const { page, wrong } = await open(chromium, `file://${file}`);
  await ready(page);
  await page.keyboard.press("Space");
  await page.click('button:text-is("record")');
  await page.evaluate(() => {
    window.bodyflight.core.exports.command(0, 1);
    window.bodyflight.advance(480);
  });
  const [download] = await Promise.all([page.waitForEvent("download"), page.click('button:text-is("save")')]);
  assert.match(await page.textContent("#message"), /bodyflight fly --from flight\.csv/);
  const saved = join(folder, "flight.csv");
  await download.saveAs(saved);
  const flown = join(folder, "from");
  mkdirSync(flown);
  await run("fly", "--from", saved, "--save", flown);
  const report = JSON.parse(await run("--json", "simulate", join(flown, "flown-0")));
  assert.ok(report.rms.yaw_rate_radps < 1e-3 && report.frames > 400, JSON.stringify(report));
  assert.ok(report.amplitude.yaw_rate_radps > 0.1, "it turned");
  const subject = join(folder, "heavy.toml");
  writeFileSync(subject, 'height_m = 1.8\nmass_kg = 99\nsex = "male"\n');
  const { code, err } = await begin("fly", subject, "--from", saved, "--save", flown).end;
  assert.equal(code, 2, err);
  assert.match(err, /whose mass is .* kg, found one of/);
  assert.deepEqual(wrong, []);
  await page.close();
});
