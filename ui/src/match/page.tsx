/** One stored query: what was found, laid over each other, and why. */

import { useMemo } from "preact/hooks";
import { ok, ProblemError, type Schemas } from "urquhart-client";

import { Message, Ready, Title } from "../parts/common";
import { at, Link, setQuery, useAddress } from "../parts/router";
import { ago, count, degrees, duration } from "../parts/text";
import { api, sentenceOf } from "../service/api";
import { useLoaded } from "../service/load";
import { layOver, type Overlay } from "./overlay";
import { Stage } from "./stage";
import { Details } from "./details";
import { summary, VERDICTS } from "./why";

interface Stored {
  readonly answer: Schemas["QueryAnswer"];
  readonly explanation: Schemas["ExplanationAnswer"];
}

/** Which pose is shown: a candidate by its rank, or a rival by its place in the list, counted from 1. */
interface Choice {
  readonly kind: "candidate" | "rival";
  readonly number: number;
}

export function MatchPage({ collection, query }: { readonly collection: string; readonly query: string }) {
  const stored = useLoaded(
    async (signal): Promise<Stored> => {
      const asked = { params: { path: { collection, query } }, signal };
      const [answer, explanation] = await Promise.all([
        ok(api.GET("/v1/collections/{collection}/queries/{query}", asked)),
        ok(api.GET("/v1/collections/{collection}/queries/{query}/explanation", asked)),
      ]);
      return { answer, explanation };
    },
    [collection, query],
  );
  return (
    <main class="match">
      <Title>{`Query ${query} in ${collection}`}</Title>
      <Ready of={stored} what="the query">
        {(loaded) => <Match {...loaded} />}
      </Ready>
    </main>
  );
}

function Match({ answer, explanation }: Stored) {
  const choice = choiceOf(useAddress().query.get("show"), answer);
  const overlay = useOverlay(answer, choice);
  return (
    <>
      <header class="verdict-head">
        <div>
          <nav class="crumbs" aria-label="Where you are">
            <Link to={at("collections")}>Collections</Link>
            <Link to={at("collections", answer.collection)}>{answer.collection}</Link>
            <Link to={at("collections", answer.collection, "queries")}>Queries</Link>
            <span>{answer.id}</span>
          </nav>
          <h1>
            <span class={`badge ${answer.verdict}`}>{VERDICTS[answer.verdict]}</span>
            <span class="name">{place(answer)}</span>
          </h1>
          <p class="lead">{summary(answer, explanation)}</p>
          <Where answer={answer} />
        </div>
        <p class="meta">
          {count(answer.landmark_count)} trees asked · method {answer.method}
          {answer.method === "robust" && `, effort ${answer.effort}`} · revision {count(answer.revision)} ·{" "}
          {duration(answer.stages.reduce((sum, { milliseconds }) => sum + milliseconds, 0))}
          {answer.stamp && ` · observed ${ago(answer.stamp)}`}
        </p>
      </header>
      {choice && <Tabs answer={answer} choice={choice} />}
      <div class="match-body">
        {choice === null ? (
          <Message title="No place to draw">
            <p>The search proposed no pose, so there are no two forests to lay over each other. The panel says why.</p>
          </Message>
        ) : (
          <Ready of={overlay} what="the trees">
            {(laid) => laid && <Stage overlay={laid} answer={answer} explanation={explanation} />}
          </Ready>
        )}
        <Details answer={answer} explanation={explanation} choice={choice} overlay={overlay.data ?? null} />
      </div>
    </>
  );
}

/** What the verdict says of the place, which is nothing of a candidate that is no match. */
function place({ verdict, candidates, collection }: Schemas["QueryAnswer"]): string {
  const best = candidates[0]?.submap_id;
  if (best === undefined || verdict === "no_match") return `not found in ${collection}`;
  return verdict === "ambiguous" ? `perhaps ${best}` : best;
}

/** Where that is in the map: what a forester asked for. Nothing unless the answer is sure. */
function Where({ answer }: { readonly answer: Schemas["QueryAnswer"] }) {
  const best = answer.candidates[0];
  if (answer.verdict !== "matched" || best?.map_pose == null) return null;
  const { frame_id, x, y, yaw } = best.map_pose;
  const shown = { frame: frame_id, submap: best.submap_id, query: answer.id ?? "", mark: `${x.toFixed(3)},${y.toFixed(3)}` };
  const address = `${at("collections", answer.collection, "map")}?${new URLSearchParams(shown)}`;
  return (
    <p class="where">
      The point (0, 0) of the query lies at x {x.toFixed(2)} m, y {y.toFixed(2)} m in {frame_id}, turned by {degrees(yaw)}.{" "}
      <Link to={address}>See it on the map</Link>
    </p>
  );
}

const SAME_METRES = 1;
const SAME_RADIANS = 0.05;

