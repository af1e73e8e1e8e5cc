// Puts pictures side by side, such as those of `meshreduce eval ssim --pictures` before and after a change:
//   node tests/browser/sheet.mjs OUT.jpg COLUMNS WIDTH_PX A.png B.png …
import { readFileSync } from "node:fs";
import { launch } from "../../web/tests/browser/browser.mjs";

const [out, columns, widthPx, ...files] = process.argv.slice(2);
if (out === undefined || !(Number(columns) > 0) || !(Number(widthPx) > 0) || files.length === 0) {
  console.error("usage: node sheet.mjs OUT.jpg COLUMNS WIDTH_PX PICTURE…");
  process.exit(2);
}
const browser = await launch();
try {
  const page = await browser.newPage({ viewport: { width: columns * widthPx, height: 100 } });
  const pictures = files.map((file) => `<img src="data:image/png;base64,${readFileSync(file).toString("base64")}">`);
  await page.setContent(
    `<style>body{margin:0;display:grid;grid-template-columns:repeat(${columns},${widthPx}px)}img{width:100%;display:block}</style>` +
      pictures.join(""),
    { waitUntil: "load" },
  );
  await page.screenshot({ path: out, fullPage: true, type: out.endsWith(".png") ? "png" : "jpeg" });
} finally {
  await browser.close();
}
