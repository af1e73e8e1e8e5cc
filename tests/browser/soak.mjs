// Runs the demo with a browser on the same machine and watches what grows:
//   node tests/browser/soak.mjs PROGRAM [minutes] [picture.png]
// Prints one line every ten seconds and, as the last line, a JSON object. Ends with 1 when the server's or the
// page's memory rises by more than a tenth after the first quarter, or the stream stops.
import { mkdtempSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { launch, openViewer } from "../../web/tests/browser/browser.mjs";
import { Server } from "./server.mjs";

const [program, minutes = "10", picture] = process.argv.slice(2);
const kEveryMs = 10_000;
const folder = mkdtempSync(join(tmpdir(), "mr_soak_"));
const report = join(folder, "report.json");
const errors = [];

// Without the mapped cache of pictures, which fills up to its size.
const ownMb = (pid) => Number(/RssAnon:\s+(\d+)/.exec(readFileSync(`/proc/${pid}/status`, "utf8"))[1]) / 1024;
const sleep = (ms) => new Promise((resolve) => setTimeout(resolve, ms));
const median = (values) => [...values].sort((a, b) => a - b)[Math.floor(values.length / 2)];

/** What the overlay says, and the page's memory. */
async function look(page, session) {
  const read = async (id) => (await page.locator(`[data-testid="${id}"]`).textContent()) ?? "";
  await session.send("HeapProfiler.collectGarbage");
  const { usedSize } = await session.send("Runtime.getHeapUsage");
  return {
    fps: parseFloat(await read("frame-rate")),
    latency_ms: parseFloat(await read("latency")),
    mesh: await read("mesh-rate"),
    texture: await read("texture-rate"),
    triangles: await read("triangles"),
    page_mb: usedSize / 2 ** 20,
  };
}

/** By how much the second half lies above the second quarter. */
function growth(samples, key) {
  const values = samples.map((s) => s[key]);
  const n = values.length;
  const before = median(values.slice(Math.floor(n / 4), Math.floor(n / 2)));
  return median(values.slice(Math.floor(n / 2))) / before - 1;
}

const server = await Server.start(program, ["demo", "--listen", "127.0.0.1:0", "--report", report]);
const browser = await launch();
const samples = [];
try {
  const page = await openViewer(browser, server.url, errors, { width: 960, height: 540 });
  await page.keyboard.press("i");
  const session = await page.context().newCDPSession(page);
  for (let at = 0; at < Number(minutes) * 60_000; at += kEveryMs) {
    await sleep(kEveryMs);
    const sample = { s: (at + kEveryMs) / 1000, server_mb: ownMb(server.child.pid), ...(await look(page, session)) };
    samples.push(sample);
    console.log(
      `${String(sample.s).padStart(4)} s  ${sample.fps} captures/s  ${sample.latency_ms} ms  mesh ${sample.mesh}  ` +
        `texture ${sample.texture}  ${sample.triangles} triangles  server ${sample.server_mb.toFixed(0)} MB  ` +
        `page ${sample.page_mb.toFixed(1)} MB`,
    );
  }
  if (picture) await page.screenshot({ path: picture });
} finally {
  await browser.close();
  await server.stop("SIGTERM");
}
const end = JSON.parse(readFileSync(report, "utf8"));
rmSync(folder, { recursive: true, force: true });
const drops = Object.assign({}, ...Object.values(end.nodes).map((node) => node.drops), end.transport_drops);
const result = {
  minutes: Number(minutes),
  fps_p50: median(samples.map((s) => s.fps)),
  latency_ms_p50: median(samples.map((s) => s.latency_ms)),
  server_growth: growth(samples, "server_mb"),
  page_growth: growth(samples, "page_mb"),
  drops,
  errors,
  preset: end.preset,
};
console.log(JSON.stringify(result));
const stopped = samples.some((s) => !(s.fps > 0));
process.exitCode = stopped || result.server_growth > 0.1 || result.page_growth > 0.1 ? 1 : 0;
