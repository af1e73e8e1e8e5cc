// Takes the pictures of docs/viewer.md from the demo:
//   node tests/browser/screenshots.mjs build/dev/bin/meshreduce docs/pictures
import { join } from "node:path";
import { launch, openViewer } from "../../web/tests/browser/browser.mjs";
import { Server } from "./server.mjs";

const [program, folder] = process.argv.slice(2);
const kPhone = { deviceScaleFactor: 2, isMobile: true, hasTouch: true };
const kPictures = [
  { name: "viewer-start", width: 1280, height: 720, colorScheme: "light" },
  { name: "viewer-walk", width: 1280, height: 720, colorScheme: "dark", walk: true },
  { name: "viewer-phone-upright", width: 390, height: 844, colorScheme: "light", ...kPhone, open: ["legend-toggle"] },
  { name: "viewer-phone-across", width: 844, height: 390, colorScheme: "dark", ...kPhone },
];
const kFullAfterMs = 2500; // nothing moves: drawn in full by then
const kLearntAfterMs = 20_000; // the room, with its colours
const kViews = 8; // of four sensors: live pictures and plates

/** A page that holds a capture of all sensors: early ones lack some. */
async function openWhole(context, url) {
  for (;;) {
    const page = await openViewer(context, `${url}/?hold=1`, [], null);
    if ((await page.evaluate(() => window.meshreduce.shown().views)) === kViews) return page;
    await page.close();
  }
}

const server = await Server.start(program, ["demo", "--listen", "127.0.0.1:0"]);
const browser = await launch();
try {
  await new Promise((resolve) => setTimeout(resolve, kLearntAfterMs));
  for (const { name, width, height, walk = false, open = [], ...rest } of kPictures) {
    const context = await browser.newContext({ viewport: { width, height }, ...rest });
    const page = await openWhole(context, server.url);
    for (const id of open) await page.click(`#${id}`);
    if (walk) {
      await page.keyboard.press("v");
      await page.keyboard.down("w");
      await page.waitForTimeout(900);
      await page.keyboard.up("w");
    }
    await page.waitForTimeout(kFullAfterMs);
    const path = join(folder, `${name}.jpg`);
    await page.screenshot({ path, type: "jpeg", quality: 80 });
    console.log(path);
    await context.close();
  }
} finally {
  await browser.close();
  await server.stop();
}
