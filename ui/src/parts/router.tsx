/** Addresses: each page has its own, and the browser's buttons work. */

import type { ComponentChildren, JSX } from "preact";
import { useEffect, useState } from "preact/hooks";

export const ROOT = "/ui";

/** The present address below the root, and its parameters. */
export interface Address {
  readonly path: readonly string[];
  readonly query: URLSearchParams;
}

const EVENT = "addresschange";

/** Goes to an address below the root, such as `/collections/plots`. `replace`: without a step in the history. */
export function go(to: string, replace = false): void {
  history[replace ? "replaceState" : "pushState"](null, "", ROOT + to);
  dispatchEvent(new Event(EVENT));
}

/** Changes parameters of the present address, without a step in the history. Null removes one. */
export function setQuery(changes: Readonly<Record<string, string | null>>): void {
  const query = new URLSearchParams(location.search);
  for (const [name, value] of Object.entries(changes)) {
    if (value === null) query.delete(name);
    else query.set(name, value);
  }
  const text = query.toString();
  go(location.pathname.slice(ROOT.length) + (text && `?${text}`), true);
}

export function useAddress(): Address {
  const [address, setAddress] = useState(read);
  useEffect(() => {
    const changed = () => setAddress(read());
    addEventListener("popstate", changed);
    addEventListener(EVENT, changed);
    return () => {
      removeEventListener("popstate", changed);
      removeEventListener(EVENT, changed);
    };
  }, []);
  return address;
}

function read(): Address {
  const parts = location.pathname.slice(ROOT.length).split("/").filter(Boolean);
  return { path: parts.map(decoded), query: new URLSearchParams(location.search) };
}

function decoded(part: string): string {
  try {
    return decodeURIComponent(part);
  } catch (error) {
    if (error instanceof URIError) return part;
    throw error;
  }
}

/** The address of a page, with its parts encoded: `at("collections", "plots")`. */
export function at(...parts: readonly string[]): string {
  return `/${parts.map(encodeURIComponent).join("/")}`;
}

interface LinkProps extends Omit<JSX.AnchorHTMLAttributes<HTMLAnchorElement>, "href"> {
  readonly to: string;
  readonly children: ComponentChildren;
}

export function Link({ to, children, ...rest }: LinkProps) {
  const follow = (event: MouseEvent) => {
    if (event.metaKey || event.ctrlKey || event.shiftKey || event.button !== 0) return;
    event.preventDefault();
    go(to);
    scrollTo(0, 0);
  };
  return (
    <a {...rest} href={ROOT + to} onClick={follow}>
      {children}
    </a>
  );
}
