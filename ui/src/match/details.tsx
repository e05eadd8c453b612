/** The panel beside the drawing: why, in words and against the gates; the numbers of the answer; pairs; stages. */

import { useState } from "preact/hooks";
import type { Schemas } from "urquhart-client";

import { CopyButton, Facts } from "../parts/common";
import { asSentence, degrees, duration, fixed, metres, percent, plural, share } from "../parts/text";
import type { Overlay, Pair } from "./overlay";
import { useSelected } from "./selection";
import { advice, type Gate, gates } from "./why";

interface DetailsProps {
  readonly answer: Schemas["QueryAnswer"];
  readonly explanation: Schemas["ExplanationAnswer"];
  readonly choice: { readonly kind: "candidate" | "rival"; readonly number: number } | null;
  readonly overlay: Overlay | null;
}

export function Details({ answer, explanation, choice, overlay }: DetailsProps) {
  const candidate = choice?.kind === "candidate" ? answer.candidates[choice.number - 1] : undefined;
  const rival = choice?.kind === "rival" ? answer.rivals[choice.number - 1] : undefined;
  return (
    <aside class="details" aria-label="Details">
      <Why answer={answer} explanation={explanation} />
      {candidate && <Candidate one={candidate} sentences={explanation.sentences} />}
      {rival && <Rival one={rival} best={answer.candidates[0]} />}
      {overlay?.pairs && overlay.pairs.length > 0 && <Pairs overlay={overlay} pairs={overlay.pairs} />}
      <Stages stages={answer.stages} explanation={explanation} />
      <Elsewhere answer={answer} />
    </aside>
  );
}

function Why({ answer, explanation }: Pick<DetailsProps, "answer" | "explanation">) {
  const made = gates(answer, explanation);
  const missing = advice(answer, made);
  return (
    <section>
      <h2>{answer.verdict === "matched" ? "Why this is sure" : "Why this is not a match"}</h2>
      {made.length === 0 && <p>{asSentence(explanation.sentences[answer.reason] ?? answer.reason)}</p>}
      {made.map((gate) => (
        <GateBar key={gate.name} gate={gate} />
      ))}
      {missing.length > 0 && (
        <>
          <h3>What would make it a match</h3>
          <ul class="advice">
            {missing.map((sentence) => (
              <li key={sentence}>{sentence}</li>
            ))}
          </ul>
        </>
      )}
    </section>
  );
}

function GateBar({ gate }: { readonly gate: Gate }) {
  const most = Math.max(gate.value, gate.needed, 1e-9) * 1.08;
  const share = (value: number) => `${(100 * Math.max(0, value)) / most}%`;
  return (
    <div class={`gate ${gate.passed ? "passed" : "failed"}`} title={gate.meaning}>
      <span class="gate-name">
        {gate.passed ? "✓" : "✗"} {gate.name}
      </span>
      <span class="gate-value">
        <b>{gate.shown}</b>, needs {gate.shownNeeded}
      </span>
      <span class="gate-bar" aria-hidden="true">
        <i style={{ width: share(gate.value) }} />
        <u style={{ left: share(gate.needed) }} />
      </span>
      <small>{gate.meaning}</small>
    </div>
  );
}

function Candidate(props: { readonly one: Schemas["CandidateAnswer"]; readonly sentences: Record<string, string> }) {
  const { one, sentences } = props;
  const { transform, map_pose: map, survey } = one;
  return (
    <section>
      <h2>
        {one.rank === 1 ? "The best place" : `Candidate ${one.rank}`}: <span class="id">{one.submap_id}</span>
      </h2>
      {one.refused && <p class="refused">{asSentence(sentences[one.refused] ?? one.refused)}</p>}
      {(one.warnings ?? []).map((word) => (
        <p class="note warn" key={word}>
          {asSentence(sentences[word] ?? word)}
        </p>
      ))}
      <Facts
        rows={[
          ["Pairs", `${one.inlier_count} (${share(one.inlier_ratio)} of the overlap)`, "Trees of both sides that are the same one."],
          ["Typical error", metres(one.rms), "Root mean square of the distances between partners."],
          ["Overlap", share(one.overlap_ratio), "Share of the query's trees that the stored map covers."],
          ["Confidence", percent(one.confidence), "Calibrated probability that the pose is right."],
          ["Evidence", fixed(one.evidence), "Natural logarithm of how much likelier this place is than chance."],
          ["Log odds", fixed(one.log_odds), "Evidence less the number of poses that there were to choose from."],
          ["Found by", one.level, `${one.support} agree on the pose.`],
          ...(one.session ? [["Session", one.session] as const] : []),
        ]}
      />
      <h3>The query in {one.submap_id}</h3>
      <PoseFacts pose={transform} />
      {map && (
        <>
          <h3>The query in {map.frame_id}</h3>
          <PoseFacts pose={map} />
        </>
      )}
      {survey?.crs_position && survey.crs && (
        <Facts
          rows={[
            ["Position", survey.crs_position.map((value) => value.toFixed(2)).join(", "), "Middle of the query's trees."],
            ["System", survey.crs],
          ]}
        />
      )}
    </section>
  );
}

