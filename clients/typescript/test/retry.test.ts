import assert from "node:assert/strict";
import { test } from "node:test";

import { ConnectionFailed, createClient, NEVER, ok, ProblemError, type Retry } from "../src/index.js";
import { DEFAULT_RETRY, pause } from "../src/retry.js";

const QUICK: Retry = { ...DEFAULT_RETRY, first: 0.001, most: 0.002 };
const PAGE = { collections: [] };

/** A fetch that gives these answers, one after the other, and keeps what was sent. An Error fails the connection. */
function answering(...answers: (Response | Error)[]) {
  const sent: { request: Request; body: string }[] = [];
  const fetch = async (request: Request) => {
    sent.push({ request, body: await request.clone().text() });
    const answer = answers.shift();
    if (answer === undefined) throw new Error("one request too many");
    if (answer instanceof Error) throw answer;
    return answer;
  };
  return { sent, fetch };
}

function problem(status: number, headers: Record<string, string> = {}): Response {
  const body = { type: "/problems/overloaded", title: "Overloaded", status, detail: "Try again." };
  return new Response(JSON.stringify(body), {
    status,
    headers: { "content-type": "application/problem+json", ...headers },
  });
}

test("a failed connection and a passing refusal are repeated, with the same key and body", async () => {
  const { sent, fetch } = answering(new TypeError("gone"), problem(503), Response.json({ id: "plots" }, { status: 201 }));
  const client = createClient("http://host/", { fetch, retry: QUICK, key: "urq_a_b" });
  const made = await ok(
    client.PUT("/v1/collections/{collection}", { params: { path: { collection: "plots" } }, body: { title: "Plots" } }),
  );
  assert.equal(made.id, "plots");
  assert.equal(sent.length, 3);
  assert.equal(new Set(sent.map(({ request }) => request.headers.get("Idempotency-Key"))).size, 1);
  assert.deepEqual(new Set(sent.map(({ body }) => body)), new Set(['{"title":"Plots"}']));
  assert.equal(sent[0]?.request.headers.get("Authorization"), "Bearer urq_a_b");
  assert.equal(sent[0]?.request.url, "http://host/v1/collections/plots");
});

test("a refusal that is final is thrown at once, with its problem", async () => {
  const { sent, fetch } = answering(problem(404));
  const refused = await ok(createClient("http://host", { fetch }).GET("/v1/collections")).catch((error: unknown) => error);
  assert.ok(refused instanceof ProblemError);
  assert.deepEqual([refused.status, refused.slug, refused.message], [404, "overloaded", "Try again."]);
  assert.equal(sent.length, 1);
});

test("the client gives up after its attempts, with the last answer", async () => {
  const { sent, fetch } = answering(problem(503), problem(429), problem(503));
  const call = ok(createClient("http://host", { fetch, retry: { ...QUICK, attempts: 3 } }).GET("/v1/collections"));
  await assert.rejects(call, (error) => error instanceof ProblemError && error.status === 503);
  assert.equal(sent.length, 3);
});

test("a service that cannot be reached, and an answer of something else, are connections that failed", async () => {
  for (const answer of [new TypeError("gone"), new Response("<h1>Bad Gateway</h1>", { status: 502 })]) {
    const { fetch } = answering(answer);
    const call = ok(createClient("http://host", { fetch, retry: NEVER }).GET("/v1/collections"));
    await assert.rejects(call, ConnectionFailed);
  }
});

test("an aborted call ends at once, also in a pause, with the reason of its signal", async () => {
  const { sent, fetch } = answering(problem(503, { "retry-after": "30" }));
  const abort = new AbortController();
  const call = ok(createClient("http://host", { fetch }).GET("/v1/collections", { signal: abort.signal }));
  while (sent.length === 0) await new Promise((resolve) => setTimeout(resolve, 1));
  abort.abort(new Error("left the page"));
  await assert.rejects(call, /left the page/);
  assert.equal(sent.length, 1);
});

test("an attempt that takes too long is repeated", async () => {
  let attempts = 0;
  const connection = setInterval(() => undefined, 1000); // an open one keeps the process alive
  const fetch = (request: Request) =>
    ++attempts > 1
      ? Promise.resolve(Response.json(PAGE))
      : new Promise<Response>((_, reject) => {
          request.signal.addEventListener("abort", () => reject(request.signal.reason as Error));
        });
  await ok(createClient("http://host", { fetch, retry: QUICK, timeout: 0.01 }).GET("/v1/collections"));
  clearInterval(connection);
  assert.equal(attempts, 2);
});

test("pauses grow, honour Retry-After, and end at the deadline", () => {
  const least = (asked: number) => pause(DEFAULT_RETRY, { attempt: 1, elapsed: 0, status: 503, asked });
  assert.ok((least(3) ?? 0) >= 3);
  assert.equal(least(61), null);
  assert.equal(pause(DEFAULT_RETRY, { attempt: 1, elapsed: 0, status: 409 }), null);
  assert.notEqual(pause(DEFAULT_RETRY, { attempt: 1, elapsed: 0, status: 409, asked: 1 }), null);
  assert.equal(pause(DEFAULT_RETRY, { attempt: 7, elapsed: 0 }), null);
  assert.equal(pause(DEFAULT_RETRY, { attempt: 1, elapsed: 0, status: 422 }), null);
});
