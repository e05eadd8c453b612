/** The session: who is signed in, as the service says. */

import { type Problem, ProblemError } from "urquhart-client";

import { CONSOLE } from "./api";

/** What the service says of this browser's session. */
export interface Session {
  readonly version: string;
  readonly needs_key: boolean;
  readonly signed_in: boolean;
  /** Why a session that this browser has is not accepted any more. */
  readonly refusal?: string | null;
  readonly key?: string | null;
  readonly scopes?: readonly string[];
  readonly patterns?: readonly string[];
  readonly ends?: string | null;
}

const PATH = "/ui/session";

export async function readSession(signal?: AbortSignal): Promise<Session> {
  const response = await fetch(PATH, { headers: CONSOLE, ...(signal && { signal }) });
  if (!response.ok) throw await problem(response);
  return (await response.json()) as Session;
}

/** Signs in with a key. Throws ProblemError if the service does not accept it. */
export async function beginSession(key: string): Promise<void> {
  const response = await fetch(PATH, {
    method: "POST",
    headers: { ...CONSOLE, "Content-Type": "application/json" },
    body: JSON.stringify({ key }),
  });
  if (!response.ok) throw await problem(response);
}

export async function endSession(): Promise<void> {
  const response = await fetch(PATH, { method: "DELETE", headers: CONSOLE });
  if (!response.ok) throw await problem(response);
}

/** Whether the session may do what needs this scope. */
export function may(session: Session, scope: "read" | "write" | "admin"): boolean {
  return session.scopes?.includes(scope) ?? false;
}

async function problem(response: Response): Promise<Error> {
  const isProblem = response.headers.get("content-type")?.includes("problem+json");
  if (isProblem) return new ProblemError((await response.json()) as Problem);
  return new Error(`The service answered ${response.status}.`);
}
