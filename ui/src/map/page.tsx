/** The map of a collection: every submap of a map frame, its trees, and what is known of the chosen one. */

import { useState } from "preact/hooks";
import { ok, type Schemas } from "urquhart-client";

import { Facts, Message, Ready, Title } from "../parts/common";
import { at, go, Link, setQuery, useAddress } from "../parts/router";
import { ago, count, degrees, moment, OVERLAP, plural } from "../parts/text";
import { api, sentenceOf } from "../service/api";
import { useLoaded } from "../service/load";
import { type Columns, readColumns } from "./columns";
import { readConstraints, readMoves } from "./constraints";
import { ConstraintsOf, OverTools } from "./over";
import { MapStage } from "./stage";

export function MapPage({ collection }: { readonly collection: string }) {
  const { query } = useAddress();
  const about = useLoaded(
    (signal) => ok(api.GET("/v1/collections/{collection}", { params: { path: { collection } }, signal })),
    [collection],
  );
  return (
    <main class="match map">
      <Title>{`Map of ${collection}`}</Title>
      <Ready of={about} what="the collection">
        {(one) => {
          const frames = one.extent.spatial.map(({ frame_id }) => frame_id);
          const frame = frames.find((name) => name === query.get("frame")) ?? frames[0];
          return frame === undefined ? <NoPlaces collection={collection} /> : <Map one={one} frames={frames} frame={frame} />;
        }}
      </Ready>
    </main>
  );
}

function NoPlaces({ collection }: { readonly collection: string }) {
  return (
    <Message title="No submap has a place in a map">
      <p>
        Submaps appear here once they have a <code>map_pose</code>. Stem maps that <code>urquhart index</code> stored have
        one; for drives of a robot, <code>urquhart map build {collection} --apply</code> finds them.
      </p>
      <Link to={at("collections", collection)}>All submaps of {collection}</Link>
    </Message>
  );
}

/** What is asked for: all of the frame, or the part that is looked at where that is too much at once. */
export type Part = string | null;

function Map(props: { readonly one: Schemas["Collection"]; readonly frames: readonly string[]; readonly frame: string }) {
  const { one, frames, frame } = props;
  const { query } = useAddress();
  const session = query.get("session");
  const [part, setPart] = useState<Part>(null);
  const loaded = useLoaded(
    (signal) => {
      const box = one.extent.spatial.find(({ frame_id }) => frame_id === frame)!.bbox;
      const base = [Math.floor(box[0]!), Math.floor(box[1]!)] as const;
      const asked = { frame_id: frame, ...(session && { session }), ...(part && { bbox: part }) };
      return readColumns(one.id, asked, base, signal);
    },
    [one.id, frame, session, part],
  );
  // While another part is read, the last one stays.
  const [last, setLast] = useState<Columns | null>(null);
  const columns = loaded.data ?? (last?.frame === frame ? last : null);
  if (loaded.data !== undefined && loaded.data !== last) setLast(loaded.data);
  const shown = query.get("constraints") !== "0";
  const read = useLoaded(async (signal) => (shown ? readConstraints(one.id, signal) : null), [one.id, one.revision, shown]);
  const map = query.get("map");
  const ready = map !== null && columns !== null;
  const moved = useLoaded(
    async (signal) => (ready ? readMoves(one.id, map, columns, signal) : null),
    [one.id, frame, map, ready],
  );
  const over = { constraints: read.data ?? null, moves: moved.data ?? null };
  return (
    <>
      <header class="page-head">
        <div>
          <nav class="crumbs" aria-label="Where you are">
            <Link to="/collections">Collections</Link>
            <Link to={at("collections", one.id)}>{one.id}</Link>
            <span>Map</span>
          </nav>
          <h1>{one.title || one.id}</h1>
        </div>
        <MapTools columns={columns} frames={frames} frame={frame} session={session} collection={one.id} />
      </header>
      {columns === null ? (
        <Ready of={loaded} what="the map">
          {() => null}
        </Ready>
      ) : (
        <div class="match-body">
          <MapStage key={`${frame}/${session}`} collection={one.id} columns={columns} over={over} part={part} onPart={setPart} />
          <aside class="details" aria-label="Details">
            <Overview columns={columns} session={session} />
            {[read.error, moved.error].map(
              (error) =>
                error !== undefined && (
                  <p class="note bad" role="alert">
                    {sentenceOf(error)}
                  </p>
                ),
            )}
            {query.get("submap") && <Chosen collection={one.id} submap={query.get("submap")!} />}
            {query.get("submap") && <ConstraintsOf submap={query.get("submap")!} constraints={over.constraints} />}
          </aside>
        </div>
      )}
    </>
  );
}

interface ToolsProps {
  readonly columns: Columns | null;
  readonly frames: readonly string[];
  readonly frame: string;
  readonly session: string | null;
  readonly collection: string;
}

