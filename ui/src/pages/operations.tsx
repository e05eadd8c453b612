/** Operations: how the service does now: readiness, load, latencies, verdicts, index, keys, snapshots, limits. */

import { useState } from "preact/hooks";
import { ok, ProblemError, type Schemas } from "urquhart-client";

import { Facts, Ready, SaidAbove, Title } from "../parts/common";
import { at, Link } from "../parts/router";
import { count, duration, share } from "../parts/text";
import { api, sentenceOf } from "../service/api";
import { useLoaded } from "../service/load";
import { readMetrics, type Sample, valueOf } from "../service/metrics";
import { may, type Session } from "../service/session";
import { IndexState } from "./collections";
import { QueryCharts, QueueChart } from "./load-charts";
import { Keys, LimitsTable, Panel, Snapshots } from "./upkeep";

const EVERY = 5;

export function OperationsPage({ session }: { readonly session: Session }) {
  const seesAll = session.patterns?.includes("*") ?? false;
  const admin = may(session, "admin") && seesAll;
  const now = useLoaded(readState, [], EVERY);
  return (
    <main class="page">
      <Title>Operations</Title>
      <header class="page-head">
        <h1>Operations</h1>
      </header>
      <Ready of={now} what="the state">
        {(state) => (
          <>
            <Now state={state} />
            <SaidAbove.Provider value={true}>
              {seesAll && may(session, "read") ? (
                <Numbers />
              ) : (
                <p class="note warn">Latencies and verdicts cover all collections, so they need a key with the scope read for all of them.</p>
              )}
              {admin ? (
                <>
                  <Snapshots />
                  <Keys />
                </>
              ) : (
                <p class="note warn">Snapshots and keys need a key with the scope admin for all collections.</p>
              )}
              {may(session, "read") && <LimitsTable />}
            </SaidAbove.Provider>
          </>
        )}
      </Ready>
    </main>
  );
}

interface State {
  readonly ready: Schemas["Readiness"] | null;
  readonly trouble: string | null;
}

async function readState(signal: AbortSignal): Promise<State> {
  try {
    return { ready: await ok(api.GET("/readyz", { signal })), trouble: null };
  } catch (error) {
    if (error instanceof ProblemError && error.status === 503) return { ready: null, trouble: sentenceOf(error) };
    throw error;
  }
}

function Now({ state: { ready, trouble } }: { readonly state: State }) {
  return (
    <Panel title="Now">
      {ready === null ? (
        <p class="dot bad">Not ready: {trouble}</p>
      ) : (
        <>
          <p class="dot good">Ready</p>
          <Facts
            rows={[
              ["In progress", `${ready.load.in_flight} of ${ready.load.capacity} places`],
              ["Waiting", count(ready.load.queued)],
              ...Object.entries(ready.checks).map(([name, state]) => [name, state] as const),
            ]}
          />
          <QueueChart load={ready.load} />
          {ready.load.saturated && <p class="note warn">All places are taken: further requests wait for their turn.</p>}
        </>
      )}
    </Panel>
  );
}

function Numbers() {
  const loaded = useLoaded(readMetrics, [], EVERY);
  return (
    <Ready of={loaded} what="the metrics">
      {(samples) => (
        <>
          <Panel title="Verdicts since the start">
            <p class="meta">Of all queries of this process, with those of its jobs.</p>
            <Verdicts samples={samples} />
            <QueryCharts samples={samples} />
          </Panel>
          <Panel title="How long requests take">
            <Latencies samples={samples} />
          </Panel>
          <Panel title="Index">
            <Indexes samples={samples} />
          </Panel>
        </>
      )}
    </Ready>
  );
}

