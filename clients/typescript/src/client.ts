/** The client: every route of the service, typed from its OpenAPI document. */

import createFetch, { type Client as FetchClient } from "openapi-fetch";

import { problemOf } from "./problems.js";
import { DEFAULT_RETRY, type Retry, sendWithRetries, sleep } from "./retry.js";
import type { components, paths } from "./schema.js";

/** The types of all bodies, by their names in the reference: `Schemas["QueryAnswer"]`. */
export type Schemas = components["schemas"];

export interface Options {
  /** An API key, `urq_...`. Leave it out where the service needs none. */
  readonly key?: string;
  /** Seconds for each attempt of a request. */
  readonly timeout?: number;
  readonly retry?: Retry;
  /** Further headers of every request. */
  readonly headers?: Readonly<Record<string, string>>;
  /** Sends a request: `fetch`, or a replacement of it. */
  readonly fetch?: (request: Request) => Promise<Response>;
}

/** GET, PUT, POST, PATCH and DELETE of every path of the service. */
export type Client = FetchClient<paths>;

const DEFAULT_TIMEOUT = 60;

/**
 * A client of the service at `url`.
 *
 *     const client = createClient("http://127.0.0.1:8420");
 *     const answer = await ok(client.POST("/v1/collections/{collection}/queries", {
 *       params: { path: { collection: "plots" } },
 *       body: { xy: [[0.4, 2.9], [5.1, -1.7], [3.3, 4.0]] },
 *     }));
 *     if (answer.verdict === "matched") console.log(answer.candidates[0]?.submap_id);
 *
 * Calls throw ProblemError if the service refuses, ConnectionFailed if it cannot be reached, and the reason of their
 * `signal` once that is aborted. Failed requests are sent again, as `retry` says: every write has an Idempotency-Key,
 * so a repeated one is carried out once.
 */
export function createClient(url: string, options: Options = {}): Client {
  const send = options.fetch ?? ((request: Request) => globalThis.fetch(request));
  const retry = options.retry ?? DEFAULT_RETRY;
  const timeout = options.timeout ?? DEFAULT_TIMEOUT;
  const client = createFetch<paths>({
    baseUrl: url.replace(/\/+$/, ""),
    ...(options.headers && { headers: { ...options.headers } }),
    fetch: async (request: Request) => {
      if (options.key !== undefined) request.headers.set("Authorization", `Bearer ${options.key}`);
      if (request.method !== "GET" && !request.headers.has("Idempotency-Key")) {
        request.headers.set("Idempotency-Key", newKey());
      }
      const response = await sendWithRetries(request, send, retry, timeout);
      if (!response.ok && response.status !== 304) throw await problemOf(response);
      return response;
    },
  });
  return client;
}

/** The body of a successful answer. The calls of `createClient` throw for all others. */
export async function ok<T>(call: Promise<{ data?: T }>): Promise<NonNullable<T>> {
  const { data } = await call;
  if (data === undefined || data === null) throw new TypeError("The answer has no body.");
  return data;
}

/**
 * Every page of a list, one after the other.
 *
 *     for await (const page of pages((cursor) => ok(client.GET("/v1/collections", { params: { query: { cursor } } }))))
 */
export async function* pages<P extends { next?: string | null }>(
  read: (cursor: string | undefined) => Promise<P>,
): AsyncGenerator<P> {
  let cursor: string | undefined;
  do {
    const page: P = await read(cursor);
    yield page;
    cursor = page.next ?? undefined;
  } while (cursor !== undefined);
}

const FINAL = new Set(["successful", "failed", "dismissed"]);
const JOB_WAIT = 25;

/** Waits for the end of a job, and returns it. `seen` is called with every state on the way. */
export async function waitForJob(
  client: Client,
  id: string,
  seen: (job: Schemas["JobAnswer"]) => void = () => undefined,
  signal?: AbortSignal,
): Promise<Schemas["JobAnswer"]> {
  for (;;) {
    const asked = { params: { path: { job: id }, query: { wait: JOB_WAIT } }, ...(signal && { signal }) };
    const began = performance.now();
    const job = await ok(client.GET("/v1/jobs/{job}", asked));
    seen(job);
    if (FINAL.has(job.state)) return job;
    // A service with too many waiting callers answers at once.
    if (performance.now() - began < 1000) await sleep(1, signal);
  }
}

function newKey(): string {
  // crypto.randomUUID exists only in secure contexts, and a service without TLS on another machine is none.
  const bytes = crypto.getRandomValues(new Uint8Array(16));
  return Array.from(bytes, (byte) => byte.toString(16).padStart(2, "0")).join("");
}
