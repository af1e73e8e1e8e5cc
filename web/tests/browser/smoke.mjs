// Opens the viewer, waits for the first picture, tells the overlay's numbers and saves a screenshot:
//   node tests/browser/smoke.mjs http://127.0.0.1:8080 picture.png
import { launch, openViewer } from "./browser.mjs";

const [url = "http://127.0.0.1:8080", file = "smoke.png"] = process.argv.slice(2);
const browser = await launch();
try {
  const errors = [];
  const start = performance.now();
  const page = await openViewer(browser, url, errors);
  console.log(`first picture after ${Math.round(performance.now() - start)} ms`);
  await page.keyboard.press("i");
  await page.waitForTimeout(3000);
  for (const id of ["frame-rate", "latency", "received", "mesh-rate", "still-mesh-rate", "texture-rate", "plate-rate", "triangles", "chunks", "capture", "coding", "device"])
    console.log(`${id}: ${await page.getByTestId(id).textContent()}`);
  console.log(await page.evaluate(() => [window.meshreduce.state(), window.meshreduce.shown()]));
  await page.screenshot({ path: file });
  for (const error of errors) console.error(error);
  process.exitCode = errors.length > 0 ? 1 : 0;
} finally {
  await browser.close();
}
