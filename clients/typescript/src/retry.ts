/** Retries: requests that failed and are safe to repeat are sent again a few times, with growing pauses. */

import { ConnectionFailed, retryAfter } from "./problems.js";

/** How often and how long to try. The defaults outlast a restart of the service: about eight seconds. */
export interface Retry {
  /** Requests sent for one call at most; 1 never repeats. */
  readonly attempts: number;
  /** Seconds before the second request, at most: the pause is drawn from 0 to this, which doubles each time. */
  readonly first: number;
  /** Seconds that this grows to. */
  readonly most: number;
  /** Seconds for all attempts and pauses of a call; none is begun later. */
  readonly deadline: number;
}

export const DEFAULT_RETRY: Retry = { attempts: 7, first: 0.25, most: 10, deadline: 60 };
export const NEVER: Retry = { ...DEFAULT_RETRY, attempts: 1 };

const PASSING = new Set([408, 429, 502, 503, 504]);
const CONFLICT = 409;

/** What is known of a failed attempt. */
export interface Failure {
  /** How many attempts were made. */
  readonly attempt: number;
  /** Seconds since the first one began. */
  readonly elapsed: number;
  /** Status of the answer; undefined if the connection failed. */
  readonly status?: number | undefined;
  /** Seconds that the answer asked to wait. */
  readonly asked?: number | undefined;
}

/** Seconds to wait before the next attempt, or null to give up. */
export function pause(retry: Retry, failure: Failure): number | null {
  const { attempt, elapsed, status, asked } = failure;
  // 409 has Retry-After if the first attempt is still in progress. Otherwise it is final.
  const passing = status === undefined || PASSING.has(status) || (status === CONFLICT && asked !== undefined);
  if (attempt >= retry.attempts || !passing) return null;
  // All robots of a fleet lose a service at the same moment, but must not come back at the same moment.
  const drawn = Math.random() * Math.min(retry.first * 2 ** (attempt - 1), retry.most);
  const seconds = asked === undefined ? drawn : asked + drawn;
  return elapsed + seconds < retry.deadline ? seconds : null;
}

/**
 * Sends a request until it is answered, `retry` gives up, or its signal is aborted.
 *
 * The caller has made the request safe to repeat. `timeout`: seconds for each attempt. Returns the last answer, which
 * may be an error. Throws ConnectionFailed if none came, and the signal's reason if it was aborted.
 */
export async function sendWithRetries(
  request: Request,
  send: (request: Request) => Promise<Response>,
  retry: Retry,
  timeout: number,
): Promise<Response> {
  const began = performance.now();
  for (let attempt = 1; ; attempt++) {
    const outcome = await attemptOf(request.clone(), send, timeout);
    const response = outcome instanceof Response ? outcome : undefined;
    if (response?.ok) return response;
    const seconds = pause(retry, {
      attempt,
      elapsed: (performance.now() - began) / 1000,
      status: response?.status,
      asked: response && retryAfter(response),
    });
    if (seconds === null) {
      if (outcome instanceof Response) return outcome;
      throw new ConnectionFailed(`The service cannot be reached: ${outcome.message}`, { cause: outcome });
    }
    await response?.body?.cancel();
    await sleep(seconds, request.signal);
  }
}

async function attemptOf(
  request: Request,
  send: (request: Request) => Promise<Response>,
  timeout: number,
): Promise<Response | Error> {
  const signal = AbortSignal.any([request.signal, AbortSignal.timeout(timeout * 1000)]);
  try {
    return await send(new Request(request, { signal }));
  } catch (error) {
    request.signal.throwIfAborted();
    // fetch rejects with a TypeError if the connection fails, and with a TimeoutError at the end of the time.
    if (error instanceof TypeError || (error instanceof DOMException && error.name === "TimeoutError")) return error;
    throw error;
  }
}

/** Waits. Throws the signal's reason as soon as it is aborted. */
export function sleep(seconds: number, signal?: AbortSignal): Promise<void> {
  return new Promise((resolve, reject) => {
    if (signal?.aborted) return reject(signal.reason);
    const abort = () => {
      clearTimeout(timer);
      reject(signal?.reason);
    };
    const timer = setTimeout(() => {
      signal?.removeEventListener("abort", abort);
      resolve();
    }, seconds * 1000);
    signal?.addEventListener("abort", abort, { once: true });
  });
}
