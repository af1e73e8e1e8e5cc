// Every picture must carry the number of the mesh it is drawn on, and a deliberate mistake must be found. The
// server must burn the numbers in:
//   node tests/browser/pairs.mjs http://127.0.0.1:8080 [pairs]
import { launch, openViewer } from "./browser.mjs";

const [url = "http://127.0.0.1:8080", wanted = "60"] = process.argv.slice(2);
const isWrong = ({ meshSequence, textureNumber }) => meshSequence % 65_536 !== textureNumber;
const browser = await launch();

async function pairsOf(query) {
  const errors = [];
  const page = await openViewer(browser, `${url}/?${query}`, errors, { width: 320, height: 240 });
  await page.waitForFunction((n) => window.meshreduce.pairs().length >= n, Number(wanted), { timeout: 60_000 });
  const pairs = await page.evaluate(() => window.meshreduce.pairs());
  await page.close();
  console.log(`${query}: ${pairs.filter(isWrong).length} wrong of ${pairs.length}`);
  return { pairs, errors };
}

try {
  const good = await pairsOf("check=pairs");
  const broken = await pairsOf("check=pairs&break=pairs");
  for (const error of good.errors) console.error(error);
  // The first picture has none before it.
  const found = broken.pairs.slice(1).every(isWrong);
  process.exitCode = good.pairs.some(isWrong) || !found ? 1 : 0;
} finally {
  await browser.close();
}
