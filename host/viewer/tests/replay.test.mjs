import assert from "node:assert/strict";
import { readFileSync, statSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { browser, colours, inked, OUTPUT, open, run, scratch, shot } from "./browser.mjs";

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

test("a flight opens offline, in one small file, soon, and shows something", async () => {
  const { page, wrong } = await open(chromium, url);
  await ready(page);
  const first = await page.evaluate(() => performance.now());
  const size = statSync(path).size;
  console.log(`first picture after ${first.toFixed(0)} ms, page ${(size / 1000).toFixed(0)} kB with 30 s of flight`);
  assert.ok(first < 5000, `first picture after ${first} ms`);
  assert.ok(size < 900_000 + 250_000, `${size} bytes`);
  const count = await colours(page, "main > canvas");
  assert.ok(count > 100, `${count} colours`);
  assert.equal(await page.locator(".plot").count(), 9);
  for (const ink of ["measured", "simulated", "residual"])
    assert.ok((await inked(page, "[data-plot=pitch_rad] canvas", ink)) > 30, ink);
  assert.match(await page.textContent("#provenance"), /view.*flight\.mvnx.*sha256/s);
  const overflow = await page.evaluate(
    () => document.documentElement.scrollWidth > innerWidth || document.documentElement.scrollHeight > innerHeight,
  );
  assert.ok(!overflow, "the page does not fit 1280 x 720");
  await shot(page, "replay");
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
  assert.match(page.url(), /#t=10\.000/);
  await page.keyboard.press("Space");
  await page.waitForFunction(() => Number.parseFloat(document.querySelector("#time").textContent) > 10.3);
  assert.match(await page.textContent("#cost"), /ms/);
  console.log(`picture to picture, to draw: ${await page.textContent("#cost")} (software graphics)`);
  await page.keyboard.press("Space");
  assert.deepEqual(wrong, []);
  await page.close();
});

test("the cursor is one for all plots, and a click goes there", async () => {
  const { page, wrong } = await open(chromium, url);
  await ready(page);
  const box = await page.locator("[data-plot=yaw_rate_radps] .u-over").boundingBox();
  await page.mouse.move(box.x + box.width / 2, box.y + 20);
  const cursors = await page.$$eval(".u-cursor-x", (all) =>
    all.map((cursor) => cursor.style.transform).filter((at) => !at.includes("-10px")),
  );
  assert.ok(cursors.length >= 9, String(cursors));
  assert.equal(new Set(cursors).size, 1, String(cursors));
  await page.mouse.click(box.x + box.width / 2, box.y + 20);
  assert.ok(Math.abs((await time(page)) - 15) < 0.3, String(await time(page)));
  assert.deepEqual(wrong, []);
  await page.close();
});

test("numbers, plots, pictures and film can be taken out", async () => {
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
  assert.ok(csv.length > 850, `${csv.length} lines`);
  const svg = (await take("SVG")).toString();
  assert.equal(svg.match(/<rect x=/g).length, 9);
  assert.ok(!svg.includes("NaN"));
  for (const label of ["PNG", "strip"]) assert.equal((await take(label)).readUInt32BE(0), 0x89504e47);
  assert.equal(await time(page), 5);
  await page.click('header button:text-is("WebM")');
  await page.waitForTimeout(800);
  assert.equal((await take("WebM")).readUInt32BE(0), 0x1a45dfa3);
  assert.deepEqual(wrong, []);
  await page.close();
});

test("two runs are shown over one another, with what discovery found", async () => {
  const two = join(folder, "two.html");
  const [model, report] = [join(folder, "model.toml"), join(folder, "report.json")];
  writeFileSync(model, '[[effect]]\nname = "wind"\nnorth_mps = 4\n');
  const nine = (value) => Array(9).fill(value);
  const named = {
    name: "wind",
    parameters: { north_mps: 4.01 },
    standard_errors: { north_mps: 0.02 },
    confidence: 30,
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
    /named.*wind.*north_mps4\.01 ± 0\.020.*exit-speed here; fly: a long fall.*0\.500.*Held-out flight 1: 100 % of the gap closed/s,
  );
  assert.ok((await colours(page, ".map")) > 2);
  await page.click(".map", { position: { x: 200, y: 50 } });
  assert.ok((await time(page)) > 0.5);
  await shot(page, "discrepancy");
  assert.deepEqual(wrong, []);
  await page.close();
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
  assert.match(await broken("new", (text) => text.replace('"schema":2', '"schema":99')), /version 99/);
  assert.match(await broken("series", (text) => text.replace(/"data":"[^"]{40}/, '"data":"')), /damaged/);
  assert.match(
    await broken("empty", (text) => text.replace(/(id="bodyflight-data">).*?<\/script>/s, "$1null</script>")),
    /no data yet/,
  );
});

test("a name cannot become code", async () => {
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

test("light and dark are readable, and keys reach everything", async () => {
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
    const controls = await page.locator("button, select, input").count();
    const reached = new Set();
    for (let k = 0; k < controls + 3; k++) {
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

test("without WebGL the body is sticks, and the rest works", async () => {
  const plain = await browser({ webgl: false });
  try {
    const { page } = await open(plain, url);
    await ready(page);
    assert.match(await page.textContent("#no-webgl"), /no WebGL/);
    assert.equal(await page.locator(".plot").count(), 9);
    assert.ok((await colours(page, "main > canvas")) > 5);
    await page.keyboard.press("End");
    assert.ok((await time(page)) > 29);
    await shot(page, "no-webgl");
  } finally {
    await plain.close();
  }
});
