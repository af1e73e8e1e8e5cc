import { chromium } from "playwright-core";

/** Chromium as it runs on a machine without a GPU. */
export function launch() {
  return chromium.launch({
    executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium",
    args: ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"],
  });
}

/** Opens a page of the viewer; `errors` fills with what it complains about. `viewport`: null in a context that has its own. */
export async function openViewer(browser, url, errors, viewport = { width: 960, height: 720 }) {
  const page = await (viewport === null ? browser.newPage() : browser.newPage({ viewport }));
  page.on("pageerror", (error) => errors.push(String(error)));
  page.on("console", (message) => {
    if (message.type() === "error" || message.type() === "warning") errors.push(message.text());
  });
  await page.goto(url);
  await page.waitForFunction(() => window.meshreduce?.shown() != null, null, { timeout: 20_000 });
  return page;
}
