/** Small parts that pages share: messages, numbers, tabs, copying. */

import { type ComponentChildren, createContext } from "preact";
import { useContext, useEffect, useRef, useState } from "preact/hooks";

import { sentenceOf } from "../service/api";
import type { Loaded } from "../service/load";
import { setQuery } from "./router";

export function Title({ children }: { readonly children: string }) {
  useEffect(() => {
    document.title = `${children} · Urquhart`;
  }, [children]);
  return null;
}

/** What a page shows instead of its contents: what is the matter, and what to do. */
export function Message(props: {
  readonly kind?: "empty" | "error";
  readonly title: string;
  readonly children?: ComponentChildren;
}) {
  return (
    <div class={`message ${props.kind ?? "empty"}`} role={props.kind === "error" ? "alert" : undefined}>
      <h2>{props.title}</h2>
      {props.children}
    </div>
  );
}

/** Whether the page says in one place that the service cannot be reached, so that its parts need not. */
export const SaidAbove = createContext(false);

/** The contents once they are loaded, and before that what is in the way. */
export function Ready<T>(props: {
  readonly of: Loaded<T>;
  readonly what: string;
  readonly children: (data: T) => ComponentChildren;
}) {
  const { data, error, away, reload } = props.of;
  const saidAbove = useContext(SaidAbove);
  if (away && data === undefined && saidAbove) return <Loading what={props.what} />;
  return (
    <>
      {data !== undefined && away && !saidAbove && <Away />}
      {data !== undefined && props.children(data)}
      {data !== undefined && error !== undefined && !away && (
        <p class="note bad" role="alert">
          {sentenceOf(error)}
        </p>
      )}
      {data === undefined && error === undefined && <Loading what={props.what} />}
      {data === undefined && error !== undefined && (
        <Message kind="error" title={away ? "The service cannot be reached" : `${capital(props.what)} cannot be shown`}>
          <p>{away ? "This page tries again by itself and goes on when the service is back." : sentenceOf(error)}</p>
          <button type="button" onClick={reload}>
            Try again
          </button>
        </Message>
      )}
    </>
  );
}

function Away() {
  return (
    <p class="note warn" role="status">
      The service cannot be reached. What is shown is what it said last; the page tries again by itself.
    </p>
  );
}

/** Shown only after a moment, because most answers come sooner. */
function Loading({ what }: { readonly what: string }) {
  return (
    <p class="loading" role="status">
      Loading {what} …
    </p>
  );
}

const capital = (text: string) => text.charAt(0).toUpperCase() + text.slice(1);

/** Names and values, one under the other. */
export function Facts({ rows }: { readonly rows: readonly (readonly [string, ComponentChildren, string?])[] }) {
  return (
    <dl class="facts">
      {rows.map(([name, value, hint]) => (
        <div key={name} title={hint}>
          <dt>{name}</dt>
          <dd>{value}</dd>
        </div>
      ))}
    </dl>
  );
}

/** The buttons below a page of a list, whose cursor is in the address. */
export function Pager(props: {
  readonly cursor: string | null;
  readonly next: string | null | undefined;
  readonly first: string;
  readonly more: string;
}) {
  const { cursor, next, first, more } = props;
  return (
    <p class="actions">
      {cursor && (
        <button type="button" class="quiet" onClick={() => setQuery({ cursor: null })}>
          {first}
        </button>
      )}
      {next && (
        <button type="button" class="quiet" onClick={() => setQuery({ cursor: next })}>
          {more}
        </button>
      )}
    </p>
  );
}

/** A row of choices of which one holds. */
export function Choices<T extends string>(props: {
  readonly label: string;
  readonly value: T;
  readonly options: readonly (readonly [T, string])[];
  readonly onChange: (value: T) => void;
}) {
  return (
    <div class="choices" role="group" aria-label={props.label}>
      {props.options.map(([value, name]) => (
        <button
          key={value}
          type="button"
          aria-pressed={value === props.value}
          onClick={() => props.onChange(value)}
        >
          {name}
        </button>
      ))}
    </div>
  );
}

export function CopyButton({ text, children }: { readonly text: string; readonly children: string }) {
  const [said, setSaid] = useState("");
  const copy = async () => {
    try {
      await navigator.clipboard.writeText(text);
      setSaid("Copied");
    } catch (error) {
      // Browsers allow this only over TLS or on this machine.
      setSaid(error instanceof Error ? "Not allowed here" : "Failed");
    }
    setTimeout(() => setSaid(""), 2000);
  };
  return (
    <button type="button" class="quiet" onClick={copy}>
      {said || children}
    </button>
  );
}

/** A dialog over the page. Escape and a click beside it close it. */
export function Dialog(props: {
  readonly title: string;
  readonly onClose: () => void;
  readonly children: ComponentChildren;
}) {
  const dialog = useRef<HTMLDialogElement>(null);
  useEffect(() => dialog.current?.showModal(), []);
  return (
    <dialog
      ref={dialog}
      aria-labelledby="dialog-title"
      onClose={props.onClose}
      onClick={(event) => event.target === dialog.current && props.onClose()}
    >
      <h2 id="dialog-title">{props.title}</h2>
      {props.children}
    </dialog>
  );
}
