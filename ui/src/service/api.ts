/** The service as the console calls it: through the typed client, with the session's cookie. */

import { createClient, DEFAULT_RETRY, ProblemError } from "urquhart-client";

/** Only a page of this origin can set this header, so a request with it is no other site's. */
export const CONSOLE = { "Urquhart-Console": "1" };

/** Pages load again by themselves, so a call gives up soon. */
export const api = createClient(location.origin, {
  headers: CONSOLE,
  timeout: 30,
  retry: { ...DEFAULT_RETRY, attempts: 3 },
});

/** What went wrong, in a sentence or two for people. */
export function sentenceOf(error: unknown): string {
  if (error instanceof ProblemError) {
    const fields = (error.problem.errors ?? []).slice(0, 5).map(({ detail }) => detail);
    const known = error.message;
    return [known, ...fields.filter((detail) => !known.includes(detail))].join(" ");
  }
  return error instanceof Error ? error.message : String(error);
}

/** Whether the service refused because there is no session, or none any more. */
export function isSignedOut(error: unknown): boolean {
  return error instanceof ProblemError && error.status === 401;
}
