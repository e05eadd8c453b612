/** The service as the console calls it: through the typed client, with the session's cookie. */

import { ConnectionFailed, createClient, DEFAULT_RETRY, ProblemError, problemOf } from "urquhart-client";

/** Only a page of this origin can set this header, so a request with it is no other site's. */
export const CONSOLE = { "Urquhart-Console": "1" };

/** Pages load again by themselves, so a call gives up soon. */
export const api = createClient(location.origin, {
  headers: CONSOLE,
  timeout: 30,
  retry: { ...DEFAULT_RETRY, attempts: 3 },
});

/**
 * What is not in the API's document: sessions, keys, metrics, binary columns. Throws ProblemError if the service refuses,
 * ConnectionFailed if it cannot be reached, and the reason of an aborted signal.
 */
export async function call(path: string, options: RequestInit = {}): Promise<Response> {
  let response: Response;
  try {
    response = await fetch(path, { ...options, headers: { ...CONSOLE, ...options.headers } });
  } catch (error) {
    if (error instanceof TypeError) throw new ConnectionFailed("The service cannot be reached.", { cause: error });
    throw error;
  }
  if (!response.ok) throw await problemOf(response);
  return response;
}

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
