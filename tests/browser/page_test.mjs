// What the page does when a gateway says something out of the ordinary, in Chromium against one that is made up:
//   node --test tests/browser/page_test.mjs
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { mkdtempSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, afterEach, before, beforeEach, test } from "node:test";
import { fileURLToPath } from "node:url";
import { launch, openViewer } from "../../web/tests/browser/browser.mjs";
import { FakeGateway } from "./fake_gateway.mjs";

const kSizes = [[320, 480], [480, 320], [390, 844], [844, 390], [1280, 720]];
const small = { width: 320, height: 480 };

let folder;
let browser;
let gateway;
before(async () => {
  folder = mkdtempSync(join(tmpdir(), "mr_page_"));
  const web = fileURLToPath(new URL("../../web", import.meta.url));
  execFileSync("npx", ["vite", "build", "--logLevel", "error", "--outDir", folder, "--emptyOutDir"], { cwd: web });
  browser = await launch();
});
after(async () => {
  await browser?.close();
  rmSync(folder, { recursive: true, force: true });
});
beforeEach(async () => {
  gateway = await FakeGateway.start(folder);
});
afterEach(() => gateway.stop());

const messageOf = (page) => page.textContent("#message");
const sequenceOf = (page) => page.evaluate(() => window.meshreduce.shown()?.sequence ?? null);

/** A page of its own storage, with all that its console says. */
async function openPage(url, viewport = small, colorScheme = "light") {
  const context = await browser.newContext({ viewport, colorScheme });
  const page = await context.newPage();
  page.said = [];
  page.on("console", (message) => page.said.push(message.text()));
  page.on("pageerror", (error) => page.said.push(String(error)));
  await page.goto(url);
  return page;
}

/** A page that shows what the gateway sends. */
async function openShown(options = {}) {
  gateway.run();
  const page = await openViewer(browser, gateway.url, [], options.viewport ?? small);
  await page.waitForFunction(() => document.getElementById("message").textContent === "");
  return page;
}

/** ms until the page says so. */
async function msUntil(page, id, pattern, timeout = 10_000) {
  const start = performance.now();
  await page.waitForFunction(
    ([id, source]) => {
      const element = document.getElementById(id);
      return element.getClientRects().length > 0 && new RegExp(source).test(element.textContent);
    },
    [id, pattern.source],
    { timeout, polling: 20 },
  );
  return performance.now() - start;
}

async function waitForNewer(page, sequence, timeout = 5000) {
  await page.waitForFunction((n) => window.meshreduce.shown().sequence > n, sequence, { timeout, polling: 20 });
}

/** Notes each sequence that is shown, from now on. */
async function noteShown(page) {
  await page.evaluate(() => {
    window.noted = [];
    const note = () => {
      const sequence = window.meshreduce.shown()?.sequence;
      if (sequence !== undefined && window.noted.at(-1) !== sequence) window.noted.push(sequence);
      requestAnimationFrame(note);
    };
    note();
  });
}
const notedBy = (page) => page.evaluate(() => window.noted);

const targetsOf = (viewer) => viewer.texts.filter(({ type }) => type === "target").map(({ mbps }) => mbps);

test("the slider asks for a rate, and again when the connection is made anew", async () => {
  gateway.mostMbps = 20;
  const page = await openShown({ viewport: { width: 900, height: 600 } });
  const slider = page.getByTestId("target");
  assert.equal(await page.getByTestId("target-text").textContent(), "20 Mbit/s");
  assert.deepEqual(targetsOf(gateway.viewer), [], "nothing is asked for unasked");
  await slider.fill("500");
  await page.waitForTimeout(300);
  assert.equal(targetsOf(gateway.viewer).length, 1);
  assert.ok(Math.abs(targetsOf(gateway.viewer)[0] - Math.sqrt(0.5 * 20)) < 0.01);
  assert.equal(await page.getByTestId("target-text").textContent(), "3.2 Mbit/s");
  await slider.focus();
  for (let i = 0; i < 5; ++i) await page.keyboard.press("ArrowLeft");
  await page.waitForTimeout(300);
  assert.ok(targetsOf(gateway.viewer).at(-1) < Math.sqrt(0.5 * 20), "by keys, too");
  const last = targetsOf(gateway.viewer).at(-1);
  gateway.closeAll(1001, "a restart");
  await page.waitForFunction(() => document.getElementById("message").textContent === "", null, { timeout: 10_000 });
  assert.equal(gateway.viewers.length, 2);
  assert.deepEqual(targetsOf(gateway.viewer), [last]);
  await page.locator("#scene").press("i");
  await page.waitForFunction(() => /Mbit/.test(document.querySelector('[data-testid="received"]').textContent));
});

