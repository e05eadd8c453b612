/** What the service refuses, and what happens when it cannot be reached. */

import type { components } from "./schema.js";

/** A problem document (RFC 9457), as the service sends it. */
export type Problem = components["schemas"]["Problem"];

/** The service refused the request. `problem` says what is wrong and, for bad input, where. */
export class ProblemError extends Error {
  override readonly name = "ProblemError";

  constructor(
    readonly problem: Problem,
    /** Seconds after which the service asked to try again; undefined if it did not. */
    readonly retryAfter?: number,
  ) {
    super(problem.detail ?? problem.title);
  }

  /** The status of the answer. */
  get status(): number {
    return this.problem.status;
  }

  /** The last part of the problem's type, such as `not-found`: stable, for programs. */
  get slug(): string {
    return this.problem.type.split("/").at(-1) ?? "";
  }
}

/** No answer came: the connection failed each time that the request was sent, or the answer is not the service's. */
export class ConnectionFailed extends Error {
  override readonly name = "ConnectionFailed";
}

/** The problem of an answer that is not a success. An answer without a problem document is described by its status. */
export async function problemOf(response: Response): Promise<ProblemError | ConnectionFailed> {
  const type = response.headers.get("content-type") ?? "";
  const text = await response.text();
  if (type.includes("json")) {
    const read = parsed(text);
    if (read !== null) return new ProblemError(read, retryAfter(response));
  }
  const shown = text.slice(0, 200).trim();
  return new ConnectionFailed(
    `The answer ${response.status} is not from the service, but perhaps from a proxy before it${shown && `: ${shown}`}`,
  );
}

function parsed(text: string): Problem | null {
  try {
    const read: unknown = JSON.parse(text);
    const isProblem = typeof read === "object" && read !== null && "status" in read && "type" in read && "title" in read;
    return isProblem ? (read as Problem) : null;
  } catch (error) {
    if (error instanceof SyntaxError) return null;
    throw error;
  }
}

/** Seconds that the header Retry-After asks to wait; undefined if it is missing or is a date. */
export function retryAfter(response: Response): number | undefined {
  const header = response.headers.get("retry-after");
  return header !== null && /^\d+(\.\d+)?$/.test(header) ? Number(header) : undefined;
}
