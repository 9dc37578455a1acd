// Browser helpers for the tests, and requirements on every page.
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

/** A temporary folder that is removed after the tests. */
export function scratch(name) {
  const folder = mkdtempSync(join(tmpdir(), `bodyflight-${name}-`));
  process.on("exit", () => rmSync(folder, { recursive: true, force: true }));
  return folder;
}

/** Launches Chromium with software WebGL, or without WebGL. */
export function browser({ webgl = true } = {}) {
  const graphics = webgl
    ? ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
    : ["--disable-3d-apis"];
  return chromium.launch({ executablePath: need("BODYFLIGHT_CHROMIUM"), args: ["--no-sandbox", ...graphics] });
}

/** Opens a page and collects its errors and any requests to other hosts. */
export async function open(from, url, options = {}) {
  const page = await from.newPage({ viewport: { width: 1280, height: 720 }, acceptDownloads: true, ...options });
  // Allow for software rendering on a busy machine.
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

/** Runs the program to completion. */
export async function run(...words) {
  const { code, out, err } = await begin(...words).end;
  assert.equal(code, 0, err);
  return out;
}

/** Starts the program; `line` waits for a pattern in its output. */
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

/** Number of colours on a canvas; 1 if nothing was drawn. */
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

/** Number of pixels of a canvas in a colour of the style sheet. */
export function inked(page, selector, ink) {
  return page.evaluate(
    ([selector, ink]) => {
      const hex = getComputedStyle(document.documentElement).getPropertyValue(`--${ink}`).trim();
      const wanted = [1, 3, 5].map((k) => Number.parseInt(hex.slice(k, k + 2), 16));
      const source = document.querySelector(selector);
      const copy = document.createElement("canvas");
      [copy.width, copy.height] = [source.width, source.height];
      const context = copy.getContext("2d");
      context.drawImage(source, 0, 0);
      const { data } = context.getImageData(0, 0, copy.width, copy.height);
      let count = 0;
      for (let k = 0; k < data.length; k += 4) {
        if (data[k + 3] > 200 && wanted.every((value, n) => Math.abs(data[k + n] - value) < 24)) count += 1;
      }
      return count;
    },
    [selector, ink],
  );
}
