import assert from "node:assert/strict";
import { readFileSync, statSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { begin, browser, colours, inked, OUTPUT, open, run, scratch, shot } from "./browser.mjs";

const folder = scratch("view");
const path = join(folder, "view.html");
const url = `file://${path}`;
let chromium;

before(async () => {
  await run("synth", "rotations", "--seed", "1", "--out", folder);
  await run("view", join(folder, "flight.toml"), "--out", path);
  chromium = await browser();
});
after(() => chromium?.close());

const ready = (page) => page.waitForSelector("html[data-ready=replay]");
const time = async (page) => Number.parseFloat(await page.textContent("#time"));

test("a flight opens offline and quickly, from one small file", async () => {
  const { page, wrong } = await open(chromium, url);
  await ready(page);
  const first = await page.evaluate(() => performance.now());
  const size = statSync(path).size;
  console.log(`first picture after ${first.toFixed(0)} ms, page ${(size / 1000).toFixed(0)} kB with 30 s of flight`);
  assert.ok(first < 5000, `first picture after ${first} ms`);
  assert.ok(size < 1_000_000 + 400_000, `${size} bytes`);
  const count = await colours(page, "main > canvas");
  assert.ok(count > 100, `${count} colours`);
  assert.equal(await page.locator(".plot").count(), 7);
  for (const ink of ["measured", "simulated", "residual"])
    assert.ok((await inked(page, "[data-plot=pitch_rad] canvas", ink)) > 30, ink);
  assert.match(await page.textContent("#provenance"), /view.*flight\.mvnx.*sha256/s);
  const overflow = await page.evaluate(
    () => document.documentElement.scrollWidth > innerWidth || document.documentElement.scrollHeight > innerHeight,
  );
  assert.ok(!overflow, "the page does not fit 1280 x 720");
  const [aside, last] = await Promise.all(
    ["aside", ".plot:last-child"].map((part) => page.locator(part).boundingBox()),
  );
  assert.ok(last.y + last.height <= aside.y + aside.height + 1, "seven plots fit without scrolling");
  await shot(page, "replay");
  assert.deepEqual(wrong, []);
  await page.close();
});

test("root mean squares have the unit of their plot", async () => {
  const { page, wrong } = await open(chromium, url);
  await ready(page);
  const rms = async (key) =>
    Number.parseFloat(/RMS ([\d.]+)/.exec(await page.textContent(`[data-plot=${key}] .note`))[1]);
  const [pitch, fall] = [await rms("pitch_rad"), await rms("vertical_velocity_mps")];
  await page.click("#degrees");
  const inRadians = await rms("pitch_rad");
  assert.ok(Math.abs(pitch - (inRadians * 180) / Math.PI) < 0.06, `${pitch} degrees, ${inRadians} rad`);
  assert.equal(await rms("vertical_velocity_mps"), fall);
  assert.deepEqual(wrong, []);
  await page.close();
});

test("a recording that contradicts itself is doubted before anything else", async () => {
  const bad = scratch("doubt");
  await run("synth", "rotations", "--seed", "1", "--out", bad);
  const file = join(bad, "flight.mvnx");
  const halved = readFileSync(file, "utf8").replace(/<velocity>[^<]*/g, (text) =>
    text.replace(/-?\d[\d.eE+-]*/g, (number) => String(Number(number) / 2)),
  );
  writeFileSync(file, halved);
  const written = join(bad, "view.html");
  const { code, err } = await begin("view", join(bad, "flight.toml"), "--out", written).end;
  assert.equal(code, 5, err);
  const { page, wrong } = await open(chromium, `file://${written}`);
  await ready(page);
  assert.match(await page.textContent("#doubt"), /Do not trust .*: .*units or frame rate are wrong/);
  const first = await page.$eval("aside > *", (place) => place.id);
  assert.equal(first, "doubt");
  assert.deepEqual(wrong, []);
  await page.close();
});

/** Positions of the time markers in the plots (px), and the widths of the plots. */
const marks = (page) =>
  page.$$eval(".now", (all) =>
    all.map((mark) => ({
      shown: mark.style.display !== "none",
      left: Number.parseFloat(mark.style.left),
      width: mark.parentElement.clientWidth,
    })),
  );

test("every plot shows the time marker from the start", async () => {
  for (const [hash, moment] of [
    ["", 0],
    ["#t=12", 12],
  ]) {
    const { page, wrong } = await open(chromium, url + hash);
    await ready(page);
    const seen = await marks(page);
    assert.equal(seen.length, 7);
    for (const { shown, left, width } of seen) {
      assert.ok(shown, `${hash}: a mark is hidden`);
      assert.ok(Math.abs(left - (moment / 30) * width) < 3, `${hash}: ${left} of ${width}`);
    }
    assert.deepEqual(wrong, []);
    await page.close();
  }
});

test("the space bar plays after a click on any control", async () => {
  const { page, wrong } = await open(chromium, url);
  await ready(page);
  const forces = page.locator('.tools button:text-is("forces")');
  await forces.click();
  assert.equal(await forces.getAttribute("aria-pressed"), "false");
  await page.keyboard.press("Space");
  await page.waitForFunction(() => Number.parseFloat(document.querySelector("#time").textContent) > 0.1);
  await page.keyboard.press("Space");
  assert.equal(await forces.getAttribute("aria-pressed"), "false");
  const held = await time(page);
  await page.waitForTimeout(300);
  assert.equal(await time(page), held);
  assert.deepEqual(wrong, []);
  await page.close();
});

test("plots use degrees or radians, and channels can be selected and reordered", async () => {
  const { page, wrong } = await open(chromium, `${url}#t=29`);
  await ready(page);
  const title = () => page.textContent("[data-plot=heading_rad] .title b");
  const values = async () =>
    (await page.$$eval("[data-plot=heading_rad] .value", (all) => all.map((value) => value.textContent))).map((text) =>
      Number(text.replace("−", "-")),
    );
  assert.equal(await title(), "heading (°)");
  const degrees = await values();
  assert.equal(degrees.length, 3);
  assert.ok(Math.abs(degrees[0] - degrees[1] - degrees[2]) < 0.21, `${degrees}`);
  await page.click("#degrees");
  assert.equal(await title(), "heading (rad)");
  const radians = await values();
  assert.ok(Math.abs(radians[0] - (degrees[0] * Math.PI) / 180) < 0.01, `${radians} rad, ${degrees} degrees`);
  // At the pointer, not at the current time.
  const box = await page.locator("[data-plot=heading_rad] .u-over").boundingBox();
  await page.mouse.move(box.x + 3, box.y + 10);
  await page.waitForFunction(
    (before) => document.querySelector("[data-plot=heading_rad] .value").textContent !== before,
    radians[0].toFixed(3).replace("-", "−"),
  );
  await page.click(".choose summary");
  await page.click("[data-key=roll_rad] input");
  assert.equal(await page.locator(".plot").count(), 6);
  const order = () => page.$$eval(".plot", (all) => all.map((plot) => plot.dataset.plot));
  const before = await order();
  await page.click(`[data-key=${before[1]}] button:text-is("↑")`);
  assert.deepEqual((await order()).slice(0, 2), [before[1], before[0]]);
  assert.deepEqual(wrong, []);
  await page.close();
});

test("a heading that turns through all directions is drawn without a jump", async () => {
  const { page, wrong } = await open(chromium, url);
  await ready(page);
  const [download] = await Promise.all([page.waitForEvent("download"), page.click('header button:text-is("SVG")')]);
  const svg = readFileSync(await download.path()).toString();
  const panel = svg.slice(svg.indexOf("heading (°)"), svg.indexOf("yaw rate (°/s)"));
  const points = /points="([^"]+)"/
    .exec(panel)[1]
    .split(" ")
    .map((point) => Number(point.split(",")[1]));
  const jumps = points.slice(1).map((y, k) => Math.abs(y - points[k]));
  const height = Math.max(...points) - Math.min(...points);
  assert.ok(Math.max(...jumps) < 0.3 * height, `${Math.max(...jumps)} of ${height}`);
  // Tick labels differ from each other.
  for (const anchor of ["end", "start"])
    for (const part of svg.split("<rect x=").slice(1)) {
      const labels = [...part.matchAll(new RegExp(`text-anchor="${anchor}">([^<]+)<`, "g"))].map((found) => found[1]);
      const ticks = labels.filter((label) => !label.includes("time"));
      assert.equal(new Set(ticks).size, ticks.length, `${ticks}`);
      if (anchor === "end") assert.ok(ticks.length >= 2, part.slice(0, 300));
    }
  assert.deepEqual(wrong, []);
  await page.close();
});

