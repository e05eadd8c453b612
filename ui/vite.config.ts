import { defineConfig } from "vite";

import { recordSources } from "./record-sources.mjs";

export default defineConfig({
  base: "/ui/",
  esbuild: { jsx: "automatic", jsxImportSource: "preact" },
  resolve: { conditions: ["source"] },
  build: {
    outDir: "../server/console/assets",
    assetsDir: "files",
    emptyOutDir: true,
    target: "es2022",
    // Pictures as data: URLs and inline scripts are not allowed by the page's content security policy.
    assetsInlineLimit: 0,
    modulePreload: { polyfill: false },
  },
  plugins: [recordSources()],
  server: { proxy: { "/v1": "http://127.0.0.1:8420", "/ui/session": "http://127.0.0.1:8420" } },
});
