// Against a service without keys at URQUHART_TEST_URL, which tests/client/test_typescript.py starts.

import assert from "node:assert/strict";
import { test } from "node:test";

import { createClient, ok, pages, ProblemError, waitForJob } from "../src/index.js";

const url = process.env.URQUHART_TEST_URL;
const only = url === undefined ? { skip: "URQUHART_TEST_URL names no service" } : {};
const client = createClient(url ?? "http://127.0.0.1:1");
const plots = { path: { collection: "typed" } };

/** Positions in a forest of 30 m by 30 m that is the same at every run. */
function forest(count: number): [number, number][] {
  let state = 7;
  const draw = () => (state = (state * 16807) % 2147483647) / 2147483647;
  return Array.from({ length: count }, () => [30 * draw(), 30 * draw()]);
}

test("a collection, a submap, and a query that finds it", only, async () => {
  await ok(client.PUT("/v1/collections/{collection}", { params: plots, body: { title: "Typed" } }));
  const xy = forest(60);
  const path = { collection: "typed", submap: "p7" };
  await ok(client.PUT("/v1/collections/{collection}/submaps/{submap}", { params: { path }, body: { xy } }));
  const seen = xy.map(([x, y]): [number, number] => [-y + 2, x - 3]);
  const answer = await ok(
    client.POST("/v1/collections/{collection}/queries", { params: plots, body: { xy: seen, store: true } }),
  );
  assert.equal(answer.verdict, "matched");
  assert.equal(answer.candidates[0]?.submap_id, "p7");
  const query = answer.id ?? "";
  const again = await ok(
    client.GET("/v1/collections/{collection}/queries/{query}", { params: { path: { collection: "typed", query } } }),
  );
  assert.deepEqual(again.candidates, answer.candidates);
});

test("bad input is a problem that names the member", only, async () => {
  const call = ok(client.POST("/v1/collections/{collection}/queries", { params: plots, body: { xy: [], seed: -1 } }));
  await assert.rejects(call, (error) => {
    assert.ok(error instanceof ProblemError);
    assert.equal(error.status, 422);
    assert.equal(error.slug, "invalid-request");
    return Boolean(error.problem.errors?.length);
  });
});

test("pages follow each other", only, async () => {
  const lines = forest(12).map(([x, y], at) => JSON.stringify({ id: `s${at}`, xy: [[x, y], [x + 4, y], [x, y + 7]] }));
  const imported = await client.POST("/v1/collections/{collection}/imports", {
    params: plots,
    body: `${lines.join("\n")}\n`,
    bodySerializer: (body) => body,
    headers: { "Content-Type": "application/x-ndjson" },
  });
  const seen: string[] = [];
  const job = await waitForJob(client, imported.data?.id ?? "", ({ state }) => seen.push(state));
  assert.equal(job.state, "successful");
  assert.equal(seen.at(-1), "successful");
  const ids: string[] = [];
  const read = (cursor?: string) =>
    ok(
      client.GET("/v1/collections/{collection}/submaps", {
        params: { ...plots, query: { limit: 5, ...(cursor !== undefined && { cursor }) } },
      }),
    );
  for await (const page of pages(read)) ids.push(...page.submaps.map(({ id }) => id));
  assert.equal(new Set(ids).size, 13);
});

test("a collection that does not exist is not found, and deleting has no body", only, async () => {
  await assert.rejects(
    ok(client.GET("/v1/collections/{collection}", { params: { path: { collection: "none" } } })),
    (error) => error instanceof ProblemError && error.slug === "not-found",
  );
  const { response } = await client.DELETE("/v1/collections/{collection}", { params: plots });
  assert.equal(response.status, 204);
});