/** Whether a candidate says what the best one says, in another submap: where submaps overlap, most do. */
function samePlace(one: Schemas["CandidateAnswer"], best: Schemas["CandidateAnswer"]): boolean {
  const [here, there] = [one.map_pose, best.map_pose];
  if (!here || !there || here.frame_id !== there.frame_id) return false;
  const turn = Math.abs(Math.atan2(Math.sin(here.yaw - there.yaw), Math.cos(here.yaw - there.yaw)));
  return Math.hypot(here.x - there.x, here.y - there.y) <= SAME_METRES && turn <= SAME_RADIANS;
}

function Tabs({ answer, choice }: { readonly answer: Schemas["QueryAnswer"]; readonly choice: Choice }) {
  const tabs = [
    ...answer.candidates.map((one) => ({
      choice: { kind: "candidate", number: one.rank } as Choice,
      name: one.rank === 1 ? "Best" : samePlace(one, answer.candidates[0]!) ? "Same place" : `Candidate ${one.rank}`,
      detail: `${one.submap_id} · ${one.inlier_count} pairs`,
    })),
    ...answer.rivals.map((one, index) => ({
      choice: { kind: "rival", number: index + 1 } as Choice,
      name: answer.rivals.length > 1 ? `Rival ${index + 1}` : "Rival",
      detail: `${one.submap_id} · ${one.inlier_count} pairs`,
    })),
  ];
  const move = (event: KeyboardEvent) => {
    const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (step === undefined) return;
    const now = tabs.findIndex((tab) => same(tab.choice, choice));
    const next = (now + step + tabs.length) % tabs.length;
    event.preventDefault();
    show(tabs[next]!.choice);
    (event.currentTarget as HTMLElement).querySelectorAll<HTMLElement>("[role=tab]")[next]?.focus();
  };
  return (
    <div class="tabs" role="tablist" aria-label="Poses" onKeyDown={move}>
      {tabs.map((tab) => {
        const chosen = same(tab.choice, choice);
        return (
          <button
            key={`${tab.choice.kind}${tab.choice.number}`}
            type="button"
            role="tab"
            class={tab.choice.kind}
            aria-selected={chosen}
            tabIndex={chosen ? 0 : -1}
            onClick={() => show(tab.choice)}
          >
            <b>{tab.name}</b>
            <small>{tab.detail}</small>
          </button>
        );
      })}
    </div>
  );
}

const same = (one: Choice, other: Choice) => one.kind === other.kind && one.number === other.number;
const show = ({ kind, number }: Choice) =>
  setQuery({ show: kind === "candidate" && number === 1 ? null : `${kind}-${number}` });

function choiceOf(text: string | null, answer: Schemas["QueryAnswer"]): Choice | null {
  const read = /^(candidate|rival)-([0-9]+)$/.exec(text ?? "");
  const chosen: Choice = { kind: (read?.[1] as Choice["kind"]) ?? "candidate", number: Number(read?.[2] ?? 1) };
  const length = chosen.kind === "rival" ? answer.rivals.length : answer.candidates.length;
  if (chosen.number >= 1 && chosen.number <= length) return chosen;
  return answer.candidates.length > 0 ? { kind: "candidate", number: 1 } : null;
}

/** The two forests under the chosen pose. The trees of the query come with the match of the best candidate. */
function useOverlay(answer: Schemas["QueryAnswer"], choice: Choice | null) {
  const { collection, id } = answer;
  const rank = choice?.kind === "candidate" ? choice.number : 1;
  const rival = choice?.kind === "rival" ? answer.rivals[choice.number - 1] : undefined;
  const inputs = useMemo(() => [collection, id, choice?.kind, choice?.number], [collection, id, choice?.kind, choice?.number]);
  return useLoaded(async (signal): Promise<Overlay | null> => {
    if (choice === null) return null; // nothing was proposed, so there is nothing to read
    const path = { collection, query: id ?? "", rank };
    const match = await ok(
      api.GET("/v1/collections/{collection}/queries/{query}/candidates/{rank}/match", { params: { path }, signal }),
    );
    const query = { xy: match.query_landmarks, ids: match.query_ids };
    if (rival === undefined) {
      const { candidate } = match;
      const submap = { xy: match.submap_landmarks, ids: match.submap_ids };
      const about = { name: `candidate ${rank}: ${candidate.submap_id}`, submapId: candidate.submap_id };
      return layOver({ ...about, pose: candidate.transform }, query, submap, candidate.inliers);
    }
    const { landmarks } = await ok(
      api.GET("/v1/collections/{collection}/submaps/{submap}", {
        params: { path: { collection, submap: rival.submap_id } },
        signal,
      }),
    ).catch((error: unknown) => {
      if (!(error instanceof ProblemError)) throw error;
      throw new Error(`The trees of the rival ${rival.submap_id} cannot be read: ${sentenceOf(error)}`);
    });
    const submap = { xy: (landmarks ?? []).map(({ x, y }) => [x, y]), ids: (landmarks ?? []).map((one) => one.id) };
    const about = { name: `rival ${choice?.number}: ${rival.submap_id}`, submapId: rival.submap_id };
    return layOver({ ...about, pose: rival.transform }, query, submap, null);
  }, inputs);
}
