// What people see and touch on the page, in Chromium against running servers:
//   node --test tests/browser/interface_test.mjs     with MESHREDUCE naming the program
import assert from "node:assert/strict";
import { mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { launch, openViewer } from "../../web/tests/browser/browser.mjs";
import { Server } from "./server.mjs";

const { MESHREDUCE: program } = process.env;
const kSizes = [[320, 480], [480, 320], [390, 844], [844, 390], [768, 1024], [1280, 720]];
const kParts = ["message", "notice", "legend", "overlay", "help", "mode", "home", "legend-toggle", "numbers", "keys"];

let folder;
let browser;
let server;
before(async () => {
  folder = mkdtempSync(join(tmpdir(), "mr_interface_"));
  process.env.XDG_CACHE_HOME ??= join(tmpdir(), "mr_test_cache");
  browser = await launch();
  server = await serve("plain");
});
after(async () => {
  await browser?.close();
  await server?.stop();
  rmSync(folder, { recursive: true, force: true });
});

function serve(name, more = "") {
  const file = join(folder, `${name}.yaml`);
  writeFileSync(
    file,
    `scene: ${name}
up: [0, 0, 1]
fps: 30
voxel_m: 0.04
rig: {type: synthetic, seed: 2, room: [5, 4, 2.6], people: 1, sensors: 2, depth_mode: nfov_binned, color: [320, 180], frames: 30, loop: true}
fusion: {chunk_m: 2.56, truncation_m: 0.12}
simplify: {ratio: 0.1}
atlas: {size: [640, 368]}
mergers: [{id: root, inputs: [cam-0, cam-1], deadline_ms: 100}]
${more}`,
  );
  return Server.start(program, ["run", file, "--listen", "127.0.0.1:0"]);
}

const eyeOf = (page) => page.evaluate(() => window.meshreduce.eye());
const distance = (a, b) => Math.hypot(...a.map((v, i) => v - b[i]));
const held = () => openViewer(browser, `${server.url}/?hold=1`, [], { width: 640, height: 480 });

/** Pairs of parts that share pixels, and parts that stick out; a part inside a panel that scrolls counts as far as it shows. */
function faults(page) {
  return page.evaluate((ids) => {
    const shown = (id) => {
      const element = document.getElementById(id);
      const box = element.getBoundingClientRect();
      let { left, top, right, bottom } = box;
      const around = element.closest("#panels")?.getBoundingClientRect();
      if (around) {
        [left, top] = [Math.max(left, around.left), Math.max(top, around.top)];
        [right, bottom] = [Math.min(right, around.right), Math.min(bottom, around.bottom)];
      }
      return { id, left, top, right, bottom };
    };
    const boxes = ids.map(shown).filter((b) => b.right > b.left && b.bottom > b.top);
    const out = [];
    boxes.forEach((a, i) => {
      if (a.left < 0 || a.top < 0 || a.right > innerWidth || a.bottom > innerHeight) out.push(`${a.id} sticks out`);
      for (const b of boxes.slice(i + 1))
        if (a.left < b.right && b.left < a.right && a.top < b.bottom && b.top < a.bottom) out.push(`${a.id} over ${b.id}`);
    });
    // What is said stays on top of all.
    const message = document.getElementById("message");
    const { left, top, width, height } = message.getBoundingClientRect();
    if (document.elementFromPoint(left + width / 2, top + height / 2) !== message) out.push("the message is covered");
    return out;
  }, kParts);
}

test("nothing lies over anything else, at any size, with everything open and the connection lost", async () => {
  const own = await serve("goes-away");
  const page = await openViewer(browser, own.url, [], { width: 1280, height: 720 });
  for (const key of ["i", "h"]) await page.keyboard.press(key);
  assert.equal(await page.locator("#legend").isVisible(), true, "open by itself where there is room");
  await own.stop("SIGKILL");
  await page.waitForFunction(() => /is lost/.test(document.getElementById("message").textContent), null, { polling: 20 });
  await page.evaluate(() => {
    // The words change as it tries again; the longest stay. A notice beside them, as long as any.
    document.getElementById("message").textContent = `The connection to ${location.host} is lost. Trying again …`;
    document.getElementById("notice-text").textContent =
      "The server is slower than the sensors: 6 of 30 captures a second. cam-0, cam-1 and cam-2 are missing.";
    document.getElementById("notice").hidden = false;
  });
  for (const [width, height] of kSizes) {
    await page.setViewportSize({ width, height });
    assert.deepEqual(await faults(page), [], `${width} x ${height}`);
  }
  await page.close();
});

test("Tab goes through the buttons and leaves the page, V walks, and Escape closes", async () => {
  const page = await held();
  const focused = () => page.evaluate(() => document.activeElement?.id ?? "");
  const seen = [];
  for (let i = 0; i < 12; ++i) {
    await page.keyboard.press("Tab");
    seen.push(await focused());
  }
  const order = ["scene", "mode", "home", "legend-toggle", "numbers", "keys", ""];
  assert.deepEqual(seen.slice(0, order.length), order, "and then out of the page");
  assert.equal(await page.getAttribute("#mode", "aria-pressed"), "false", "Tab did not walk");
  await page.keyboard.press("v");
  assert.equal(await page.getAttribute("#mode", "aria-pressed"), "true");
  for (const [key, button, panel] of [["i", "numbers", "overlay"], ["h", "keys", "help"], ["l", "legend-toggle", "legend"]]) {
    const states = async () => [
      await page.getAttribute(`#${button}`, "aria-pressed"),
      await page.getAttribute(`#${button}`, "aria-expanded"),
      String(await page.locator(`#${panel}`).isVisible()),
    ];
    assert.equal(await page.getAttribute(`#${button}`, "aria-controls"), panel);
    assert.deepEqual(await states(), ["false", "false", "false"], button);
    await page.keyboard.press(key);
    assert.deepEqual(await states(), ["true", "true", "true"], button);
    await page.keyboard.press("Escape");
    assert.deepEqual(await states(), ["false", "false", "false"], button);
    await page.focus(`#${button}`);
    await page.keyboard.press("Enter");
    assert.deepEqual(await states(), ["true", "true", "true"], button);
    await page.keyboard.press("Escape");
  }
  await page.close();
});

test("the page starts in the room, at eye height, and looks at surface", async () => {
  const page = await held();
  const { position: [x, y, z], forward } = await eyeOf(page);
  assert.ok(Math.abs(x) < 2.5 && Math.abs(y) < 2 && z > 1.3 && z < 1.9, `${x}, ${y}, ${z}`);
  assert.ok(Math.abs(forward[2]) < 0.5);
  await page.close();
});

test("the page starts where the scene says", async () => {
  const own = await serve("with-start", "gateway: {start: {eye: [1, -1, 1.5], look_at: [-1, 1, 1]}}\n");
  try {
    const page = await openViewer(browser, `${own.url}/?hold=1`, [], { width: 640, height: 480 });
    const { position, forward } = await eyeOf(page);
    assert.ok(distance(position, [1, -1, 1.5]) < 1e-6);
    assert.ok(distance(forward, [-2, 2, -0.5].map((v) => v / Math.hypot(2, 2, 0.5))) < 1e-6);
    await page.close();
  } finally {
    await own.stop();
  }
});

test("whatever is done, the eye stays near and R brings it back", async () => {
  const page = await held();
  const start = (await eyeOf(page)).position;
  await page.mouse.move(320, 240);
  for (let i = 0; i < 60; ++i) await page.mouse.wheel(0, 500);
  const far = distance((await eyeOf(page)).position, start);
  assert.ok(far > 3 && far < 30, `${far} m away`);
  await page.keyboard.press("r");
  assert.ok(distance((await eyeOf(page)).position, start) < 1e-6);
  for (let i = 0; i < 60; ++i) await page.mouse.wheel(0, -500);
  const near = distance((await eyeOf(page)).position, start);
  assert.ok(near > 0.3 && near < 6, `${near} m nearer`);
  await page.click("#home");
  assert.ok(distance((await eyeOf(page)).position, start) < 1e-6);
  await page.close();
});

test("when nothing moves, the processor draws at full resolution, too", async () => {
  const page = await openViewer(browser, `${server.url}/?hold=1`, [], { width: 1280, height: 720 });
  await page.waitForFunction(() => window.meshreduce.size()[0] >= innerWidth, null, { timeout: 10_000 });
  await page.mouse.move(600, 300);
  await page.mouse.wheel(0, 100);
  await page.waitForFunction(() => window.meshreduce.size()[0] < innerWidth, null, { timeout: 10_000, polling: 10 });
  await page.waitForFunction(() => window.meshreduce.size()[0] >= innerWidth, null, { timeout: 10_000 });
  await page.close();
});

test("the screen is light or dark as the browser asks, and not flat where nothing is known", async () => {
  const levels = async (colorScheme) => {
    const page = await browser.newPage({ viewport: { width: 320, height: 480 }, colorScheme });
    await page.goto(`${server.url}/?hold=1`);
    await page.waitForFunction(() => window.meshreduce?.shown() != null, null, { timeout: 20_000 });
    // Far above, looking up: nothing but the stage.
    const values = await page.evaluate(
      () =>
        new Promise((resolve) => {
          window.meshreduce.setCamera({ position: [0, 0, 9], target: [1, 0, 9.4], up: [0, 0, 1], fx: 1, fy: 1, cx: 0, cy: 0, width: 1, height: 1 });
          // After the page's own drawing, in the same frame.
          requestAnimationFrame(() => {
            const copy = document.createElement("canvas");
            [copy.width, copy.height] = [80, 120];
            const context = copy.getContext("2d");
            context.drawImage(document.getElementById("scene"), 0, 0, 80, 120);
            const greens = context.getImageData(0, 0, 80, 120).data.filter((_, i) => i % 4 === 1);
            resolve({ low: Math.min(...greens), high: Math.max(...greens), mean: greens.reduce((a, b) => a + b, 0) / greens.length });
          });
        }),
    );
    const pageColor = await page.evaluate(() => getComputedStyle(document.body).backgroundColor);
    await page.close();
    return { ...values, pageColor };
  };
  const [light, dark] = [await levels("light"), await levels("dark")];
  assert.ok(light.high - light.low > 8 && dark.high - dark.low > 8, JSON.stringify([light, dark]));
  assert.notEqual(light.pageColor, dark.pageColor);
  assert.ok(light.mean > dark.mean, JSON.stringify([light, dark]));
});
