/** All collections: how much they hold, whether the index is up to date, and how to make or delete one. */

import { useState } from "preact/hooks";
import { ok, pages, type Schemas } from "urquhart-client";

import { Dialog, Message, Ready, Title } from "../parts/common";
import { at, go, Link } from "../parts/router";
import { ago, count, moment, OVERLAP, plural } from "../parts/text";
import { api, sentenceOf } from "../service/api";
import { useLoaded } from "../service/load";
import { readMetrics, type Sample, valueOf } from "../service/metrics";
import { may, type Session } from "../service/session";

type Summary = Schemas["CollectionSummary"];

const MOST = 1000;
const EVERY = 5;

export function CollectionsPage({ session }: { readonly session: Session }) {
  const loaded = useLoaded(
    async (signal) => {
      const seesAll = session.patterns?.includes("*") ?? false;
      const [collections, samples] = await Promise.all([listed(signal), seesAll ? readMetrics(signal) : []]);
      return { collections, samples };
    },
    [],
    EVERY,
  );
  const [making, setMaking] = useState(false);
  return (
    <main class="page">
      <Title>Collections</Title>
      <header class="page-head">
        <h1>Collections</h1>
        {may(session, "admin") && (
          <button type="button" class="primary" onClick={() => setMaking(true)}>
            New collection
          </button>
        )}
      </header>
      <Ready of={loaded} what="the collections">
        {({ collections, samples }) =>
          collections.length === 0 ? (
            <Message title="No collections yet">
              <p>
                A collection holds submaps: the trees of one plot or of one stretch of a drive each. Make one, then drop
                a stem map at <Link to="/try">Try it</Link>, or send submaps to the <a href="/docs">API</a>.
              </p>
              {!may(session, "admin") && <p>Your key may not make collections: that needs the scope admin.</p>}
            </Message>
          ) : (
            <ul class="cards">
              {collections.map((one) => (
                <Card key={one.id} one={one} samples={samples} />
              ))}
            </ul>
          )
        }
      </Ready>
      {making && (
        <NewCollection
          onClose={() => setMaking(false)}
          onMade={(id) => {
            setMaking(false);
            go(at("collections", id));
          }}
        />
      )}
    </main>
  );
}

async function listed(signal: AbortSignal): Promise<Summary[]> {
  const all: Summary[] = [];
  const read = (cursor?: string) =>
    ok(api.GET("/v1/collections", { params: { query: cursor === undefined ? {} : { cursor } }, signal }));
  for await (const page of pages(read)) {
    all.push(...page.collections);
    if (all.length >= MOST) break;
  }
  return all;
}

function Card({ one, samples }: { readonly one: Summary; readonly samples: readonly Sample[] }) {
  return (
    <li class="card">
      <Link to={at("collections", one.id)} class="card-main">
        <b class="id">{one.id}</b>
        {one.title && <span>{one.title}</span>}
      </Link>
      <dl class="figures">
        <div>
          <dt>Submaps</dt>
          <dd>{count(one.counts.submaps)}</dd>
        </div>
        <div>
          <dt title={OVERLAP}>Trees in submaps</dt>
          <dd>{count(one.counts.landmarks)}</dd>
        </div>
        <div>
          <dt>Revision</dt>
          <dd>{count(one.revision)}</dd>
        </div>
      </dl>
      <p class="card-end">
        <IndexState collection={one.id} samples={samples} />
        <span title={moment(one.updated)}>changed {ago(one.updated)}</span>
      </p>
    </li>
  );
}

/** Whether the index holds the newest revision, where the metrics say so. */
export function IndexState({ collection, samples }: { readonly collection: string; readonly samples: readonly Sample[] }) {
  const lag = valueOf(samples, "urquhart_index_lag_revisions", { collection });
  if (lag === undefined) return <span class="dot idle">Index opens at the next query</span>;
  if (lag === 0) return <span class="dot good">Indexed</span>;
  return <span class="dot warn">{plural(lag, "revision")} behind; the next query catches up</span>;
}

export function NewCollection({ onClose, onMade }: { readonly onClose: () => void; readonly onMade: (id: string) => void }) {
  const [id, setId] = useState("");
  const [title, setTitle] = useState("");
  const [crs, setCrs] = useState("");
  const [refusal, setRefusal] = useState("");
  const send = async (event: Event) => {
    event.preventDefault();
    const body = { ...(title && { title }), ...(crs && { crs }) };
    const params = { path: { collection: id }, header: { "if-none-match": "*" } };
    try {
      await ok(api.PUT("/v1/collections/{collection}", { params, body }));
      onMade(id);
    } catch (error) {
      setRefusal(sentenceOf(error));
    }
  };
  return (
    <Dialog title="New collection" onClose={onClose}>
      <form onSubmit={send}>
        <label>
          Id
          <input required value={id} onInput={(event) => setId(event.currentTarget.value)} placeholder="plots-2026" autoFocus />
          <small>Letters, digits, dots, dashes and underscores. It cannot be changed later.</small>
        </label>
        <label>
          Title
          <input value={title} onInput={(event) => setTitle(event.currentTarget.value)} placeholder="Plots of 2026" />
        </label>
        <label>
          Coordinate reference system
          <input value={crs} onInput={(event) => setCrs(event.currentTarget.value)} placeholder="EPSG:25832" />
          <small>Only if submaps lie in a map with coordinates on Earth.</small>
        </label>
        {refusal && (
          <p class="note bad" role="alert">
            {refusal}
          </p>
        )}
        <p class="actions">
          <button type="button" class="quiet" onClick={onClose}>
            Cancel
          </button>
          <button type="submit" class="primary">
            Make it
          </button>
        </p>
      </form>
    </Dialog>
  );
}
