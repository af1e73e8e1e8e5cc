/** What this browser has, and what the viewer lacks in it, in words for the page. */
export interface Support {
  readonly problems: readonly string[];
  /** Name of the device that draws. */
  readonly device: string;
  readonly isSoftware: boolean;
}

function probeDevice(): string | null {
  const gl = document.createElement("canvas").getContext("webgl2");
  if (gl === null) return null;
  const names = gl.getExtension("WEBGL_debug_renderer_info");
  const device = String(gl.getParameter(names === null ? gl.RENDERER : names.UNMASKED_RENDERER_WEBGL));
  gl.getExtension("WEBGL_lose_context")?.loseContext();
  return device;
}

async function decodesH264(): Promise<boolean> {
  try {
    const answer = await VideoDecoder.isConfigSupported({ codec: "avc1.4d0028", optimizeForLatency: true });
    return answer.supported === true;
  } catch {
    return false;
  }
}

async function videoProblem(): Promise<string | null> {
  if (!window.isSecureContext)
    return "Video decoding (WebCodecs) needs a secure page: open it on the server itself as " +
      `http://127.0.0.1${location.port === "" ? "" : `:${location.port}`}, or use https.`;
  if (!("VideoDecoder" in window))
    return "This browser has no WebCodecs (VideoDecoder). Chrome or Edge 94, Safari 16.4, Firefox 130 and later have it.";
  if (!(await decodesH264())) return "This browser does not decode H.264 video.";
  return null;
}

export async function checkSupport(): Promise<Support> {
  const device = probeDevice();
  const problems: string[] = [];
  if (device === null)
    problems.push("This browser does not offer WebGL 2: switch on hardware acceleration, or update it.");
  const video = await videoProblem();
  if (video !== null) problems.push(video);
  if (!("WebAssembly" in window)) problems.push("WebAssembly is switched off in this browser.");
  if (!("Worker" in window)) problems.push("This browser does not offer web workers.");
  if (!("WebSocket" in window)) problems.push("This browser does not offer WebSockets.");
  return {
    problems,
    device: device ?? "none",
    isSoftware: device !== null && /swiftshader|llvmpipe|software|basic render/i.test(device),
  };
}
