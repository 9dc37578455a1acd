import assert from "node:assert/strict";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { browser, open, run, scratch, shot } from "./browser.mjs";

const folder = scratch("phone");
const PHONES = [
  { width: 390, height: 844 },
  { width: 360, height: 640 },
  { width: 844, height: 390 },
];
const touch = { hasTouch: true, isMobile: true };
let chromium;

before(async () => {
  await run("synth", "rotations", "--seed", "1", "--out", folder);
  await run("view", join(folder, "flight.toml"), "--out", join(folder, "view.html"));
  await run("fly", "--out", join(folder, "fly.html"));
  chromium = await browser();
});
after(() => chromium?.close());

/** Pairs of parts that overlap over the picture, and parts that extend beyond it. */
const clashes = (page) =>
  page.evaluate(() => {
    const of = (part) => part.getBoundingClientRect();
    const main = of(document.querySelector("main"));
    const parts = [...document.querySelectorAll("main > .over, main .thumb")].filter((part) => of(part).width > 0);
    const found = [];
    for (const [k, a] of parts.entries()) {
      const [x, y] = [of(a), a.className];
      if (x.left < main.left - 1 || x.right > main.right + 1 || x.bottom > main.bottom + 1)
        found.push(`${y} sticks out`);
      for (const b of parts.slice(k + 1)) {
        const z = of(b);
        const apart = x.right <= z.left || z.right <= x.left || x.bottom <= z.top || z.bottom <= x.top;
        if (!apart) found.push(`${y} over ${b.className}`);
      }
    }
    return found;
  });

test("on a phone, tools, map and instruments do not overlap", async () => {
  for (const viewport of PHONES)
    for (const mode of ["view", "fly"]) {
      const { page, wrong } = await open(chromium, `file://${join(folder, `${mode}.html`)}`, { viewport, ...touch });
      await page.waitForSelector("html[data-ready]");
      await page.waitForTimeout(200);
      assert.deepEqual(await clashes(page), [], `${mode}, ${viewport.width} px`);
      const wide = await page.evaluate(() => document.documentElement.scrollWidth > innerWidth);
      assert.ok(!wide, `${mode} is wider than ${viewport.width} px`);
      if (viewport.width > viewport.height) {
        // On its side, the picture is as high as the page allows, and plots or keys are beside it.
        const [main, aside] = await Promise.all(["main", "aside"].map((part) => page.locator(part).boundingBox()));
        assert.ok(main.height > 0.75 * viewport.height && main.width > 0.5 * viewport.width, JSON.stringify(main));
        assert.ok(aside.x >= main.x + main.width && aside.width > 0.35 * viewport.width, JSON.stringify(aside));
      }
      await shot(page, `phone-${mode}-${viewport.width}`);
      assert.deepEqual(wrong, []);
      await page.close();
    }
});

test("touch pads turn the body while they are held", async () => {
  const { page, wrong } = await open(chromium, `file://${join(folder, "fly.html")}`, {
    viewport: PHONES[0],
    ...touch,
  });
  await page.waitForSelector("html[data-ready=fly]");
  const yawRate = () =>
    page.evaluate(() => {
      const { core } = window.bodyflight;
      return core.layout.part(core.frame(), "observation")[3];
    });
  const pad = await page.locator("[data-hold=a]").boundingBox();
  const fingers = await page.context().newCDPSession(page);
  const at = { x: pad.x + pad.width / 2, y: pad.y + pad.height / 2 };
  await fingers.send("Input.dispatchTouchEvent", { type: "touchStart", touchPoints: [at] });
  assert.match(await page.getAttribute("[data-hold=a]", "class"), /held/);
  await page.waitForTimeout(2500);
  const turning = await yawRate();
  await fingers.send("Input.dispatchTouchEvent", { type: "touchEnd", touchPoints: [] });
  assert.ok(Math.abs(turning) > 0.1, `${turning} rad/s`);
  assert.doesNotMatch(await page.getAttribute("[data-hold=a]", "class"), /held/);
  await page.waitForTimeout(3000);
  assert.ok(Math.abs(await yawRate()) < Math.abs(turning));
  assert.deepEqual(wrong, []);
  await page.close();
});
