/** One collection: what it holds, its submaps page by page, and how to delete it. */

import { useState } from "preact/hooks";
import { ok, type Schemas } from "urquhart-client";

import { Dialog, Facts, Message, Pager, Ready, Title } from "../parts/common";
import { at, go, Link, setQuery, useAddress } from "../parts/router";
import { ago, count, moment, OVERLAP, plural } from "../parts/text";
import { api, sentenceOf } from "../service/api";
import { useLoaded } from "../service/load";
import { may, type Session } from "../service/session";

const PAGE = 50;
const EVERY = 15;

export function CollectionPage({ collection, session }: { readonly collection: string; readonly session: Session }) {
  const loaded = useLoaded(
    (signal) => ok(api.GET("/v1/collections/{collection}", { params: { path: { collection } }, signal })),
    [collection],
    EVERY,
  );
  const [deleting, setDeleting] = useState(false);
  return (
    <main class="page">
      <Title>{collection}</Title>
      <header class="page-head">
        <div>
          <nav class="crumbs" aria-label="Where you are">
            <Link to="/collections">Collections</Link>
            <span>{collection}</span>
          </nav>
          <h1 class="id">{collection}</h1>
        </div>
        <p class="actions">
          <Link class="button" to={at("collections", collection, "map")}>
            Map
          </Link>
          <Link class="button" to={at("collections", collection, "queries")}>
            Queries
          </Link>
          <Link class="button" to={`/try?${new URLSearchParams({ collection })}`}>
            Try it
          </Link>
        {may(session, "admin") && (
          <button type="button" class="danger" onClick={() => setDeleting(true)}>
            Delete …
          </button>
        )}
        </p>
      </header>
      <Ready of={loaded} what="the collection">
        {(one) => (
          <>
            <Overview one={one} />
            <Submaps collection={collection} revision={one.revision} />
            {deleting && <Delete one={one} onClose={() => setDeleting(false)} />}
          </>
        )}
      </Ready>
    </main>
  );
}

function Overview({ one }: { readonly one: Schemas["Collection"] }) {
  return (
    <section>
      {one.title && <p class="lead">{one.title}</p>}
      <Facts
        rows={[
          ["Submaps", count(one.counts.submaps)],
          ["Trees in submaps", count(one.counts.landmarks), OVERLAP],
          ["Polygons", count(one.counts.polygons)],
          ["Revision", count(one.revision), "Counter of the writes to the collection."],
          ["System", one.crs ?? "none", "Coordinate reference system of the map frame."],
          ["Created", moment(one.created)],
          ["Changed", moment(one.updated)],
        ]}
      />
    </section>
  );
}

function Submaps({ collection, revision }: { readonly collection: string; readonly revision: number }) {
  const { query } = useAddress();
  const cursor = query.get("cursor");
  const session = query.get("session");
  const loaded = useLoaded(
    (signal) => {
      const wanted = { limit: PAGE, ...(cursor && { cursor }), ...(session && { session }) };
      const params = { path: { collection }, query: wanted };
      return ok(api.GET("/v1/collections/{collection}/submaps", { params, signal }));
    },
    [collection, revision, cursor, session],
  );
  return (
    <section>
      <h2>Submaps{session && ` of the session ${session}`}</h2>
      {session && (
        <button type="button" class="quiet" onClick={() => setQuery({ session: null, cursor: null })}>
          All sessions
        </button>
      )}
      <Ready of={loaded} what="the submaps">
        {(page) =>
          page.submaps.length === 0 ? (
            <Message title="No submaps yet">
              <p>
                <Link to={`/try?${new URLSearchParams({ collection })}`}>Drop a stem map</Link> to store it here, store it with{" "}
                <code>urquhart index FILE --collection {collection}</code>, or send submaps to the <a href="/docs">API</a>.
              </p>
            </Message>
          ) : (
            <>
              <div class="scroll" tabIndex={0} role="region" aria-label="Table of submaps">
                <table>
                  <thead>
                    <tr>
                      <th scope="col">Submap</th>
                      <th scope="col">Session</th>
                      <th scope="col">Map frame</th>
                      <th scope="col" class="number">Trees</th>
                      <th scope="col" class="number">Observed</th>
                      <th scope="col" class="number">Changed</th>
                    </tr>
                  </thead>
                  <tbody>
                    {page.submaps.map((one) => (
                      <Row key={one.id} one={one} />
                    ))}
                  </tbody>
                </table>
              </div>
              <Pager cursor={cursor} next={page.next} first="First page" more="Next page" />
            </>
          )
        }
      </Ready>
    </section>
  );
}

function Row({ one }: { readonly one: Schemas["SubmapSummary"] }) {
  return (
    <tr>
      <td class="id">
        {one.map_pose ? (
          <Link to={`${at("collections", one.collection, "map")}?${new URLSearchParams({ frame: one.map_pose.frame_id, submap: one.id })}`}>
            {one.id}
          </Link>
        ) : (
          one.id
        )}
      </td>
      <td>
        {one.session && (
          <button type="button" class="row" onClick={() => setQuery({ session: one.session ?? null, cursor: null })}>
            {one.session}
          </button>
        )}
      </td>
      <td>{one.map_pose?.frame_id ?? ""}</td>
      <td class="number">{count(one.counts.landmarks ?? 0)}</td>
      <td class="number">{one.stamp ? ago(one.stamp) : ""}</td>
      <td class="number">{ago(one.updated)}</td>
    </tr>
  );
}

function Delete({ one, onClose }: { readonly one: Schemas["Collection"]; readonly onClose: () => void }) {
  const [typed, setTyped] = useState("");
  const [refusal, setRefusal] = useState("");
  const send = async (event: Event) => {
    event.preventDefault();
    try {
      await api.DELETE("/v1/collections/{collection}", { params: { path: { collection: one.id } } });
      go(at("collections"));
    } catch (error) {
      setRefusal(sentenceOf(error));
    }
  };
  return (
    <Dialog title={`Delete ${one.id}?`} onClose={onClose}>
      <form onSubmit={send}>
        <p>
          This deletes {plural(one.counts.submaps, "submap")} with {plural(one.counts.landmarks, "tree")}, and all stored
          queries. It cannot be undone.
        </p>
        <label>
          To confirm, enter the id of the collection
          <input value={typed} onInput={(event) => setTyped(event.currentTarget.value)} autoFocus />
        </label>
        {refusal && (
          <p class="note bad" role="alert">
            {refusal}
          </p>
        )}
        <p class="actions">
          <button type="button" class="quiet" onClick={onClose}>
            Keep it
          </button>
          <button type="submit" class="danger" disabled={typed !== one.id}>
            Delete it
          </button>
        </p>
      </form>
    </Dialog>
  );
}
