/** How sure the answers of a collection were: stored queries by confidence and verdict. */

import { ok } from "urquhart-client";

import { VERDICTS } from "../match/why";
import { Ready } from "../parts/common";
import { count, plural } from "../parts/text";
import { api } from "../service/api";
import { useLoaded } from "../service/load";

const NEWEST = 500;

/** Bands of the confidence, the surest first: a name and the least value. */
const BANDS = [
  ["99.9 % and more", 0.998993],
  ["99 % to 99.9 %", 0.99],
  ["90 % to 99 %", 0.9],
  ["50 % to 90 %", 0.5],
  ["less than 50 %", 0],
] as const;

const WORDS = Object.keys(VERDICTS) as (keyof typeof VERDICTS)[];

export function Sureness({ collection }: { readonly collection: string }) {
  const loaded = useLoaded(
    (signal) =>
      ok(api.GET("/v1/collections/{collection}/queries", { params: { path: { collection }, query: { limit: NEWEST } }, signal })),
    [collection],
  );
  return (
    <details class="panel sureness">
      <summary>How sure the answers were</summary>
      <Ready of={loaded} what="the queries">
        {({ queries }) => {
          const bands = BANDS.map(([name, least], at) => {
            const most = at === 0 ? Infinity : BANDS[at - 1]![1];
            const some = queries.filter(({ confidence }) => confidence != null && confidence >= least && confidence < most);
            return { name, parts: WORDS.map((word) => [word, some.filter(({ verdict }) => verdict === word).length] as const) };
          });
          const none = queries.filter(({ confidence }) => confidence == null).length;
          const longest = Math.max(...bands.map(({ parts }) => parts.reduce((sum, [, value]) => sum + value, 0)), 1);
          return (
            <>
              <ul class="stages">
                {bands.map(({ name, parts }) => (
                  <li key={name}>
                    <span>{name}</span>
                    <span class="bar" aria-hidden="true">
                      {parts.map(([word, value]) => value > 0 && <i key={word} class={word} style={{ width: `${(100 * value) / longest}%` }} />)}
                    </span>
                    <span class="number">{said(parts)}</span>
                  </li>
                ))}
              </ul>
              <p class="meta">
                The newest {plural(queries.length, "stored query", "stored queries")}, by the confidence of the best place
                {none > 0 && `; ${count(none)} had no place to be sure of`}. By calibration, 99 of 100 answers with a
                confidence of 99 % are right. Confidences between 50 % and 97 % are too high where few trees are seen and stand in rows.
              </p>
            </>
          );
        }}
      </Ready>
    </details>
  );
}

const said = (parts: readonly (readonly [keyof typeof VERDICTS, number])[]) =>
  parts.flatMap(([word, value]) => (value > 0 ? [`${count(value)} ${VERDICTS[word].toLowerCase()}`] : [])).join(", ") || "none";