test("without rate control there is no slider", async () => {
  const page = await openShown({ viewport: { width: 900, height: 600 } });
  assert.equal(await page.getByTestId("target").isVisible(), false);
});

test("packets with absurd numbers do not freeze the page", async () => {
  const page = await openShown();
  await noteShown(page);
  for (const [sequence, epoch] of [[2n ** 64n - 1n], [2n ** 53n], [2 ** 53 - 1], [gateway.sequence + 5000], [1, 0]])
    gateway.send(sequence, epoch);
  const before = gateway.sequence;
  await waitForNewer(page, before, 1000);
  // One that could be true holds up those up to it, for a second.
  gateway.send(gateway.sequence + 4000);
  const poisoned = gateway.sequence;
  await page.waitForFunction((n) => window.noted.at(-1) > n && window.noted.at(-1) < n + 3000, poisoned, { timeout: 3000 });
  const connections = gateway.viewers.length;
  assert.equal(connections, 1, "all over one connection");
  await page.click("#numbers");
  await page.waitForFunction(() => /\d+, \d+ out of order/.test(document.querySelector('[data-testid="capture"]').textContent));
  assert.ok(gateway.viewer.texts.some(({ type, sequence }) => type === "shown" && sequence === 2 ** 53 - 1), "refused and acknowledged");
  await page.close();
});

test("a packet that comes again is acknowledged and not shown", async () => {
  const page = await openShown();
  const replayed = gateway.sequence;
  await waitForNewer(page, replayed);
  await noteShown(page);
  for (let i = 0; i < 10; ++i) {
    gateway.send(replayed);
    await page.waitForTimeout(50);
  }
  const noted = await notedBy(page);
  assert.ok(noted.length > 3);
  assert.deepEqual(noted, [...noted].sort((a, b) => a - b));
  assert.ok(!noted.includes(replayed));
  assert.ok(gateway.viewer.texts.filter(({ type, sequence }) => type === "shown" && sequence === replayed).length > 9);
  await page.close();
});

test("after a hello the next packet counts, whatever its number is", async () => {
  const page = await openShown();
  await waitForNewer(page, 8);
  gateway.pause();
  await page.waitForTimeout(300);
  gateway.hello(gateway.viewer);
  gateway.send(2);
  await page.waitForFunction(() => window.meshreduce.shown().sequence === 2, null, { timeout: 3000 });
  await page.close();
});

test("a damaged packet is not shown, and the page goes on", async () => {
  const page = await openShown();
  const bytes = gateway.send(++gateway.sequence);
  bytes[bytes.length - 20] ^= 4;
  gateway.viewer.binary(bytes);
  await waitForNewer(page, gateway.sequence);
  assert.equal(gateway.viewers.length, 2, "over a new connection");
  await page.close();
});

test("a sensor that dies is named within two seconds, and no more when it is back", async () => {
  const page = await openShown();
  await page.waitForTimeout(2500);
  assert.equal(await page.isVisible("#notice"), false);
  gateway.sensors[1].alive = false;
  const ms = await msUntil(page, "notice", /^\s*cam-1 is missing\./);
  console.log(`told ${Math.round(ms)} ms after its last capture`);
  assert.ok(ms < 2000, `${ms} ms`);
  await page.click("#dismiss");
  gateway.sensors[1].alive = true;
  await page.waitForTimeout(1800);
  assert.equal(await page.textContent("#notice-text"), "");
  gateway.sensors[1].alive = false;
  await msUntil(page, "notice", /cam-1 is missing/);
  await page.close();
});

test("when nothing comes that is told within two seconds; that a recording has ended, too", async () => {
  const page = await openShown();
  gateway.pause();
  const ms = await msUntil(page, "message", /has stopped/);
  console.log(`told ${Math.round(ms)} ms after the last packet`);
  assert.ok(ms < 2000, `${ms} ms`);
  gateway.say({ type: "stopped", after_ms: 2000, ended: true });
  await msUntil(page, "message", /^The recording has ended\.$/);
  await page.waitForTimeout(2500);
  assert.equal(await messageOf(page), "The recording has ended.", "and stays so");
  await page.close();
});

