/** Stored queries of a collection, the newest first. */

import { ok } from "urquhart-client";

import { Message, Pager, Ready, Title } from "../parts/common";
import { at, Link, setQuery, useAddress } from "../parts/router";
import { ago, count, duration, moment, percent } from "../parts/text";
import { api } from "../service/api";
import { useLoaded } from "../service/load";
import { VERDICTS } from "../match/why";
import { Sureness } from "./sureness";

type Verdict = keyof typeof VERDICTS;

const PAGE = 50;
const EVERY = 10;

export function QueriesPage({ collection }: { readonly collection: string }) {
  const { query } = useAddress();
  const verdict = (Object.keys(VERDICTS) as Verdict[]).find((one) => one === query.get("verdict"));
  const cursor = query.get("cursor");
  const loaded = useLoaded(
    (signal) => {
      const asked = { limit: PAGE, ...(verdict && { verdict }), ...(cursor && { cursor }) };
      return ok(api.GET("/v1/collections/{collection}/queries", { params: { path: { collection }, query: asked }, signal }));
    },
    [collection, verdict, cursor],
    EVERY,
  );
  return (
    <main class="page">
      <Title>{`Queries in ${collection}`}</Title>
      <header class="page-head">
        <div>
          <nav class="crumbs" aria-label="Where you are">
            <Link to="/collections">Collections</Link>
            <Link to={at("collections", collection)}>{collection}</Link>
            <span>Queries</span>
          </nav>
          <h1>Stored queries</h1>
        </div>
        <label>
          Verdict
          <select value={verdict ?? ""} onChange={(event) => setQuery({ verdict: event.currentTarget.value || null, cursor: null })}>
            <option value="">All</option>
            {Object.entries(VERDICTS).map(([word, name]) => (
              <option key={word} value={word}>
                {name}
              </option>
            ))}
          </select>
        </label>
      </header>
      <Ready of={loaded} what="the queries">
        {(page) =>
          page.queries.length === 0 && !page.next ? (
            <Message title={verdict ? `No stored query has the verdict ${VERDICTS[verdict]}` : "No stored queries yet"}>
              <p>
                Queries are stored if they are sent with <code>"store": true</code>.{" "}
                <Link to={`/try?${new URLSearchParams({ collection })}`}>Try it with a file</Link>
              </p>
            </Message>
          ) : (
            <>
              <Sureness collection={collection} />
              <div class="scroll" tabIndex={0} role="region" aria-label="Table of queries">
                <table>
                  <thead>
                    <tr>
                      <th scope="col">Query</th>
                      <th scope="col">Verdict</th>
                      <th scope="col">Reason</th>
                      <th scope="col">Best place</th>
                      <th scope="col" class="number">Pairs</th>
                      <th scope="col" class="number">Confidence</th>
                      <th scope="col" class="number">Took</th>
                      <th scope="col" class="number">Asked</th>
                    </tr>
                  </thead>
                  <tbody>
                    {page.queries.map((one) => (
                      <tr key={one.id}>
                        <td>
                          <Link to={at("collections", collection, "queries", one.id)}>Query {one.id}</Link>
                        </td>
                        <td>
                          <span class={`badge ${one.verdict}`}>{VERDICTS[one.verdict]}</span>
                        </td>
                        <td>{one.reason.replaceAll("_", " ")}</td>
                        <td class="id">{one.submap_id}</td>
                        <td class="number">
                          {one.inlier_count != null && `${count(one.inlier_count)} of ${count(one.landmark_count)}`}
                        </td>
                        <td class="number">{one.confidence != null && percent(one.confidence)}</td>
                        <td class="number">{duration(one.milliseconds)}</td>
                        <td class="number" title={moment(one.created)}>
                          {ago(one.created)}
                        </td>
                      </tr>
                    ))}
                  </tbody>
                </table>
              </div>
              <Pager cursor={cursor} next={page.next} first="Newest queries" more="Older queries" />
            </>
          )
        }
      </Ready>
    </main>
  );
}
