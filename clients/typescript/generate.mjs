// Writes src/schema.ts from the service's OpenAPI document, which is read from standard input.
// With --print, prints it instead. `make client-types` runs this.

import { createHash } from "node:crypto";
import { writeFileSync } from "node:fs";
import { text } from "node:stream/consumers";
import openapiTS, { astToString } from "openapi-typescript";

const sent = await text(process.stdin);
const digest = createHash("sha256").update(sent).digest("hex");
const document = JSON.parse(sent);
simplify(document);
for (const path of Object.values(document.paths)) {
  for (const { requestBody, parameters } of Object.values(path)) withoutDefaults([requestBody, parameters]);
}
const types = astToString(await openapiTS(document, { alphabetize: true }));
const written = `/**
 * Types of the service's API. Generated from its OpenAPI document by \`make client-types\`: do not edit.
 *
 * openapi sha256 ${digest}
 */

${types}`;
if (process.argv.includes("--print")) process.stdout.write(written);
else writeFileSync(new URL("src/schema.ts", import.meta.url), written);

/** Leaves out examples and media types beside JSON, and lists the problem document once for each operation. */
function simplify(node) {
  if (Array.isArray(node)) return node.forEach(simplify);
  if (typeof node !== "object" || node === null) return;
  for (const path of Object.values(node.paths ?? {})) {
    for (const operation of Object.values(path)) {
      const statuses = Object.keys(operation.responses ?? {});
      const problem = statuses.map((status) => operation.responses[status]).find(isProblem);
      for (const status of statuses) {
        const { content } = operation.responses[status];
        if (isProblem(operation.responses[status])) delete operation.responses[status];
        // Whoever asks for another type reads text or bytes (`parseAs`), which needs no type from here.
        else if (content?.["application/json"]) operation.responses[status].content = { "application/json": content["application/json"] };
      }
      if (problem) operation.responses.default = { ...problem, description: "A problem document." };
    }
  }
  for (const [name, value] of Object.entries(node)) {
    if (name === "example" || name === "examples") delete node[name];
    // openapi-fetch turns the tuples of answers into lists, which then are not what a schema's own type says.
    else if (name === "prefixItems") {
      node.items = value[0];
      delete node.prefixItems;
      simplify(node.items);
    }
    else if (name === "properties") Object.values(value).forEach(simplify);
    else simplify(value);
  }
}

/** Leaves out defaults of what is sent: a member with one may be left out. What the service answers has it always. */
function withoutDefaults(node, seen = new Set()) {
  if (typeof node !== "object" || node === null || seen.has(node)) return;
  seen.add(node);
  delete node.default;
  if (node.$ref) withoutDefaults(document.components.schemas[node.$ref.split("/").at(-1)], seen);
  Object.values(node).forEach((value) => withoutDefaults(value, seen));
}

function isProblem(response) {
  return "application/problem+json" in (response.content ?? {});
}