test("why the gateway closes the connection is told while it is tried again", async () => {
  const page = await openShown();
  gateway.closeAll(1013, "too many viewers, try again later");
  await msUntil(page, "message", /\(too many viewers, try again later\)\. Trying again …/);
  await page.waitForFunction(() => document.getElementById("message").textContent === "", null, { timeout: 5000 });
  gateway.closeAll(1008, "too slow: what waits for you was too much");
  await msUntil(page, "message", /too slow: what waits for you was too much/);
  assert.equal(await page.isVisible("#lock"), false);
  await page.close();
});

test("the token of the address opens a locked scene, and stays nowhere to be seen", async () => {
  gateway.token = "a+b/c=";
  gateway.run();
  const page = await openPage(`${gateway.url}/?layers=still#token=${gateway.token}`);
  await page.waitForFunction(() => window.meshreduce?.shown() != null);
  assert.equal(await page.isVisible("#lock"), false);
  assert.equal(page.url(), `${gateway.url}/?layers=still`);
  assert.deepEqual(gateway.viewer.texts[0], { type: "token", token: gateway.token }, "its first word");
  await page.reload();
  await page.waitForFunction(() => window.meshreduce?.shown() != null);
  gateway.viewer.socket.destroy();
  await page.waitForFunction(() => /is lost|again/.test(document.getElementById("message").textContent), null, { polling: 10 });
  await page.waitForFunction(() => document.getElementById("message").textContent === "");
  assert.equal(gateway.viewers.length, 3);
  assert.equal(await page.isVisible("#lock"), false, "reloaded and reconnected by itself");
  assert.ok(![...gateway.requests, ...page.said].some((words) => words.includes("a+b") || words.includes("token")));
  await page.context().close();
});

test("a locked scene asks for its token, and keys are letters meanwhile", async () => {
  gateway.token = "volcano";
  gateway.run();
  const page = await openPage(gateway.url);
  await msUntil(page, "lock", /This scene is locked\./);
  assert.equal(await page.evaluate(() => document.activeElement.id), "token");
  assert.equal(await page.getByLabel("Token").getAttribute("autocomplete"), "current-password");
  await page.keyboard.type("vrilhwasd");
  assert.equal(await page.inputValue("#token"), "vrilhwasd");
  for (const id of ["mode", "numbers", "keys"]) assert.equal(await page.getAttribute(`#${id}`, "aria-pressed"), "false", id);
  assert.equal(await page.isVisible("#overlay"), false);
  await page.keyboard.press("Enter");
  await msUntil(page, "lock-error", /^wrong token$/);
  assert.equal(await page.getAttribute("#token", "aria-invalid"), "true");
  const tries = gateway.viewers.length;
  await page.waitForTimeout(3000);
  assert.equal(gateway.viewers.length, tries, "nothing is tried meanwhile");
  await page.keyboard.type("volcano"); // over the wrong one, which is selected
  assert.equal(await page.isVisible("#lock-error"), false);
  await page.keyboard.press("Enter");
  await page.waitForFunction(() => window.meshreduce.shown() != null);
  assert.equal(await page.isVisible("#lock"), false);
  assert.equal(await page.inputValue("#token"), "");
  assert.equal(await page.evaluate(() => document.activeElement.id), "scene");
  assert.equal(page.url(), `${gateway.url}/`);
  await page.keyboard.press("v");
  assert.equal(await page.getAttribute("#mode", "aria-pressed"), "true");
  // It expires while the page is open.
  gateway.token = "another";
  gateway.refusal = "the token has expired";
  gateway.closeAll(1008, "the token has expired");
  await msUntil(page, "lock-error", /the token has expired/);
  assert.equal(await page.evaluate(() => Object.keys(sessionStorage).length), 0, "a reload does not try it again");
  await page.evaluate(() => (location.hash = "token=another"));
  await page.waitForFunction(() => document.getElementById("lock").hidden && document.getElementById("message").textContent === "");
  assert.equal(page.url(), `${gateway.url}/`);
  assert.ok(!page.said.some((words) => /volcano|vrilhwasd|another/.test(words)));
  await page.context().close();
});

