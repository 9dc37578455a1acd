// Bundles the page: scripts, styles and the core's wasm in one HTML file.

import { readFile, writeFile } from "node:fs/promises";
import { build } from "esbuild";

const { BODYFLIGHT_WASM: wasm, BODYFLIGHT_PAGE: target } = process.env;
if (!wasm || !target) {
  throw new Error("BODYFLIGHT_WASM and BODYFLIGHT_PAGE name no files: run cargo xtask viewer, which sets them");
}
const bundle = await build({
  entryPoints: ["src/main.ts"],
  bundle: true,
  minify: true,
  format: "iife",
  target: "es2022",
  write: false,
  outdir: "page",
  legalComments: "inline",
  loader: { ".wasm": "binary" },
  alias: { "core.wasm": wasm },
});
const text = (end) => bundle.outputFiles.find((file) => file.path.endsWith(end)).text;
// The script must not contain its own end tag.
const script = text(".js").replaceAll("</script", "<\\/script");
const page = await readFile("src/page.html", "utf8");
const html = page.replace("/* style */", () => text(".css")).replace("/* script */", () => script);
await writeFile(target, html);
console.log(`${target}: ${Math.round(html.length / 1000)} kB`);