test("a question mark lists the keys, and the camera in use is marked", async () => {
  const { page, wrong } = await open(chromium, url);
  await ready(page);
  await page.keyboard.press("?");
  assert.match(await page.textContent("#help[open]"), /play or pause.*camera trailing/s);
  await page.keyboard.press("Escape");
  await page.keyboard.press("x");
  const pressed = await page.$$eval('.tools button[aria-pressed="true"]', (all) => all.map((tool) => tool.textContent));
  assert.ok(pressed.includes("from the north") && !pressed.includes("free"), `${pressed}`);
  const plain = await colours(page, "main > canvas");
  const before = await page.locator("main > canvas").screenshot();
  await page.keyboard.press("b");
  assert.ok(
    plain > 100 && !before.equals(await page.locator("main > canvas").screenshot()),
    "segments lie over the body",
  );
  assert.deepEqual(wrong, []);
  await page.close();
});

test("instruments agree with the channels", async () => {
  const { page, wrong } = await open(chromium, `${url}#t=5`);
  await ready(page);
  const [download] = await Promise.all([page.waitForEvent("download"), page.click('header button:text-is("CSV")')]);
  const [names, ...rows] = readFileSync(await download.path())
    .toString()
    .trim()
    .split("\n")
    .map((line) => line.split(","));
  const row = rows.findLast((numbers) => Number(numbers[0]) <= 5);
  const fall = -Number(row[names.indexOf("simulated_vertical_velocity_mps")]);
  const text = await page.textContent("#legend");
  const [, shown, unit] = /fall rate ([\d.−]+) .*? (\S+)over ground/.exec(text);
  assert.equal(unit, "m/s");
  assert.ok(Math.abs(Number(shown) - fall) < 0.06, `${text}: ${fall}`);
  assert.deepEqual(wrong, []);
  await page.close();
});