test("the question for the token fits into any window, in light and dark", async () => {
  gateway.token = "secret";
  for (const colorScheme of ["light", "dark"]) {
    const page = await openPage(gateway.url, small, colorScheme);
    await msUntil(page, "lock", /locked/);
    const shoot = async (name) => {
      const { PICTURES } = process.env;
      if (PICTURES) await page.screenshot({ path: join(PICTURES, `lock-${name}.png`) });
    };
    for (const error of ["", "the token has expired"]) {
      if (error !== "") {
        gateway.refusal = error;
        await page.fill("#token", "old");
        await page.click("#unlock");
        await msUntil(page, "lock-error", /expired/);
      }
      for (const [width, height] of kSizes) {
        await page.setViewportSize({ width, height });
        const box = await page.locator("#lock").boundingBox();
        const isInside = box.x >= 0 && box.y >= 0 && box.x + box.width <= width && box.y + box.height <= height;
        assert.ok(isInside, `${width} x ${height}: ${JSON.stringify(box)}`);
        await shoot(`${colorScheme}-${width}x${height}${error === "" ? "" : "-refused"}`);
      }
    }
    await page.context().close();
  }
});

/** tests/codec/alpha_packet_test.cpp: a red wall that moves before a blue one that stays, both with planes of alpha. */
function alphaPackets() {
  const bytes = readFileSync(new URL("../../web/tests/data/packets_alpha.bin", import.meta.url));
  const out = [];
  for (let at = 0; at < bytes.length; at += 4 + bytes.readUInt32LE(at)) out.push(bytes.subarray(at + 4, at + 4 + bytes.readUInt32LE(at)));
  return out;
}

/** Looks as the views' cameras do: what is drawn lies where it lies in their pictures, of 64 x 48 pixels. */
const kAlphaCamera = { position: [0, 0, 1], target: [0, 2, 1], up: [0, 0, 1], fx: 60, fy: 60, cx: 31.5, cy: 23.5, width: 64, height: 48 };

/** "r", "b" or "?" for each pixel. */
function colorsOf(base64) {
  const pixels = Buffer.from(base64, "base64");
  return Array.from({ length: pixels.length / 4 }, (_, i) => {
    const [r, g, b] = pixels.subarray(4 * i, 4 * i + 3);
    const isNear = (color) => color.every((v, k) => Math.abs(v - [r, g, b][k]) < 12);
    return isNear([200, 60, 40]) ? "r" : isNear([40, 80, 200]) ? "b" : "?";
  });
}

/** Nothing but a red disc of 16 pixels' radius before blue, or nothing but red. `edge`: pixels by which its outline may be off. */
function checkDisc(colors, edge) {
  colors.forEach((color, i) => {
    const away = Math.hypot((i % 64) - 31.5, Math.floor(i / 64) - 23.5);
    if (away < 16 - edge) assert.equal(color, "r", `pixel ${i}, ${away} from the middle`);
    else if (away > 16 + edge) assert.equal(color, "b", `pixel ${i}, ${away} from the middle`);
    else assert.notEqual(color, "?", `pixel ${i}: drawn or not, nothing between`);
  });
}

test("what moves is cut by the alpha of its picture, in its capture alone; what stays and panoramas are not", async () => {
  const page = await openPage(gateway.url);
  await page.waitForFunction(() => window.meshreduce !== undefined);
  for (let i = 0; gateway.viewer?.isIn !== true && i < 200; ++i) await page.waitForTimeout(20);
  await page.evaluate((camera) => window.meshreduce.setCamera(camera), kAlphaCamera);
  const seen = [];
  for (const [i, bytes] of alphaPackets().entries()) {
    gateway.viewer.binary(bytes);
    await page.waitForFunction((n) => window.meshreduce.shown()?.sequence === n, i + 1, { timeout: 20_000 });
    seen.push(colorsOf(await page.evaluate(() => window.meshreduce.pixels())));
    // On the screen, with what is kept of the still wall, as drawn afresh.
    const [kept, afresh] = await page.evaluate(() => [window.meshreduce.screen(false), window.meshreduce.screen(true)]);
    assert.equal(kept, afresh, `packet ${i + 1}`);
  }
  checkDisc(seen[0], 1.5);
  assert.ok(seen[1].every((color) => color === "r"), "a capture without a plane");
  assert.ok(seen[2].every((color) => color === "r"), "a plane of another size");
  assert.ok(seen[3].every((color) => color === "r"), "a broken plane");
  checkDisc(seen[4], 3);
  assert.ok(seen[5].every((color) => color === "r"), "a panorama");
  const said = page.said.filter((words) => words.includes("alpha"));
  assert.deepEqual(said, ["stream 0: an alpha plane that is not of its picture's size", "stream 0: alpha plane: more bytes than it has use for"]);
  await page.click("#numbers");
  await page.waitForFunction(() => /^6, 2 broken parts/.test(document.querySelector('[data-testid="capture"]').textContent));
  assert.equal(gateway.viewers.length, 1, "over one connection");
  await page.context().close();
});
