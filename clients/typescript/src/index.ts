/** The typed TypeScript client of Urquhart, a place-recognition database for forests. */

export { type Client, createClient, ok, type Options, pages, type Schemas, waitForJob } from "./client.js";
export { ConnectionFailed, type Problem, ProblemError, problemOf } from "./problems.js";
export { DEFAULT_RETRY, NEVER, type Retry } from "./retry.js";
export type { components, operations, paths } from "./schema.js";
