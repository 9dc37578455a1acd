// Bundles the page: scripts, styles and the core's wasm in one HTML file, dist/viewer.html.

import { readFile, writeFile } from "node:fs/promises";
import { build } from "esbuild";

const wasm = process.env.BODYFLIGHT_WASM;
if (!wasm) {
  throw new Error("BODYFLIGHT_WASM names no file: run cargo xtask viewer, which builds it first");
}
const bundle = await build({
  entryPoints: ["src/main.ts"],
  bundle: true,
  minify: true,
  format: "iife",
  target: "es2022",
  write: false,
  outdir: "dist",
  legalComments: "inline",
  loader: { ".wasm": "binary" },
  alias: { "core.wasm": wasm },
});
const text = (end) => bundle.outputFiles.find((file) => file.path.endsWith(end)).text;
// The script must not contain its own end tag.
const script = text(".js").replaceAll("</script", "<\\/script");
const page = await readFile("src/page.html", "utf8");
const html = page.replace("/* style */", () => text(".css")).replace("/* script */", () => script);
await writeFile("dist/viewer.html", html);
console.log(`dist/viewer.html: ${Math.round(html.length / 1000)} kB`);
