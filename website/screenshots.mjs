// Takes the pictures of the console in docs/images from a running demo: `make screenshots`.
// usage: node website/screenshots.mjs FOLDER ADDRESS-OF-A-MATCH

import { execFileSync } from "node:child_process";

import { chromium } from "playwright-core";

const [folder, match] = process.argv.slice(2);
if (!match) {
  console.error("usage: node website/screenshots.mjs FOLDER ADDRESS-OF-A-MATCH");
  process.exit(2);
}
const wide = { width: 1280, height: 800 };
const phone = { width: 390, height: 780 };
const { origin } = new URL(match);
const map = `${origin}/ui/collections/forests/map`;

/** Each picture: its name, what it shows, how wide, and by which light. */
const PICTURES = [
  ["console-match", match, wide, "light"],
  ["console-match-dark", match, wide, "dark"],
  ["console-match-phone", match, phone, "light"],
  ["console-map", map, wide, "light"],
  ["console-operations", `${origin}/ui/operations`, wide, "dark"],
  ["console-queries", `${origin}/ui/collections/forests/queries`, wide, "light"],
];

const executablePath = ["chromium", "chromium-browser", "google-chrome"].map(pathOf).find(Boolean);
if (!executablePath) {
  console.error("make screenshots: Chromium is not here (apt-get install chromium)");
  process.exit(2);
}
const browser = await chromium.launch({
  executablePath,
  args: ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-gpu-compositing", "--no-sandbox"],
});
for (const [name, address, viewport, colorScheme] of PICTURES) {
  const page = await browser.newPage({ viewport, colorScheme });
  await page.goto(address);
  await page.waitForFunction(() => document.querySelector("main") && !document.querySelector(".loading"));
  await page.waitForTimeout(1500); // until what moves has come to rest
  await page.screenshot({ path: `${folder}/${name}.png` });
  await page.close();
}
await browser.close();

function pathOf(name) {
  try {
    return execFileSync("which", [name], { encoding: "utf8" }).trim();
  } catch {
    return null; // `which` fails where there is no such program
  }
}
