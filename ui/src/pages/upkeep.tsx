/** What an operator keeps in order: snapshots, keys, and the limits in force. */

import type { ComponentChildren } from "preact";
import { useState } from "preact/hooks";
import { ok } from "urquhart-client";

import { Facts, Ready } from "../parts/common";
import { ago, bytes, count, moment, plural } from "../parts/text";
import { api, call, sentenceOf } from "../service/api";
import { useLoaded } from "../service/load";

const SELDOM = 60;

export function Panel({ title, children }: { readonly title: string; readonly children: ComponentChildren }) {
  return (
    <section class="panel">
      <h2>{title}</h2>
      {children}
    </section>
  );
}

export function Snapshots() {
  const loaded = useLoaded((signal) => ok(api.GET("/v1/snapshots", { signal })), [], SELDOM);
  const [busy, setBusy] = useState(false);
  const [refusal, setRefusal] = useState("");
  const make = async () => {
    setBusy(true);
    setRefusal("");
    try {
      await ok(api.POST("/v1/snapshots", { body: {} }));
      loaded.reload();
    } catch (error) {
      setRefusal(sentenceOf(error));
    }
    setBusy(false);
  };
  return (
    <Panel title="Snapshots">
      <p class="actions start">
        <button type="button" onClick={make} disabled={busy}>
          {busy ? "Copying …" : "Make a snapshot"}
        </button>
      </p>
      {refusal && (
        <p class="note bad" role="alert">
          {refusal}
        </p>
      )}
      <Ready of={loaded} what="the snapshots">
        {({ snapshots }) =>
          snapshots.length === 0 ? (
            <p class="meta">There is none. A snapshot is a copy of the whole database, to be kept elsewhere.</p>
          ) : (
            <>
              <ul class="plain">
                {snapshots.map((one) => (
                  <li key={one.name}>
                    <a href={`/v1/snapshots/${encodeURIComponent(one.name)}`} class="id">
                      {one.name}
                    </a>{" "}
                    {bytes(one.bytes)}, {plural(one.collections.length, "collection")}, <span title={moment(one.created)}>{ago(one.created)}</span>
                  </li>
                ))}
              </ul>
              <p class="meta">
                A link downloads the copy: keep it on another disk. To go back to one, stop the service, and call{" "}
                <code>urquhart snapshot restore NAME</code> on the host.
              </p>
            </>
          )
        }
      </Ready>
    </Panel>
  );
}

interface Key {
  readonly id: string;
  readonly name: string;
  readonly state: string;
  readonly scopes: readonly string[];
  readonly patterns: readonly string[];
  readonly created: string;
  readonly expires: string | null;
}

export function Keys() {
  const loaded = useLoaded(
    async (signal) => {
      return ((await (await call("/ui/keys", { signal })).json()) as { keys: Key[] }).keys;
    },
    [],
    SELDOM,
  );
  return (
    <Panel title="Keys">
      <p class="meta">
        Keys are made and revoked on the host: <code>urquhart keys create</code>, <code>urquhart keys revoke</code>. Their
        secrets are stored nowhere.
      </p>
      <Ready of={loaded} what="the keys">
        {(keys) =>
          keys.length === 0 ? (
            <p class="note warn">
              There is none, so the service asks for none: whoever reaches it may read and change everything.
            </p>
          ) : (
            <div class="scroll" tabIndex={0} role="region" aria-label="Table of keys">
              <table>
                <thead>
                  <tr>
                    <th scope="col">Name</th>
                    <th scope="col">Id</th>
                    <th scope="col">State</th>
                    <th scope="col">Scopes</th>
                    <th scope="col">Collections</th>
                    <th scope="col" class="number">Expires</th>
                  </tr>
                </thead>
                <tbody>
                  {keys.map((key) => (
                    <tr key={key.id}>
                      <td>{key.name}</td>
                      <td class="id">{key.id}</td>
                      <td>
                        <span class={`dot ${key.state === "usable" ? "good" : "bad"}`}>{key.state}</span>
                      </td>
                      <td>{key.scopes.join(", ")}</td>
                      <td class="id">{key.patterns.join(", ")}</td>
                      <td class="number">{key.expires === null ? "never" : moment(key.expires)}</td>
                    </tr>
                  ))}
                </tbody>
              </table>
            </div>
          )
        }
      </Ready>
    </Panel>
  );
}

/** A limit as the API says it, and bytes as people read them. */
const limit = (name: string, value: number) => (/(^|_)bytes$/.test(name) ? `${count(value)} (${bytes(value)})` : count(value));

export function LimitsTable() {
  const loaded = useLoaded((signal) => ok(api.GET("/v1/limits", { signal })), []);
  return (
    <details class="panel">
      <summary>Limits and versions</summary>
      <Ready of={loaded} what="the limits">
        {({ limits, versions, retention }) => (
          <>
            <p class="meta">
              <code>urquhart config --markdown</code> on the host says what each limit is, and how to change it.
            </p>
            <Facts
              rows={[
                ...Object.entries(versions).map(([name, value]) => [`version: ${name}`, String(value)] as const),
                ...Object.entries(limits).map(([name, value]) => [name.replaceAll("_", " "), limit(name, value)] as const),
                ...Object.entries(retention).map(([name, value]) => [`kept: ${name.replaceAll("_", " ")}`, count(value)] as const),
              ]}
            />
          </>
        )}
      </Ready>
    </details>
  );
}
