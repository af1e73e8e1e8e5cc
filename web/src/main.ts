import { isInPanel, isTyping } from "./controls.ts";
import { askedLayer } from "./layers.ts";
import { Overlay } from "./overlay.ts";
import { LockForm, Notice, Panel } from "./panels.ts";
import { RateSlider } from "./rate_slider.ts";
import { checkSupport } from "./support.ts";
import { installTestHook } from "./test_hook.ts";
import { sessionStorageOrNull, takeTokenFromAddress, TokenKeeper } from "./token.ts";
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

/** Wide enough for the legend beside the scene. */
const kRoomy = "(min-width: 700px) and (min-height: 500px)";

function connectButtons(viewer: Viewer): void {
  const overlay = new Overlay(element("overlay", HTMLElement), () => viewer.readings());
  const button = (id: string): HTMLButtonElement => element(id, HTMLButtonElement);
  const legend = new Panel(button("legend-toggle"), element("legend", HTMLElement));
  const numbers = new Panel(button("numbers"), element("overlay", HTMLElement), (isOpen) => overlay.setRunning(isOpen));
  const help = new Panel(button("keys"), element("help", HTMLElement));
  const switchMode = (): void => button("mode").setAttribute("aria-pressed", String(viewer.switchMode() === "walk"));
  const home = (): void => viewer.home();
  button("mode").addEventListener("click", switchMode);
  button("home").addEventListener("click", home);
  legend.setOpen(matchMedia(kRoomy).matches);
  const byKey: Readonly<Record<string, () => void>> = {
    KeyV: switchMode,
    Home: home,
    KeyR: home,
    KeyI: () => numbers.toggle(),
    KeyL: () => legend.toggle(),
    KeyH: () => help.toggle(),
    Escape: () => [legend, numbers, help].forEach((panel) => panel.setOpen(false)),
  };
  window.addEventListener("keydown", (event) => {
    const act = byKey[event.code];
    if (act === undefined || event.repeat || event.ctrlKey || event.altKey || event.metaKey || event.shiftKey) return;
    if (isTyping(event.target)) return;
    if (event.code === "Home" && isInPanel(event.target)) return;
    event.preventDefault();
    act();
  });
}

function followTheme(viewer: Viewer): void {
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const follow = (): void => viewer.setTheme(dark.matches ? "dark" : "light");
  dark.addEventListener("change", follow);
  follow();
}

/** The token of the address comes first: it must not stay there while the page starts. */
function takeTokens(viewerOf: () => Viewer | null): TokenKeeper {
  const tokens = new TokenKeeper(streamUrl(), sessionStorageOrNull());
  const take = (): void => {
    const token = takeTokenFromAddress();
    if (token === null) return;
    tokens.keep(token);
    viewerOf()?.unlock(token);
  };
  take();
  window.addEventListener("hashchange", take);
  return tokens;
}

async function main(): Promise<void> {
  let viewer: Viewer | null = null;
  const tokens = takeTokens(() => viewer);
  const message = element("message", HTMLElement);
  const say = (text: string): void => {
    message.textContent = text;
  };
  const support = await checkSupport();
  if (support.problems.length > 0) {
    say(`This page cannot show the scene here.\n${support.problems.join("\n")}`);
    return;
  }
  const scene = element("scene", HTMLCanvasElement);
  const lock = new LockForm(
    element("lock", HTMLFormElement), element("token", HTMLInputElement), element("lock-error", HTMLElement),
    element("unlock", HTMLButtonElement), scene, (token) => viewer?.unlock(token),
  );
  const notice = new Notice(element("notice", HTMLElement), element("notice-text", HTMLElement), element("dismiss", HTMLButtonElement));
  const rate = new RateSlider(
    element("rate", HTMLElement), element("target", HTMLInputElement), element("target-text", HTMLElement),
    (mbps) => viewer?.setTarget(mbps),
  );
  const query = new URLSearchParams(location.search);
  const checkPairs = query.get("check") === "pairs";
  viewer = new Viewer(
    scene,
    {
      url: streamUrl(),
      isSoftware: support.isSoftware,
      device: support.device,
      hold: query.get("hold") === "1",
      layer: askedLayer(query.get("layers")),
      showsGuesses: query.get("guessed") === "show",
      checkPairs,
      breakPairs: checkPairs && query.get("break") === "pairs",
    },
    tokens,
    {
      say,
      notice: (words) => notice.say(words),
      locked: (reason) => lock.show(reason),
      unlocked: () => lock.hide(),
      rate: (mostMbps) => rate.offer(mostMbps),
    },
  );
  installTestHook(viewer);
  connectButtons(viewer);
  followTheme(viewer);
  viewer.start();
}

main().catch((error: unknown) => {
  element("message", HTMLElement).textContent = `The viewer does not start: ${String(error)}`;
});
