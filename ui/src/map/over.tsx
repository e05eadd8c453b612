/** What lies over the trees of a map: how far in time, constraints, the moves of a map; how each is drawn, and its switch. */

import { ok } from "urquhart-client";

import { setQuery } from "../parts/router";
import { count, metres, moment, plural } from "../parts/text";
import { api } from "../service/api";
import { useLoaded } from "../service/load";
import type { Columns } from "./columns";
import { type Constraint, type Constraints, type Moves, STATES } from "./constraints";

/** What is drawn over the trees, as far as it was read. */
export interface Over {
  readonly constraints: Constraints | null;
  readonly moves: Moves | null;
}

/** The moments of the submaps, each once and in order, in seconds since 1970. */
export function momentsOf({ stamps }: Columns): readonly number[] {
  return [...new Set(stamps.filter((one) => Number.isFinite(one)))].sort((one, other) => one - other);
}

interface SliderProps {
  readonly moments: readonly number[];
  readonly until: number | null;
  readonly onUntil: (until: number | null) => void;
}

/** Shows what had been observed until a moment. Submaps without a time are always shown. */
export function TimeSlider({ moments, until, onUntil }: SliderProps) {
  const last = moments.length - 1;
  if (last < 1) return null;
  const after = until === null ? -1 : moments.findIndex((one) => one > until);
  const at = after < 0 ? last : Math.max(after - 1, 0);
  const said = moment(new Date(1000 * moments[at]!).toISOString());
  const chosen = (value: string) => (Number(value) === last ? null : moments[Number(value)]!);
  return (
    <label class="time">
      Observed until
      <input
        type="range"
        min={0}
        max={last}
        value={at}
        aria-valuetext={said}
        onInput={(event) => onUntil(chosen(event.currentTarget.value))}
        onChange={(event) => setQuery({ until: chosen(event.currentTarget.value)?.toString() ?? null })}
      />
      <output>{at === last ? "now" : said}</output>
    </label>
  );
}

/** Switches constraints on and off, and chooses a map to compare the present places with. */
export function OverTools(props: { readonly collection: string; readonly shown: boolean; readonly map: string | null }) {
  const { collection, shown, map } = props;
  const jobs = useLoaded(
    (signal) => ok(api.GET("/v1/jobs", { params: { query: { collection, state: "successful", limit: 100 } }, signal })),
    [collection],
  );
  const maps = (jobs.data?.jobs ?? []).filter((job) => job.type === "map");
  return (
    <>
      <label class="switch">
        <input type="checkbox" checked={shown} onChange={() => setQuery({ constraints: shown ? "0" : null })} />
        Constraints
      </label>
      {(maps.length > 0 || map !== null) && (
        <label>
          Compare with{" "}
          <select value={map ?? ""} onChange={(event) => setQuery({ map: event.currentTarget.value || null })}>
            <option value="">no map</option>
            {map !== null && !maps.some(({ id }) => id === map) && <option value={map}>map {map}</option>}
            {maps.map((job) => (
              <option key={job.id} value={job.id}>
                map of {moment(job.created)}
              </option>
            ))}
          </select>
        </label>
      )}
    </>
  );
}

export function OverLegend({ constraints, moves }: Over) {
  const rows = constraints?.rows ?? [];
  return (
    <>
      {(Object.keys(STATES) as Constraint["state"][]).map((state) => {
        const some = rows.filter((row) => row.state === state).length;
        return some > 0 && <li key={state} class={`constraint ${state}`}>{`${plural(some, "constraint")} ${STATES[state]}`}</li>;
      })}
      {constraints?.more && <li>the first {count(rows.length)} constraints only</li>}
      {moves && moves.xy.length > 0 && (
        <li class="move">ring: where a submap is, dot: where the map puts it, at most {metres(moves.longest)} away</li>
      )}
      {moves && moves.xy.length === 0 && <li>The map has no pose of a submap in this frame.</li>}
    </>
  );
}

const FIRST = 12;

/** The constraints of the chosen submap, in a table. */
export function ConstraintsOf({ submap, constraints }: { readonly submap: string; readonly constraints: Constraints | null }) {
  const rows = (constraints?.rows ?? []).filter((row) => row.from === submap || row.to === submap);
  if (rows.length === 0) return null;
  return (
    <section>
      <h2>{plural(rows.length, "constraint")}</h2>
      <table class="pairs">
        <thead>
          <tr>
            <th scope="col">With</th>
            <th scope="col">Kind</th>
            <th scope="col">State</th>
          </tr>
        </thead>
        <tbody>
          {rows.slice(0, FIRST).map((row) => (
            <tr key={row.id}>
              <td class="id">{row.from === submap ? row.to : row.from}</td>
              <td>{row.kind === "match" ? `match, ${count(row.inlier_count ?? 0)} pairs` : "odometry"}</td>
              <td>{row.refused ? `${row.state}: ${row.refused}` : row.state}</td>
            </tr>
          ))}
        </tbody>
      </table>
      {rows.length > FIRST && <p class="meta">The first {FIRST} are shown.</p>}
    </section>
  );
}