function Verdicts({ samples }: { readonly samples: readonly Sample[] }) {
  const verdicts = ["matched", "ambiguous", "no_match"].map((verdict) => {
    const matching = samples.filter((one) => one.name === "urquhart_query_verdicts_total" && one.labels.verdict === verdict);
    return [verdict, matching.reduce((sum, one) => sum + one.value, 0)] as const;
  });
  const total = verdicts.reduce((sum, [, value]) => sum + value, 0);
  if (total === 0) return <p class="meta">No query was answered yet.</p>;
  return (
    <ul class="stages">
      {verdicts.map(([verdict, value]) => (
        <li key={verdict}>
          <span>{verdict.replace("_", " ")}</span>
          <span class="bar" aria-hidden="true">
            <i class={verdict} style={{ width: `${(100 * value) / total}%` }} />
          </span>
          <span class="number">
            {count(value)} · {share(value / total)}
          </span>
        </li>
      ))}
    </ul>
  );
}

interface Route {
  readonly name: string;
  readonly requests: number;
  readonly mean: number;
  readonly quantiles: readonly string[];
}

const QUANTILES = [0.5, 0.95, 0.99];

function Latencies({ samples }: { readonly samples: readonly Sample[] }) {
  const [all, setAll] = useState(false);
  const routes = routesOf(samples);
  const shown = all ? routes : routes.slice(0, 8);
  return (
    <>
      <div class="scroll" tabIndex={0} role="region" aria-label="Table of latencies">
        <table>
          <thead>
            <tr>
              <th scope="col">Route</th>
              <th scope="col" class="number">Requests</th>
              <th scope="col" class="number">Mean</th>
              {QUANTILES.map((one) => (
                <th scope="col" class="number" key={one}>
                  {share(one)} within
                </th>
              ))}
            </tr>
          </thead>
          <tbody>
            {shown.map((route) => (
              <tr key={route.name}>
                <td class="id">{route.name}</td>
                <td class="number">{count(route.requests)}</td>
                <td class="number">{duration(1000 * route.mean)}</td>
                {route.quantiles.map((value, index) => (
                  <td class="number" key={QUANTILES[index]}>
                    {value}
                  </td>
                ))}
              </tr>
            ))}
          </tbody>
        </table>
      </div>
      {routes.length > 8 && (
        <button type="button" class="quiet" onClick={() => setAll(!all)}>
          {all ? "Show fewer" : `Show all ${routes.length}`}
        </button>
      )}
    </>
  );
}

/** Routes with most requests first. A quantile is the upper end of the bucket that it falls into. */
function routesOf(samples: readonly Sample[]): Route[] {
  const grouped = new Map<string, Sample[]>();
  for (const one of samples) {
    const { method, route } = one.labels;
    if (!one.name.startsWith("urquhart_request_seconds_") || route === undefined || route.startsWith("/ui")) continue;
    const name = `${method} ${route}`;
    grouped.set(name, [...(grouped.get(name) ?? []), one]);
  }
  const routes = [...grouped].map(([name, group]): Route => {
    const requests = valueOf(group, "urquhart_request_seconds_count") ?? 0;
    const mean = (valueOf(group, "urquhart_request_seconds_sum") ?? 0) / Math.max(requests, 1);
    const buckets = group.filter((one) => one.name === "urquhart_request_seconds_bucket");
    const quantiles = QUANTILES.map((quantile) => {
      const bucket = buckets.find((one) => one.value >= quantile * requests);
      const end = Number(bucket?.labels.le);
      return Number.isFinite(end) ? duration(1000 * end) : "longer";
    });
    return { name, requests, mean, quantiles };
  });
  return routes.filter(({ requests }) => requests > 0).sort((one, other) => other.requests - one.requests);
}

function Indexes({ samples }: { readonly samples: readonly Sample[] }) {
  const held = samples.filter((one) => one.name === "urquhart_index_lag_revisions");
  if (held.length === 0) return <p class="meta">No index is open: each opens at the first query of its collection.</p>;
  return (
    <>
      <ul class="plain">
        {held.map(({ labels }) => (
          <li key={labels.collection}>
            <Link to={at("collections", labels.collection ?? "")} class="id">
              {labels.collection}
            </Link>{" "}
            <IndexState collection={labels.collection ?? ""} samples={samples} />
          </li>
        ))}
      </ul>
      <p class="meta">
        A query always sees every write that came before it: it catches up first. The index of a collection that is not
        listed opens at its first query.
      </p>
    </>
  );
}
