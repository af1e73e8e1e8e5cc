import { defineConfig, type Plugin } from "vite";

/** Draco's loader asks for files only under Node. */
const withoutFiles: Plugin = {
  name: "without-files",
  enforce: "pre",
  resolveId: (id) => (id === "node:fs" || id === "fs" || id === "path" ? "\0no-files" : null),
  load: (id) => (id === "\0no-files" ? "export default {};" : null),
};

export default defineConfig({
  base: "./",
  build: { target: "es2022", chunkSizeWarningLimit: 1000, assetsInlineLimit: 0 },
  server: { proxy: { "/stream": { target: "ws://127.0.0.1:8080", ws: true } } },
  worker: { format: "es", plugins: () => [withoutFiles] },
});
