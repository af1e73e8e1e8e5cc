import { Overlay } from "./overlay.ts";
import { checkSupport } from "./support.ts";
import { installTestHook } from "./test_hook.ts";
import { Viewer } from "./viewer.ts";

function element<T extends HTMLElement>(id: string, kind: new () => T): T {
  const found = document.getElementById(id);
  if (!(found instanceof kind)) throw new Error(`the page has no ${id}`);
  return found;
}

function streamUrl(): string {
  const url = new URL("stream", location.href);
  url.protocol = location.protocol === "https:" ? "wss:" : "ws:";
  url.search = url.hash = "";
  return url.href;
}

function connectButtons(viewer: Viewer): void {
  const mode = element("mode", HTMLButtonElement);
  const help = element("help", HTMLElement);
  const overlay = new Overlay(element("overlay", HTMLElement), () => viewer.readings());
  const actions = {
    mode: () => {
      mode.textContent = viewer.switchMode() === "orbit" ? "Walk" : "Orbit";
    },
    home: () => viewer.home(),
    numbers: () => overlay.toggle(),
    keys: () => {
      help.hidden = !help.hidden;
    },
  };
  for (const [id, act] of Object.entries(actions)) element(id, HTMLButtonElement).addEventListener("click", act);
  const byKey: Readonly<Record<string, () => void>> = {
    Tab: actions.mode,
    Home: actions.home,
    KeyR: actions.home,
    KeyI: actions.numbers,
    KeyH: actions.keys,
  };
  window.addEventListener("keydown", (event) => {
    const act = byKey[event.code];
    if (act === undefined || event.repeat || event.ctrlKey || event.altKey || event.metaKey || event.shiftKey) return;
    event.preventDefault();
    act();
  });
}

async function main(): Promise<void> {
  const message = element("message", HTMLElement);
  const say = (text: string): void => {
    message.textContent = text;
  };
  const support = await checkSupport();
  if (support.problems.length > 0) {
    say(`This page cannot show the scene here.\n${support.problems.join("\n")}`);
    return;
  }
  const query = new URLSearchParams(location.search);
  const checkPairs = query.get("check") === "pairs";
  const viewer = new Viewer(
    element("scene", HTMLCanvasElement),
    {
      url: streamUrl(),
      isSoftware: support.isSoftware,
      device: support.device,
      hold: query.get("hold") === "1",
      checkPairs,
      breakPairs: checkPairs && query.get("break") === "pairs",
    },
    say,
  );
  installTestHook(viewer);
  connectButtons(viewer);
  viewer.start();
}

main().catch((error: unknown) => {
  element("message", HTMLElement).textContent = `The viewer does not start: ${String(error)}`;
});
