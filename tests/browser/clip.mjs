// Takes README's pictures from the demo: live.png, the frames of the clip, and the room from six places to look at:
//   node tests/browser/clip.mjs build/release/bin/meshreduce /tmp/clip
//   cp /tmp/clip/live.png docs/pictures; img2webp -lossy -q 65 -m 6 -d 250 /tmp/clip/frame-*.png -o docs/pictures/live.webp
import { mkdirSync } from "node:fs";
import { join } from "node:path";
import { launch, openViewer } from "../../web/tests/browser/browser.mjs";
import { Server } from "./server.mjs";

const [program, folder, ...options] = process.argv.slice(2);
const kLearntAfterMs = 60_000; // the room, with its colours
const kFrames = 48;
const kFrameMs = 250;
const kPlaces = [
  [-2.1, -2.6, 1.85], [2.1, -2.6, 1.6], [2.3, 2.2, 1.7], [-2.3, 2.3, 1.6], [0, -2.8, 1.2], [-2.8, 0.2, 1.5],
];
const kLookAt = [0.2, 0.4, 0.85];
const kLens = { width: 1280, height: 720, fx: 720, fy: 720, cx: 639.5, cy: 359.5 };

mkdirSync(folder, { recursive: true });
const server = await Server.start(program, ["demo", "--listen", "127.0.0.1:0", ...options]);
const browser = await launch();
try {
  const context = await browser.newContext({ viewport: { width: 1280, height: 720 }, colorScheme: "light" });
  const page = await openViewer(context, `${server.url}/`, [], null);
  await page.evaluate(() => {
    for (const part of document.querySelectorAll("body *"))
      if (part.localName !== "canvas" && part.querySelector("canvas") === null) part.style.visibility = "hidden";
  });
  await page.waitForTimeout(kLearntAfterMs);
  const shoot = (name) => page.screenshot({ path: join(folder, name) });
  await shoot("live.png");
  for (const [i, position] of kPlaces.entries()) {
    await page.evaluate((camera) => window.meshreduce.setCamera(camera), { ...kLens, position, target: kLookAt });
    await page.waitForTimeout(1500);
    await shoot(`place-${i + 1}.png`);
  }
  await page.evaluate(() => window.meshreduce.setCamera(null));
  await page.setViewportSize({ width: 960, height: 540 });
  await page.waitForTimeout(1000);
  for (let i = 0; i < kFrames; ++i) {
    const next = Date.now() + kFrameMs;
    await shoot(`frame-${String(i).padStart(2, "0")}.png`);
    await page.waitForTimeout(Math.max(0, next - Date.now()));
  }
} finally {
  await browser.close();
  await server.stop();
}
