/** Why an answer is what it is, and what would have made it `matched`: the numbers and sentences of the service. */

import type { Schemas } from "urquhart-client";

import { asSentence, fixed, metres, percent, plural } from "../parts/text";

type Answer = Schemas["QueryAnswer"];
type Explanation = Schemas["ExplanationAnswer"];

export const VERDICTS = { matched: "Matched", ambiguous: "Ambiguous", no_match: "No match" } as const;

/** The outcome in a sentence or two. */
export function summary(answer: Answer, explanation: Explanation): string {
  const best = answer.candidates[0];
  const reason = asSentence(explanation.sentences[answer.reason] ?? answer.reason);
  if (best === undefined) return reason;
  const agree = `${best.inlier_count} of the ${plural(answer.landmark_count, "tree")} stand where ${best.submap_id} has a tree`;
  if (answer.verdict === "matched") {
    return `${agree}, typically within ${metres(best.rms)}. ${reason}`;
  }
  return `${reason} Under the best pose, ${agree}.`;
}

/** One of the conditions for `matched`. */
export interface Gate {
  readonly name: string;
  readonly meaning: string;
  readonly value: number;
  readonly needed: number;
  readonly shown: string;
  readonly shownNeeded: string;
  readonly passed: boolean;
}

/** The gates that the best candidate had to pass, as the service defines them; none without a candidate. */
export function gates(answer: Answer, explanation: Explanation): Gate[] {
  const best = answer.candidates[0];
  if (best === undefined) return [];
  const { confidence, log_odds } = explanation.gates;
  const made: Gate[] = [
    {
      name: "Confidence",
      meaning: "Calibrated probability that the place is right.",
      value: best.confidence,
      needed: confidence,
      shown: percent(best.confidence),
      shownNeeded: percent(confidence),
      passed: best.confidence >= confidence,
    },
    {
      name: "Against chance",
      meaning: "Log odds: how much better the place explains the trees than coincidence does.",
      value: best.log_odds,
      needed: log_odds,
      shown: fixed(best.log_odds),
      shownNeeded: fixed(log_odds),
      passed: best.log_odds >= log_odds,
    },
  ];
  const needed = leadNeeded(answer, explanation);
  if (answer.lead != null && needed !== null) {
    made.push({
      name: "Against rivals",
      meaning: "Lead: evidence of the best pose minus that of its strongest rival.",
      value: answer.lead,
      needed,
      shown: fixed(answer.lead),
      shownNeeded: fixed(needed),
      passed: answer.lead >= needed,
    });
  }
  return made;
}

/** The lead that the best pose needs, where chance is ruled out; null if there is nothing to compare it with. */
function leadNeeded(answer: Answer, explanation: Explanation): number | null {
  const best = answer.candidates[0];
  const found = explanation.findings?.filter((one) => one.submap_id === best?.submap_id) ?? [];
  const overlap = Math.max(0, ...found.map((one) => one.overlap_count));
  if (best === undefined || answer.lead == null || overlap === 0) return null;
  const rival = Math.max(0, best.evidence - answer.lead);
  const { lead, lead_per_landmark, lead_ratio } = explanation.gates;
  return lead + lead_per_landmark * overlap + lead_ratio * rival;
}

/** The ends of a search that looked for the place wherever it could be. */
const SEARCHED: ReadonlySet<string> = new Set(["exhausted", "evidence_bound"]);

/** What would have made the answer `matched`, or what makes it sure. */
export function advice(answer: Answer, gate: readonly Gate[]): string[] {
  if (answer.verdict === "matched") return [];
  const said: string[] = [];
  const best = answer.candidates[0];
  if (answer.method === "paper") {
    said.push("It was asked with the method paper, which finds fewer places. Ask again with robust, the default.");
  }
  const each = best && best.inlier_count > 0 ? best.evidence / best.inlier_count : 0;
  const searched = answer.method === "robust" && SEARCHED.has(answer.search?.stopped_by ?? "");
  if (answer.verdict === "no_match" && each <= 0 && searched) {
    said.push(
      `No pose explains these trees, so the place is most likely not in ${answer.collection}. If you know that it is, check ` +
        "the unit of the positions (metres), their noise (at most 0.6 m), and that more than half of the trees were seen.",
    );
  }
  for (const { name, passed, value, needed } of gate) {
    if (passed || name === "Confidence" || (name === "Against chance" && each <= 0)) continue;
    const short = needed - value;
    const trees = each > 0 ? `, about ${plural(Math.ceil(short / each), "more matching tree")} at the present ${fixed(each)} a tree` : "";
    if (name === "Against chance") said.push(`${fixed(short)} more log odds are needed to rule out chance${trees}.`);
    else said.push(`The lead over the strongest rival must grow by ${fixed(short)}: trees that fit this place and not the rival.`);
  }
  for (const hint of answer.hints ?? []) said.push(asSentence(hint.sentence));
  if (answer.reason === "rival_too_close") {
    said.push("A wider view helps most where trees stand in rows, or diameters on both sides.");
  }
  // That all was tried is no advice; the panel says it of the search.
  const { search } = answer;
  const complete = search?.stopped_by === "exhausted" && (search.skipped ?? []).length === 0;
  if (search && answer.verdict === "no_match" && !complete) said.push(asSentence(search.sentence));
  return said;
}