function PoseFacts({ pose }: { readonly pose: { readonly x: number; readonly y: number; readonly yaw: number } }) {
  return (
    <Facts
      rows={[
        ["x", `${pose.x.toFixed(3)} m`],
        ["y", `${pose.y.toFixed(3)} m`],
        ["Heading", degrees(pose.yaw), "Counter-clockwise from x."],
      ]}
    />
  );
}

function Rival({ one, best }: { readonly one: Schemas["RivalAnswer"]; readonly best: Schemas["CandidateAnswer"] | undefined }) {
  return (
    <section>
      <h2>
        A rival: <span class="id">{one.submap_id}</span>
      </h2>
      <p>
        Another pose that explains so many of the trees that it is not ruled out.
        {best?.submap_id === one.submap_id && " It lies in the same submap: in rows of trees, often one row further."}
      </p>
      <Facts
        rows={[
          ["Pairs", String(one.inlier_count)],
          ["Evidence", fixed(one.evidence), "Extrapolated to the overlap of the best candidate, less what chance explains."],
        ]}
      />
      <PoseFacts pose={one.transform} />
    </section>
  );
}

const FIRST_PAIRS = 8;

function Pairs({ overlay, pairs }: { readonly overlay: Overlay; readonly pairs: readonly Pair[] }) {
  const [all, setAll] = useState(false);
  const [selected, select] = useSelected();
  const sorted = [...pairs].sort((one, other) => other.residual - one.residual);
  const shown = all ? sorted : sorted.slice(0, FIRST_PAIRS);
  return (
    <section>
      <h2>Pairs, the loosest first</h2>
      <table class="pairs">
        <thead>
          <tr>
            <th scope="col">Query</th>
            <th scope="col">{overlay.submapId}</th>
            <th scope="col" class="number">Apart</th>
          </tr>
        </thead>
        <tbody>
          {shown.map((pair) => {
            const chosen = selected?.at === pair[selected?.side ?? "query"];
            return (
              <tr key={pair.query} class={chosen ? "chosen" : ""}>
                <td>
                  <button
                    type="button"
                    class="row"
                    aria-pressed={chosen}
                    onClick={() => select(chosen ? null : { side: "query", at: pair.query })}
                  >
                    {overlay.queryIds[pair.query]}
                  </button>
                </td>
                <td>{overlay.submapIds[pair.submap]}</td>
                <td class="number">{metres(pair.residual)}</td>
              </tr>
            );
          })}
        </tbody>
      </table>
      {sorted.length > FIRST_PAIRS && (
        <button type="button" class="quiet" onClick={() => setAll(!all)}>
          {all ? "Show fewer" : `Show all ${plural(sorted.length, "pair")}`}
        </button>
      )}
    </section>
  );
}

function Stages(props: { readonly stages: readonly Schemas["StageAnswer"][]; readonly explanation: Schemas["ExplanationAnswer"] }) {
  const longest = Math.max(...props.stages.map(({ milliseconds }) => milliseconds), 1e-9);
  const { search } = props.explanation;
  return (
    <section>
      <h2>The search</h2>
      {search && <p>{asSentence(search.sentence)}</p>}
      <ul class="stages">
        {props.stages.map((stage) => (
          <li key={stage.name} title={counted(stage.counts)}>
            <span>{stage.name.replaceAll("_", " ")}</span>
            <span class="bar" aria-hidden="true">
              <i style={{ width: `${(100 * stage.milliseconds) / longest}%` }} />
            </span>
            <span class="number">{duration(stage.milliseconds)}</span>
          </li>
        ))}
      </ul>
    </section>
  );
}

const counted = (counts: Readonly<Record<string, number>>) =>
  Object.entries(counts)
    .filter(([, value]) => value > 0)
    .map(([name, value]) => `${name.replaceAll("_", " ")} ${value}`)
    .join(", ");

function Elsewhere({ answer }: { readonly answer: Schemas["QueryAnswer"] }) {
  const { self, explanation } = answer.links;
  return (
    <section class="elsewhere">
      <CopyButton text={location.href}>Copy the address of this page</CopyButton>
      {self && (
        <a class="button quiet" href={self}>
          Answer as JSON
        </a>
      )}
      {explanation && (
        <a class="button quiet" href={explanation}>
          Explanation as JSON
        </a>
      )}
    </section>
  );
}
