// Writes build.json beside the built files: a hash of all that they were built from. A test of the service's compares it,
// so built files that are older than their sources are noticed where there is no node, too.

import { createHash } from "node:crypto";
import { readdirSync, readFileSync } from "node:fs";
import { join, relative } from "node:path";
import { fileURLToPath } from "node:url";

const root = fileURLToPath(new URL("..", import.meta.url));
const SOURCES = ["ui", "clients/typescript/src", "package-lock.json"];

/** A plugin of vite. */
export function recordSources() {
  return {
    name: "record-sources",
    apply: "build",
    generateBundle() {
      const source = `${JSON.stringify({ sources: digestOfSources() })}\n`;
      this.emitFile({ type: "asset", fileName: "build.json", source });
    },
  };
}

/** SHA-256 over the names and contents of all sources, in the order of their names. */
export function digestOfSources() {
  const hash = createHash("sha256");
  for (const path of SOURCES.flatMap((source) => filesIn(join(root, source))).map((path) => relative(root, path)).sort()) {
    hash.update(`${path}\0`);
    hash.update(readFileSync(join(root, path)));
    hash.update("\0");
  }
  return hash.digest("hex");
}

function filesIn(path) {
  try {
    const entries = readdirSync(path, { withFileTypes: true });
    return entries.filter(({ name }) => name !== "node_modules").flatMap(({ name }) => filesIn(join(path, name)));
  } catch (error) {
    if (error.code === "ENOTDIR") return [path];
    throw error;
  }
}