const SOMEWHERE_ELSE = { x: null, y: null, scale: null, submap: null, mark: null, query: null };

function MapTools({ columns, frames, frame, session, collection }: ToolsProps) {
  const { query } = useAddress();
  const [refusal, setRefusal] = useState("");
  const find = async (event: SubmitEvent) => {
    event.preventDefault();
    const submap = String(new FormData(event.currentTarget as HTMLFormElement).get("id")).trim();
    if (!submap) return;
    setRefusal("");
    try {
      const params = { path: { collection, submap } };
      const { map_pose: place } = await ok(api.GET("/v1/collections/{collection}/submaps/{submap}", { params }));
      if (place == null) setRefusal(`${submap} has no place in a map.`);
      else setQuery({ ...SOMEWHERE_ELSE, submap, frame: place.frame_id, session: null });
    } catch (error) {
      setRefusal(sentenceOf(error));
    }
  };
  return (
    <div class="map-tools">
      <OverTools collection={collection} shown={query.get("constraints") !== "0"} map={query.get("map")} />
      {frames.length > 1 && (
        <label>
          Map frame{" "}
          <select value={frame} onChange={(event) => setQuery({ ...SOMEWHERE_ELSE, frame: event.currentTarget.value, session: null })}>
            {frames.map((name) => (
              <option key={name}>{name}</option>
            ))}
          </select>
        </label>
      )}
      {(session !== null || (columns?.sessions.length ?? 0) > 1) && (
        <label>
          Session{" "}
          <select value={session ?? ""} onChange={(event) => setQuery({ ...SOMEWHERE_ELSE, session: event.currentTarget.value || null })}>
            <option value="">All</option>
            {(session === null ? columns!.sessions : [session]).map((name) => (
              <option key={name} value={name}>
                {name}
              </option>
            ))}
          </select>
        </label>
      )}
      <form role="search" onSubmit={find}>
        <label>
          Find a submap <input name="id" type="search" placeholder="its id" autoComplete="off" />
        </label>
        {refusal && (
          <p class="note bad" role="alert">
            {refusal}
          </p>
        )}
      </form>
    </div>
  );
}

function Overview({ columns, session }: { readonly columns: Columns; readonly session: string | null }) {
  return (
    <section>
      <h2>{session === null ? `Map frame ${columns.frame}` : `Session ${session}`}</h2>
      <Facts
        rows={[
          ["Submaps", count(columns.submaps.length)],
          ["Trees in submaps", count(columns.landmarks), OVERLAP],
          ...(columns.sessions.length > 0 ? ([["Sessions", count(columns.sessions.length)]] as const) : []),
        ]}
      />
      {columns.every > 1 && (
        <p class="note warn">
          Only one tree in {columns.every} is drawn at this scale. Zoom in to see all of them.
        </p>
      )}
    </section>
  );
}

function Chosen({ collection, submap }: { readonly collection: string; readonly submap: string }) {
  const loaded = useLoaded(
    (signal) => {
      const params = { path: { collection, submap } };
      return ok(api.GET("/v1/collections/{collection}/submaps/{submap}", { params, signal }));
    },
    [collection, submap],
  );
  const [refusal, setRefusal] = useState("");
  const [busy, setBusy] = useState(false);
  const lookUp = async () => {
    setBusy(true);
    try {
      const asked = { params: { path: { collection } }, body: { submap_id: submap, store: true, explain: true } };
      const answer = await ok(api.POST("/v1/collections/{collection}/queries", asked));
      go(at("collections", collection, "queries", answer.id ?? ""));
    } catch (error) {
      setRefusal(sentenceOf(error));
      setBusy(false);
    }
  };
  return (
    <section>
      <h2 class="id">{submap}</h2>
      <Ready of={loaded} what="the submap">
        {(one) => (
          <>
            <Facts
              rows={[
                ["Trees", plural(one.counts.landmarks ?? 0, "tree")],
                ["Polygons", count(one.counts.polygons ?? 0)],
                ...(one.session ? ([["Session", one.session]] as const) : []),
                ...(one.stamp ? ([["Observed", moment(one.stamp)]] as const) : []),
                ["Changed", ago(one.updated)],
                ...(one.map_pose
                  ? ([
                      ["x", `${one.map_pose.x.toFixed(2)} m`],
                      ["y", `${one.map_pose.y.toFixed(2)} m`],
                      ["Heading", degrees(one.map_pose.yaw)],
                    ] as const)
                  : []),
              ]}
            />
            <p class="actions">
              <a class="button quiet" href={one.links.self}>
                As JSON
              </a>
              <button type="button" class="primary" onClick={lookUp} disabled={busy}>
                {busy ? "Looking …" : "Find it among the others"}
              </button>
            </p>
            {refusal && (
              <p class="note bad" role="alert">
                {refusal}
              </p>
            )}
          </>
        )}
      </Ready>
    </section>
  );
}
