// A browser for the tests, and what every page must hold to.
import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { mkdirSync, mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { chromium } from "playwright-core";

const need = (name) => process.env[name] ?? assert.fail(`${name} is not set: run cargo xtask viewer --test`);
export const BODYFLIGHT = need("BODYFLIGHT");
export const NATIVE = need("BODYFLIGHT_NATIVE");
export const OUTPUT = need("BODYFLIGHT_OUTPUT");
mkdirSync(OUTPUT, { recursive: true });
/** Longest wait (ms). */
const PATIENCE = 180_000;

/** A folder that lasts as long as the tests. */
export function scratch(name) {
  const folder = mkdtempSync(join(tmpdir(), `bodyflight-${name}-`));
  process.on("exit", () => rmSync(folder, { recursive: true, force: true }));
  return folder;
}

/** Chromium with WebGL in software, or without WebGL. */
export function browser({ webgl = true } = {}) {
  const graphics = webgl
    ? ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
    : ["--disable-3d-apis"];
  return chromium.launch({ executablePath: need("BODYFLIGHT_CHROMIUM"), args: ["--no-sandbox", ...graphics] });
}

/** A page that fails the test on errors, and on anything fetched from elsewhere. */
export async function open(from, url, options = {}) {
  const page = await from.newPage({ viewport: { width: 1280, height: 720 }, acceptDownloads: true, ...options });
  // Graphics in software on a machine that has other work.
  page.setDefaultTimeout(PATIENCE);
  const wrong = [];
  page.on("pageerror", (error) => wrong.push(error.message));
  page.on("console", (message) => {
    if (message.type() === "error") wrong.push(message.text());
  });
  page.on("request", (request) => {
    if (!/^(file:|data:|blob:|http:\/\/127\.0\.0\.1:|ws:\/\/127\.0\.0\.1:)/.test(request.url()))
      wrong.push(`fetched ${request.url()}`);
  });
  await page.goto(url);
  return { page, wrong };
}

/** Runs the program to its end. */
export async function run(...words) {
  const { code, out, err } = await begin(...words).end;
  assert.equal(code, 0, err);
  return out;
}

/** Begins the program; `line` waits for a line of its output or its remarks. */
export function begin(...words) {
  const child = spawn(BODYFLIGHT, words);
  let [out, err] = ["", ""];
  child.stdout.on("data", (data) => {
    out += data;
  });
  child.stderr.on("data", (data) => {
    err += data;
  });
  const end = new Promise((resolve) => child.on("close", (code) => resolve({ code, out, err })));
  const line = async (pattern) => {
    for (let tries = 0; tries < 600; tries++) {
      const found = pattern.exec(out + err);
      if (found) return found[1];
      await new Promise((resolve) => setTimeout(resolve, 50));
    }
    assert.fail(`nothing like ${pattern} in: ${out}${err}`);
  };
  return { child, end, line };
}

export const shot = (page, name) => page.screenshot({ path: join(OUTPUT, `${name}.png`), timeout: PATIENCE });

/** How many colours a canvas shows: one where nothing was drawn. */
export function colours(page, selector) {
  return page.evaluate((selector) => {
    const source = document.querySelector(selector);
    const copy = document.createElement("canvas");
    [copy.width, copy.height] = [source.width, source.height];
    const context = copy.getContext("2d");
    context.drawImage(source, 0, 0);
    const pixels = new Uint32Array(context.getImageData(0, 0, copy.width, copy.height).data.buffer);
    return new Set(pixels).size;
  }, selector);
}

/** How many pixels of a canvas have a colour of the style sheet. */
export function inked(page, selector, ink) {
  return page.evaluate(
    ([selector, ink]) => {
      const hex = getComputedStyle(document.documentElement).getPropertyValue(`--${ink}`).trim();
      const wanted = [1, 3, 5].map((k) => Number.parseInt(hex.slice(k, k + 2), 16));
      const canvas = document.querySelector(selector);
      const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
      let count = 0;
      for (let k = 0; k < data.length; k += 4) {
        if (data[k + 3] > 200 && wanted.every((value, n) => Math.abs(data[k + n] - value) < 24)) count += 1;
      }
      return count;
    },
    [selector, ink],
  );
}