test("keys scrub, the slider seeks, play runs at the speed chosen", async () => {
  const { page, wrong } = await open(chromium, `${url}#t=3`);
  await ready(page);
  assert.equal(await time(page), 3);
  await page.keyboard.press("ArrowRight");
  assert.ok(Math.abs((await time(page)) - 3 - 1 / 30) < 2e-3);
  await page.keyboard.press("Shift+ArrowRight");
  assert.ok(Math.abs((await time(page)) - 4 - 1 / 30) < 2e-3);
  await page.keyboard.press("End");
  assert.ok(Math.abs((await time(page)) - 30) < 0.1);
  await page.keyboard.press("Home");
  assert.equal(await time(page), 0);
  await page.fill("footer input", "10").catch(() =>
    page.evaluate(() => {
      const slider = document.querySelector("footer input");
      slider.value = "10";
      slider.dispatchEvent(new Event("input"));
    }),
  );
  assert.equal(await time(page), 10);
  await page.waitForURL(/#t=10\.000$/);
  await page.keyboard.press("Space");
  await page.waitForFunction(() => Number.parseFloat(document.querySelector("#time").textContent) > 10.3);
  assert.match(await page.textContent("#cost"), /ms/);
  console.log(`picture to picture, to draw: ${await page.textContent("#cost")} (software graphics)`);
  await page.keyboard.press("Space");
  assert.deepEqual(wrong, []);
  await page.close();
});

test("all plots share a cursor, and a click seeks", async () => {
  const { page, wrong } = await open(chromium, url);
  await ready(page);
  const box = await page.locator("[data-plot=yaw_rate_radps] .u-over").boundingBox();
  await page.mouse.move(box.x + box.width / 2, box.y + 20);
  const cursors = await page.$$eval(".u-cursor-x", (all) =>
    all.map((cursor) => cursor.style.transform).filter((at) => !at.includes("-10px")),
  );
  assert.ok(cursors.length >= 7, String(cursors));
  assert.equal(new Set(cursors).size, 1, String(cursors));
  await page.mouse.click(box.x + box.width / 2, box.y + 20);
  assert.ok(Math.abs((await time(page)) - 15) < 0.3, String(await time(page)));
  assert.deepEqual(wrong, []);
  await page.close();
});

test("numbers, plots, pictures and videos can be exported", async () => {
  const { page, wrong } = await open(chromium, `${url}#t=5`);
  await ready(page);
  const take = async (label) => {
    const [download] = await Promise.all([
      page.waitForEvent("download"),
      page.click(`header button:text-is("${label}")`),
    ]);
    const to = join(OUTPUT, download.suggestedFilename());
    await download.saveAs(to);
    return readFileSync(to);
  };
  const csv = (await take("CSV")).toString().trim().split("\n");
  assert.match(csv[0], /^time_s,measured_roll_rad,simulated_roll_rad/);
  assert.equal(csv.length, 7201 + 1, "every frame of the recording");
  const svg = (await take("SVG")).toString();
  assert.equal(svg.match(/<rect x=/g).length, 7);
  assert.ok(!svg.includes("NaN"));
  for (const label of ["PNG", "strip"]) assert.equal((await take(label)).readUInt32BE(0), 0x89504e47);
  assert.equal(await time(page), 5);
  await page.click('header button:text-is("WebM")');
  await page.waitForTimeout(800);
  assert.equal((await take("WebM")).readUInt32BE(0), 0x1a45dfa3);
  assert.deepEqual(wrong, []);
  await page.close();
});

test("two runs are overlaid, with the results of discovery", async () => {
  const two = join(folder, "two.html");
  const [model, report] = [join(folder, "model.toml"), join(folder, "report.json")];
  writeFileSync(model, '[[effect]]\nname = "wind"\nnorth_mps = 4\n');
  const nine = (value) => Array(9).fill(value);
  const named = {
    name: "wind",
    parameters: { north_mps: 4.01 },
    standard_errors: { north_mps: 0.02 },
    log_odds: 30,
    explains: 1,
    rivals: [{ name: "exit-speed", share: 0.9 }],
    separated_by: "a long fall",
    imitated_by_inputs: false,
  };
  const gap = { before: nine(0.5), after: nine(0.1), floor: nine(0.1), closed_share: 1 };
  writeFileSync(
    report,
    JSON.stringify({
      verdict: "named",
      effects: [named],
      nearest: [],
      explained: 1,
      disagreement: 40,
      gap,
      held_out: [{ gain: 300, gap }],
      residual_map: [0, 1, 2, 3].map((time_s) => ({ time_s, over_floor: nine(5), over_floor_after: nine(1) })),
    }),
  );
  await run("view", join(folder, "flight.toml"), "--model", model, "--discovery", report, "--out", two);
  const { page, wrong } = await open(chromium, `file://${two}`);
  await ready(page);
  assert.equal(await page.locator("#run option").count(), 2);
  await page.selectOption("#run", "1");
  const text = await page.textContent("#discovery");
  assert.match(
    text,
    /named.*wind.*north_mps4\.01 ± 0\.020.*exit-speed in this flight; fly: a long fall.*0\.500.*Held-out flight 1: 100 % of the gap closed/s,
  );
  assert.ok((await colours(page, ".map")) > 2);
  // Residuals before and after.
  assert.match(await page.textContent("#plot-legend"), /residual \(below\).*residual, .*\(below\)/s);
  for (const ink of ["residual", "left"])
    assert.ok((await inked(page, "[data-plot=horizontal_velocity_mps] canvas", ink)) > 30, ink);
  await page.click(".map", { position: { x: 200, y: 50 } });
  assert.ok((await time(page)) > 0.5);
  await shot(page, "discrepancy");
  assert.deepEqual(wrong, []);
  await page.close();
});

test("reports without an effect, a gap or a map show no undefined values", async () => {
  const out = join(folder, "bare.html");
  const report = join(folder, "bare.json");
  const effect = { name: "wind", parameters: { north_mps: null }, rivals: [{ name: "muscle" }], log_odds: null };
  const nothing = { before: Array(9).fill(null), after: [], floor: Array(9).fill(0.1), closed_share: null };
  for (const bare of [
    { verdict: "none", effects: [], held_out: [] },
    { verdict: "thin" },
    { verdict: "unexplained", nearest: [effect], gap: nothing, held_out: [{ gap: nothing }], fly_next: null },
  ]) {
    writeFileSync(report, JSON.stringify(bare));
    await run("view", join(folder, "flight.toml"), "--discovery", report, "--out", out, "--force");
    const { page, wrong } = await open(chromium, `file://${out}`);
    await ready(page);
    const text = await page.textContent("body #app");
    assert.doesNotMatch(text, /undefined|NaN|null|\[object/);
    assert.match(text, new RegExp(bare.verdict));
    assert.deepEqual(wrong, []);
    await page.close();
  }
});

test("damaged pages say what is wrong", async () => {
  const html = readFileSync(path, "utf8");
  const broken = async (name, change) => {
    const damaged = change(html);
    assert.notEqual(damaged, html, name);
    const file = join(folder, `${name}.html`);
    writeFileSync(file, damaged);
    const { page, wrong } = await open(chromium, `file://${file}`);
    await page.waitForSelector("#problem");
    assert.deepEqual(wrong, []);
    return page.textContent("#problem");
  };
  assert.match(await broken("cut", (text) => text.replace('"mode":"replay"', '"mode":"rep')), /damaged/);
  assert.match(await broken("new", (text) => text.replace(/"schema":\d+/, '"schema":99')), /version 99/);
  assert.match(await broken("series", (text) => text.replace(/"data":"[^"]{40}/, '"data":"')), /damaged/);
  assert.match(
    await broken("empty", (text) => text.replace(/(id="bodyflight-data">).*?<\/script>/s, "$1null</script>")),
    /contains no data/,
  );
});

test("a name cannot inject code", async () => {
  const evil = join(folder, "evil.html");
  const html = readFileSync(path, "utf8").replace(
    /"title":"[^"]*"/,
    '"title":"\\u003cimg src=x onerror=window.evil=1>"',
  );
  writeFileSync(evil, html);
  const { page, wrong } = await open(chromium, `file://${evil}`);
  await ready(page);
  assert.equal(await page.evaluate(() => window.evil), undefined);
  assert.match(await page.textContent("h1"), /<img/);
  assert.deepEqual(wrong, []);
  await page.close();
});

