import { launch, openViewer } from "../../web/tests/browser/browser.mjs";
import { Server } from "./server.mjs";
const [program, mode, out] = process.argv.slice(2);
const browser = await launch();
const extra = mode.startsWith("fixed") ? ["--set", "rate.model=fixed"] : [];
const server = await Server.start(program, ["demo", "--small", "--listen", "127.0.0.1:0", ...extra]);
try {
  const open = async () => { const p = await openViewer(browser, server.url, [], { width: 900, height: 600 }); await p.locator("#scene").press("i"); return p; };
  const say = async (p, name) => console.log(name, await p.getByTestId("received").textContent(), "|", await p.getByTestId("coding").textContent());
  const a = await open();
  await a.waitForTimeout(25000);
  await say(a, "a"); await a.screenshot({ path: out + "/a0.png" });
  if (mode === "ours") {
    await a.getByTestId("target").fill(process.argv[5] ?? "100");
    for (let i = 1; i <= 6; ++i) { await a.waitForTimeout(3000); await say(a, "a" + i); await a.screenshot({ path: `${out}/a${i}.png` }); }
  } else if (mode === "two") {
    const b = await open();
    await b.waitForTimeout(4000);
    await say(b, "b before");
    await b.getByTestId("target").fill(process.argv[5] ?? "100");
    for (let i = 1; i <= 8; ++i) { await a.waitForTimeout(2500); await say(a, "a" + i); await say(b, "b" + i); await b.screenshot({ path: `${out}/b${i}.png` }); }
    await a.screenshot({ path: `${out}/a8.png` });
    await b.close();
    await a.waitForTimeout(4000); await say(a, "a alone");
  } else {
    for (let i = 1; i <= 4; ++i) { await a.waitForTimeout(3000); await say(a, "f" + i); await a.screenshot({ path: `${out}/f${i}.png` }); }
  }
} finally { await server.stop(); await browser.close(); }
