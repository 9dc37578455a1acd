import assert from "node:assert/strict";
import { readFileSync, statSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { browser, open, run, scratch, shot } from "./browser.mjs";

const folder = scratch("coach");
const flight = join(folder, "flight");
const path = join(folder, "view.html");
const url = `file://${path}`;
/** Seven plots: index of a channel's plot. */
const [HEADING, YAW, FALL] = [2, 3, 6];
let chromium;

before(async () => {
  await run("synth", "barrel-roll", "--seed", "1", "--out", flight);
  await run("view", flight, "--out", path);
  chromium = await browser();
});
after(() => chromium?.close());

async function opened(hash = "", options = {}) {
  const { page, wrong } = await open(chromium, url + hash, options);
  await page.waitForSelector("html[data-ready=replay]");
  return { page, wrong };
}
const number = (text) => Number(text.replace("−", "-"));
const time = async (page) => Number.parseFloat(await page.textContent("#time"));
/** Values of the plots at the present time: for each plot, one for each line. */
const values = async (page) =>
  page.$$eval(".plot", (all) => all.map((plot) => [...plot.querySelectorAll(".value")].map((one) => one.textContent)));
const slide = (page, selector, value) =>
  page.$eval(
    selector,
    (input, value) => {
      input.value = value;
      input.dispatchEvent(new Event("input"));
    },
    value,
  );
const seek = (page, to) => slide(page, "footer input", String(to));
async function saved(page, act) {
  const [download] = await Promise.all([page.waitForEvent("download"), act()]);
  const to = join(folder, `saved-${download.suggestedFilename()}`);
  await download.saveAs(to);
  return to;
}
/** A file with a video of a second: pictures of the browser, one each 40 ms, in the container WebM. */
async function filmed(page) {
  const pictures = await page.evaluate(() => {
    const canvas = document.createElement("canvas");
    [canvas.width, canvas.height] = [64, 48];
    const context = canvas.getContext("2d");
    return Array.from({ length: 25 }, (_, k) => {
      context.fillStyle = `hsl(${14 * k} 80% 50%)`;
      context.fillRect(0, 0, 64, 48);
      return canvas.toDataURL("image/webp", 0.8).split(",")[1];
    });
  });
  /** An element of the container: its identity, its size in eight bytes, its content. */
  const part = (id, ...content) => {
    const body = Buffer.concat(content);
    const size = Buffer.alloc(8);
    size.writeBigUInt64BE((1n << 56n) | BigInt(body.length));
    return Buffer.concat([Buffer.from(id, "hex"), size, body]);
  };
  const whole = (id, value) => part(id, Buffer.from([value >> 8, value & 255]));
  const words = (id, text) => part(id, Buffer.from(text));
  const duration = Buffer.alloc(4);
  duration.writeFloatBE(1000);
  const head = part(
    "1a45dfa3",
    ...[whole("4286", 1), whole("42f7", 1), whole("42f2", 4), whole("42f3", 8), words("4282", "webm")],
    ...[whole("4287", 2), whole("4285", 2)],
  );
  const scale = part("2ad7b1", Buffer.from([0x0f, 0x42, 0x40]));
  const info = part("1549a966", scale, part("4489", duration), words("4d80", "test"), words("5741", "test"));
  const track = part(
    "ae",
    ...[whole("d7", 1), whole("73c5", 1), whole("83", 1), words("86", "V_VP8")],
    part("e0", whole("b0", 64), whole("ba", 48)),
  );
  const clusters = pictures.map((picture, k) => {
    const riff = Buffer.from(picture, "base64");
    const at = riff.indexOf("VP8 ");
    const frame = riff.subarray(at + 8, at + 8 + riff.readUInt32LE(at + 4));
    return part("1f43b675", whole("e7", 40 * k), part("a3", Buffer.from([0x81, 0, 0, 0x80]), frame));
  });
  const file = join(folder, "jump.webm");
  writeFileSync(file, Buffer.concat([head, part("18538067", info, part("1654ae6b", track), ...clusters)]));
  return file;
}
/** Rows of a CSV file as objects of numbers. */
function table(text) {
  const [names, ...rows] = text
    .trim()
    .split("\n")
    .map((line) => line.split(","));
  return rows.map((row) => Object.fromEntries(row.map((cell, k) => [names[k], Number(cell)])));
}

test("sliders give what simulate --joint gives", async () => {
  const { page, wrong } = await opened();
  await page.click("#what-if summary");
  await slide(page, "#what-if-joint-value", "20");
  await page.waitForFunction(() => document.querySelector("#what-if-said").textContent.includes("turn rate"));
  assert.equal(await page.textContent("#what-if-command"), "bodyflight simulate FLIGHT --joint l_shank.bend=+20");
  const out = join(folder, "pair.csv");
  const report = JSON.parse(await run("--json", "simulate", flight, "--joint", "l_shank.bend=+20", "--out", out));
  const said = await page.textContent("#what-if-said");
  const degrees = (rad) => (-rad * 180) / Math.PI;
  const [, before, after] = /turn rate (\S+) → (\S+)/.exec(said);
  assert.ok(Math.abs(number(before) - degrees(report.turn_radps.unchanged)) < 0.11, said);
  assert.ok(Math.abs(number(after) - degrees(report.turn_radps.changed)) < 0.11, said);
  const [, , falls] = /fall rate (\S+) → (\S+)/.exec(said);
  assert.ok(Math.abs(number(falls) - report.fall_mps.changed) < 0.06, said);
  const rows = table(readFileSync(out, "utf8"));
  const most = [0, 0];
  for (const to of [0.5, 2, 4, 6]) {
    await seek(page, to);
    // Values are those of the row shown last, which is at most 1/30 s earlier.
    const shown = await values(page);
    const near = rows.filter((row) => row.time_s > to - 0.036 && row.time_s <= to + 0.001);
    for (const [k, [plot, key, sign]] of [
      [YAW, "yaw_rate_radps", -180 / Math.PI],
      [FALL, "vertical_velocity_mps", 1],
    ].entries()) {
      const found = number(shown[plot][2]);
      const apart = Math.min(...near.map((row) => Math.abs(sign * row[`changed_${key}`] - found)));
      most[k] = Math.max(most[k], apart);
    }
  }
  console.log(`page and simulate --joint differ by ${most[0].toFixed(3)} °/s and ${most[1].toFixed(4)} m/s`);
  assert.ok(most[0] < 0.5 && most[1] < 0.02, `${most}`);
  await seek(page, 3);
  await shot(page, "what-if");
  // In a window, and back to the flight as recorded.
  await page.check("#windowed");
  assert.match(await page.textContent("#what-if-command"), /l_shank\.bend=\+20@0\.\.\d/);
  await page.click("button:text-is('reset changes')");
  await page.waitForFunction(() => !document.querySelector("#plot-legend").textContent.includes("with changes"));
  assert.deepEqual(wrong, []);
  await page.close();
});

test("sliders act on the flight shown, and each flight keeps its changes", async () => {
  const [other, both] = [join(folder, "other"), join(folder, "both.html")];
  await run("synth", "rotations", "--seed", "2", "--out", other);
  await run("view", flight, other, "--out", both);
  const { page, wrong } = await open(chromium, `file://${both}`);
  await page.waitForSelector("html[data-ready=replay]");
  const said = () => page.textContent("#what-if-said");
  const names = await page.locator("#run option").allTextContents();
  const [mine, theirs] = names.map((name) => `with changes, ${name}`);
  const legend = () => page.textContent("#plot-legend");
  const told = () =>
    page.waitForFunction(() => document.querySelector("#what-if-said").textContent.includes("turn rate"));
  await page.click("#what-if summary");
  await slide(page, "#what-if-joint-value", "20");
  await told();
  const first = await said();
  assert.ok((await legend()).includes(mine), await legend());
  await page.selectOption("#run", "1");
  assert.equal(await said(), "");
  await page.click("#what-if summary");
  await slide(page, "#what-if-joint-value", "-15");
  await told();
  const report = JSON.parse(await run("--json", "simulate", other, "--joint", "l_shank.bend=-15"));
  const [, , after] = /turn rate (\S+) → (\S+)/.exec(await said());
  assert.ok(Math.abs(number(after) + (report.turn_radps.changed * 180) / Math.PI) < 0.11, await said());
  assert.ok((await legend()).includes(theirs), await legend());
  await page.selectOption("#run", "0");
  assert.equal(await said(), first);
  await page.click("button:text-is('reset changes')");
  await page.waitForFunction((mine) => !document.querySelector("#plot-legend").textContent.includes(mine), mine);
  assert.ok((await legend()).includes(theirs), await legend());
  assert.deepEqual(wrong, []);
  await page.close();
});

test("mass, area and inputs are changed, and the last frame of the flight is reached", async () => {
  const { page, wrong } = await opened();
  await page.click("#what-if summary");
  const falls = async () => {
    const before = await page.textContent("#what-if-said");
    await page.waitForFunction(
      (before) => !["", before].includes(document.querySelector("#what-if-said").textContent),
      before,
    );
    return /fall rate (\S+) → (\S+)/
      .exec(await page.textContent("#what-if-said"))
      .slice(1)
      .map(number);
  };
  let said = falls();
  await slide(page, "#what-if-mass-value", "1.3");
  const [plain, heavy] = await said;
  assert.ok(heavy > plain + 1, `${plain}, ${heavy}`);
  said = falls();
  await slide(page, "#what-if-area-value", "1.8");
  assert.ok((await said)[1] < plain - 1);
  assert.match(
    await page.textContent("#what-if-command"),
    /mass: factor 1\.3; drag, lift and moment: all factors 1\.8/,
  );
  await page.check("#without-inputs");
  await page.waitForFunction(() => /--inputs none/.test(document.querySelector("#what-if-command").textContent));
  await page.keyboard.press("End");
  const last = await values(page);
  assert.match(last[FALL][2], /^−\d/);
  assert.deepEqual(wrong, []);
  await page.close();
});

test("plots, compass and instruments have one sense of turning", async () => {
  const { page, wrong } = await opened("#t=2");
  const heading = async () => number((await values(page))[HEADING][1]);
  const compass = number(/heading (\d+)/.exec(await page.textContent("#legend"))[1]);
  assert.ok(Math.abs((((await heading()) - compass + 540) % 360) - 180) < 1.1, `${await heading()}, ${compass}`);
  assert.match(await page.textContent("[data-plot=heading_rad] .note"), /positive to the right/);
  // The yaw rate is the slope of the heading where the body is level.
  const [first, rate] = [await heading(), number((await values(page))[YAW][1])];
  await seek(page, 2.2);
  const slope = ((await heading()) - first) / 0.2;
  const turn = number(/turn ([\d.−]+)/.exec(await page.textContent("#legend"))[1]);
  if (Math.abs(rate) > 5) assert.ok(rate * slope > 0, `${rate}, ${slope}`);
  assert.ok(Math.abs(turn - number((await values(page))[YAW][1])) < 0.6);
  assert.deepEqual(wrong, []);
  await page.close();
});

test("residuals have a strip of their own below the signal", async () => {
  const { page, wrong } = await opened();
  const rows = await page.evaluate(() => {
    const style = getComputedStyle(document.documentElement);
    const source = document.querySelector("[data-plot=pitch_rad] canvas");
    const { data, width, height } = source.getContext("2d").getImageData(0, 0, source.width, source.height);
    const found = {};
    for (const ink of ["measured", "residual"]) {
      const hex = style.getPropertyValue(`--${ink}`).trim();
      const wanted = [1, 3, 5].map((k) => Number.parseInt(hex.slice(k, k + 2), 16));
      const all = [];
      for (let y = 0; y < height; y++)
        for (let x = 60; x < width - 60; x++) {
          const at = 4 * (y * width + x);
          if (data[at + 3] > 200 && wanted.every((value, n) => Math.abs(data[at + n] - value) < 12)) all.push(y);
        }
      found[ink] = [Math.min(...all), Math.max(...all), all.length];
    }
    return found;
  });
  assert.ok(rows.measured[2] > 30 && rows.residual[2] > 30, JSON.stringify(rows));
  assert.ok(rows.measured[1] < rows.residual[0], JSON.stringify(rows));
  assert.deepEqual(wrong, []);
  await page.close();
});

test("lines and bodies differ without colours", async () => {
  /** Inks that must be told apart, and by which ratio of luminance. */
  const PAIRS = [
    ["measured", "simulated", 1.5],
    ["simulated", "second", 1.2],
    ["measured", "second", 1.5],
    ["residual", "left", 1.5],
    ["left", "text", 1.5],
    ["pitch", "yaw", 1.5],
    ["yaw", "roll", 1.5],
    ["ghost", "on-suit", 1.5],
    ["ghost", "ground", 1.5],
    ["ghost", "haze", 1.5],
    ["ghost", "second", 1.5],
    ["force", "ground", 1.5],
    ["force", "haze", 1.5],
    ["segment", "segment-light", 3],
  ];
  for (const colorScheme of ["light", "dark"]) {
    const { page, wrong } = await opened("", { colorScheme });
    const ratios = await page.evaluate((pairs) => {
      const style = getComputedStyle(document.documentElement);
      const light = (name) => {
        const hex = style.getPropertyValue(`--${name}`).trim().slice(1);
        const [r, g, b] = [0, 2, 4]
          .map((k) => Number.parseInt(hex.slice(k, k + 2), 16) / 255)
          .map((c) => (c <= 0.03928 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4));
        return 0.05 + 0.2126 * r + 0.7152 * g + 0.0722 * b;
      };
      return pairs.map(([a, b]) => Math.max(light(a) / light(b), light(b) / light(a)));
    }, PAIRS);
    for (const [k, [a, b, least]] of PAIRS.entries())
      assert.ok(ratios[k] >= least, `${colorScheme}: ${a} and ${b} ${ratios[k].toFixed(2)}`);
    if (colorScheme === "light") {
      assert.match(await page.textContent("#key"), /centre of gravity \(white ball\)/);
      await page.keyboard.press("b");
      await shot(page, "segments");
    }
    assert.deepEqual(wrong, []);
    await page.close();
  }
});

test("joint angles, load factor and normalised fall rate are channels, in the reader's units", async () => {
  const { page, wrong } = await opened("#t=1");
  await page.click(".choose summary");
  for (const key of ["load_factor", "normalised_fall_rate_mps", "joint-l_shank"])
    await page.check(`[data-key="${key}"] input`);
  const shown = async (key) =>
    (await page.$$eval(`[data-plot="${key}"] .value`, (all) => all.map((one) => one.textContent))).map(number);
  const [load] = await shown("load_factor");
  assert.ok(load > 0.5 && load < 2, `${load}`);
  const report = JSON.parse(await run("--json", "simulate", flight, "--joint", "l_shank.bend=+1"));
  const [least, most] = report.joints[0].recorded_rad.map((rad) => (rad * 180) / Math.PI);
  const [bend] = await shown("joint-l_shank");
  assert.ok(bend > least - 0.1 && bend < most + 0.1, `${bend} of ${least} to ${most}`);
  const [, metric] = await shown("normalised_fall_rate_mps");
  await page.selectOption("#speeds", "km/h");
  const [, kmh] = await shown("normalised_fall_rate_mps");
  assert.ok(Math.abs(kmh - 3.6 * metric) < 0.1, `${metric} m/s, ${kmh} km/h`);
  assert.match(await page.textContent("#legend"), /fall rate 1\d\d\.\d .*km\/h/);
  await page.selectOption("#speeds", "mph");
  assert.match(await page.textContent("[data-plot=vertical_velocity_mps] .title"), /\(mph\)/);
  assert.match(await page.textContent("#legend"), /since the start −?\d+ ft/);
  // The choice is kept.
  await page.reload();
  await page.waitForSelector("html[data-ready=replay]");
  assert.equal(await page.inputValue("#speeds"), "mph");
  assert.match(await page.textContent("[data-plot=vertical_velocity_mps] .title"), /\(mph\)/);
  assert.deepEqual(wrong, []);
  await page.close();
});

test("numbers are exported at the rate of the recording", async () => {
  const { page, wrong } = await opened();
  const file = await saved(page, () => page.click('header button:text-is("CSV")'));
  const out = join(folder, "run.csv");
  await run("simulate", flight, "--out", out);
  const [found, expected] = [file, out].map((name) => table(readFileSync(name, "utf8")));
  // The program's file begins with the first step, the page's with the first frame.
  assert.equal(found.length, expected.length + 1);
  assert.deepEqual(Object.keys(found[0]), Object.keys(expected[0]));
  const apart = expected.flatMap((row, k) => Object.keys(row).map((key) => Math.abs(row[key] - found[k + 1][key])));
  assert.ok(Math.max(...apart) < 2e-4, `${Math.max(...apart)}`);
  assert.deepEqual(wrong, []);
  await page.close();
});

test("a selection is looped, and the page is divided where the reader wants", async () => {
  const { page, wrong } = await opened();
  const plot = await page.locator("[data-plot=yaw_rate_radps] .u-over").boundingBox();
  const y = plot.y + 10;
  await page.mouse.move(plot.x + 0.3 * plot.width, y);
  await page.mouse.down();
  await page.mouse.move(plot.x + 0.4 * plot.width, y, { steps: 4 });
  await page.mouse.up();
  await page.keyboard.press("l");
  await page.selectOption('[aria-label="playback speed"]', "2");
  await page.keyboard.press("Space");
  const end = await page.$eval("footer input", (slider) => Number(slider.max));
  // On a busy machine the first picture takes a while.
  for (let k = 0; k < 100 && (await time(page)) === 0; k++) await page.waitForTimeout(50);
  const seen = new Set();
  let wraps = 0;
  for (let k = 0, before = -1; k < 30 && wraps < 2; k++) {
    await page.waitForTimeout(60);
    const now = await time(page);
    assert.ok(now > 0.29 * end && now < 0.41 * end, `${now} of ${end}`);
    if (now < before) wraps += 1;
    before = now;
    seen.add(now);
  }
  assert.ok(seen.size > 3 && wraps > 0, `${seen.size} times, ${wraps} loops`);
  await page.keyboard.press("Space");
  const width = async () => (await page.locator("aside").boundingBox()).width;
  const before = await width();
  const bar = await page.locator(".splitter").boundingBox();
  await page.mouse.move(bar.x + 3, 300);
  await page.mouse.down();
  await page.mouse.move(bar.x - 197, 300, { steps: 4 });
  await page.mouse.up();
  assert.ok(Math.abs((await width()) - before - 200) < 5, `${before}, ${await width()}`);
  const canvas = await page.locator(".plot canvas").first().boundingBox();
  assert.ok(canvas.width > before, "plots use the width");
  await page.reload();
  await page.waitForSelector("html[data-ready=replay]");
  assert.ok(Math.abs((await width()) - before - 200) < 5, "the browser keeps it");
  await page.dblclick(".splitter");
  assert.ok(Math.abs((await width()) - before) < 1);
  assert.deepEqual(wrong, []);
  await page.close();
});

test("plots use a large screen", async () => {
  const { page, wrong } = await opened("", { viewport: { width: 3840, height: 2160 } });
  const boxes = await page.$$eval(".plot", (all) => all.map((plot) => plot.getBoundingClientRect().toJSON()));
  assert.ok(boxes[0].width > 1200, `${boxes[0].width} px wide`);
  const last = boxes[boxes.length - 1];
  assert.ok(last.bottom > 1900 && last.bottom < 2160, `down to ${last.bottom} px`);
  assert.ok((await page.$eval("body", (body) => Number.parseFloat(getComputedStyle(body).fontSize))) > 17);
  assert.deepEqual(wrong, []);
  await page.close();
});

test("notes and a video are saved with the page, the video's content only if asked", async () => {
  const { page, wrong } = await opened("#t=1.5");
  const film = await filmed(page);
  await seek(page, 1.5);
  const evil = '</script><script>window.evil = 1</script> "left $& arm"';
  await page.keyboard.press("m");
  await page.keyboard.type(evil);
  await page.keyboard.press("Enter");
  const choose = page.click('header button:text-is("video")');
  const [chooser] = await Promise.all([page.waitForEvent("filechooser"), choose]);
  await chooser.setFiles(film);
  await page.waitForSelector("#video:not([hidden])");
  await page.fill('[aria-label="video begins at (s)"]', "1.10");
  const at = () => page.$eval("#video video", (video) => video.currentTime);
  await page.waitForFunction(() => document.querySelector("#video video").duration > 0.6);
  await page.waitForFunction(() => Math.abs(document.querySelector("#video video").currentTime - 0.4) < 0.05);
  await seek(page, 1.3);
  await page.waitForFunction(() => Math.abs(document.querySelector("#video video").currentTime - 0.2) < 0.05);
  await seek(page, 0.2);
  await page.waitForFunction(() => document.querySelector("#video video").currentTime < 0.01);
  assert.ok((await at()) >= 0);
  await seek(page, 1.5);
  await shot(page, "video");
  const plain = await saved(page, () => page.click("#notes button:text-is('save page (changed)')"));
  assert.ok(Math.abs(statSync(plain).size - statSync(path).size) < 2000, "the video is not in the page");
  const again = (await open(chromium, `file://${plain}`)).page;
  await again.waitForSelector("html[data-ready=replay]");
  assert.match(
    await again.textContent("#notes li"),
    /1\.50 s <\/script><script>window\.evil = 1<\/script> "left \$& arm"/,
  );
  assert.equal(await again.evaluate(() => window.evil), undefined);
  await again.click("#notes li button >> nth=0");
  assert.equal(await time(again), 1.5);
  assert.match(await again.textContent("header"), /video: jump\.webm/);
  await again.close();
  await page.check('[aria-label="embed the video"]');
  await page.waitForSelector("#notes button:text-is('save page (changed)')");
  const whole = await saved(page, () => page.click("#notes button:text-is('save page (changed)')"));
  assert.ok(statSync(whole).size > statSync(path).size + statSync(film).size);
  const played = await open(chromium, `file://${whole}`);
  await played.page.waitForFunction(() => document.querySelector("#video video")?.duration > 0.6);
  assert.deepEqual(played.wrong, []);
  await played.page.close();
  assert.deepEqual(wrong, []);
  await page.close();
});
