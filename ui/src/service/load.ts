/** Loading what a page shows, again and again if it changes or fails, and never after the page is left. */

import { useCallback, useContext, useEffect, useRef, useState } from "preact/hooks";
import { createContext } from "preact";
import { ConnectionFailed } from "urquhart-client";

import { isSignedOut } from "./api";

/** Told when a call finds that there is no session any more. */
export const SignedOut = createContext<() => void>(() => undefined);

export interface Loaded<T> {
  /** The last answer, also while a newer one is on its way or failed to come. */
  readonly data: T | undefined;
  readonly error: unknown;
  /** Whether the service cannot be reached at present. */
  readonly away: boolean;
  readonly reload: () => void;
}

const FIRST_PAUSE = 1;
const LONGEST_PAUSE = 20;

/**
 * What `load` returns. It is called again when one of `inputs` changes, every `every` seconds while the page is
 * visible, and with growing pauses while the service cannot be reached.
 */
export function useLoaded<T>(
  load: (signal: AbortSignal) => Promise<T>,
  inputs: readonly unknown[],
  every?: number | ((data: T) => number | undefined),
): Loaded<T> {
  const [state, setState] = useState<{ data?: T; error?: unknown; key: string }>({ key: "" });
  const [turn, setTurn] = useState(0);
  const signedOut = useContext(SignedOut);
  const failures = useRef(0);
  const key = JSON.stringify(inputs);
  const reload = useCallback(() => setTurn((before) => before + 1), []);

  useEffect(() => {
    const abort = new AbortController();
    let timer: ReturnType<typeof setTimeout> | undefined;
    const again = (seconds: number) => {
      timer = setTimeout(() => (document.hidden ? again(seconds) : reload()), seconds * 1000);
    };
    load(abort.signal).then(
      (data) => {
        failures.current = 0;
        setState({ data, key });
        const seconds = typeof every === "function" ? every(data) : every;
        if (seconds !== undefined) again(seconds);
      },
      (error: unknown) => {
        if (abort.signal.aborted) return;
        setState((before) => ({ ...(before.key === key && { data: before.data as T }), error, key }));
        if (isSignedOut(error)) signedOut();
        else if (error instanceof ConnectionFailed) {
          again(Math.min(FIRST_PAUSE * 2 ** failures.current++, LONGEST_PAUSE));
        }
      },
    );
    return () => {
      abort.abort();
      clearTimeout(timer);
    };
  }, [key, turn]);

  const current = state.key === key;
  return {
    data: current ? state.data : undefined,
    error: current ? state.error : undefined,
    away: current && state.error instanceof ConnectionFailed,
    reload,
  };
}