test("light and dark themes are readable, and the keyboard reaches everything", async () => {
  for (const colorScheme of ["light", "dark"]) {
    const { page, wrong } = await open(chromium, url, { colorScheme });
    await ready(page);
    const contrasts = await page.evaluate(() => {
      const style = getComputedStyle(document.documentElement);
      const light = (name) => {
        const hex = style.getPropertyValue(`--${name}`).trim().slice(1);
        const [r, g, b] = [0, 2, 4]
          .map((k) => Number.parseInt(hex.slice(k, k + 2), 16) / 255)
          .map((c) => (c <= 0.03928 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4));
        return 0.2126 * r + 0.7152 * g + 0.0722 * b;
      };
      const ratio = (a, b) => (Math.max(light(a), light(b)) + 0.05) / (Math.min(light(a), light(b)) + 0.05);
      return Object.fromEntries(
        [
          ["text", 7],
          ["faint", 4.5],
          ["measured", 3],
          ["simulated", 3],
          ["second", 3],
          ["residual", 3],
          ["bad", 4.5],
        ].map(([ink, least]) => [ink, [ratio(ink, "back"), least]]),
      );
    });
    for (const [ink, [ratio, least]] of Object.entries(contrasts))
      assert.ok(ratio >= least, `${colorScheme} ${ink}: ${ratio}`);
    const controls = await page.locator("button:visible, select:visible, input:visible").count();
    const reached = new Set();
    for (let k = 0; k < controls + 6; k++) {
      await page.keyboard.press("Tab");
      reached.add(
        await page.evaluate(() => {
          const all = [...document.querySelectorAll("button, select, input")];
          return all.indexOf(document.activeElement);
        }),
      );
    }
    reached.delete(-1);
    assert.equal(reached.size, controls);
    await shot(page, `replay-${colorScheme}`);
    assert.deepEqual(wrong, []);
    await page.close();
  }
});

