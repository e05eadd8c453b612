/** The session: who is signed in, as the service says. */

import { call } from "./api";

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
  return (await (await call(PATH, signal ? { signal } : {})).json()) as Session;
}

/** Signs in with a key. Throws ProblemError if the service does not accept it. */
export async function beginSession(key: string): Promise<void> {
  await call(PATH, { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify({ key }) });
}

export async function endSession(): Promise<void> {
  await call(PATH, { method: "DELETE" });
}

/** Whether the session may do what needs this scope. */
export function may(session: Session, scope: "read" | "write" | "admin"): boolean {
  return session.scopes?.includes(scope) ?? false;
}