test("without WebGL the body is a stick figure, and the rest works", async () => {
  const plain = await browser({ webgl: false });
  try {
    const { page } = await open(plain, url);
    await ready(page);
    assert.match(await page.textContent("#no-webgl"), /no WebGL/);
    assert.equal(await page.locator(".plot").count(), 7);
    assert.ok((await colours(page, "main > canvas")) > 5);
    await page.keyboard.press("End");
    assert.ok((await time(page)) > 29);
    await shot(page, "no-webgl");
  } finally {
    await plain.close();
  }
});

test("estimated inputs have bands, and known inputs can be shown beside them", async () => {
  const estimated = join(folder, "estimated.html");
  await run("view", join(folder, "flight.toml"), "--estimate", "--out", estimated);
  const { page, wrong } = await open(chromium, `file://${estimated}`);
  await ready(page);
  assert.equal(await page.locator(".plot").count(), 9);
  assert.equal(await page.locator('[data-plot="muscle"]').count(), 0);
  // Bands tint the lines, so the colours are read from the drawing.
  const damping = (await page.locator('[data-plot="estimated-damping"] .value').allTextContents()).map(Number);
  for (const [k, known] of [3, 0.5, 6].entries()) assert.ok(Math.abs(damping[k] - known) < 1, `${damping}`);
  for (const key of ["estimated-muscle", "estimated-damping"])
    assert.ok((await colours(page, `[data-plot="${key}"] canvas`)) > 20, key);
  assert.match(await page.textContent("#plot-legend"), /yaw ± 2 sd/);
  await page.click(".choose summary");
  await page.click('#channels [data-key="muscle"] input');
  assert.equal(await page.locator('[data-plot="muscle"]').count(), 1);
  await shot(page, "estimated");
  assert.deepEqual(wrong, []);
  await page.close();
});
