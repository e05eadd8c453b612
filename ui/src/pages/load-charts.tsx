/** How the load went while the page was open: requests in progress, queries, verdicts, latencies. */

import type { Schemas } from "urquhart-client";

import { Chart, type Line, type Seen, useHistory } from "../parts/chart";
import { count, duration } from "../parts/text";
import type { Sample } from "../service/metrics";

export function QueueChart({ load }: { readonly load: Schemas["Readiness"]["load"] }) {
  const seen = useHistory(load);
  const values = (one: "in_flight" | "queued") => seen.map(({ value }) => value[one]);
  const lines: Line[] = [
    { name: "in progress", kind: "first", values: values("in_flight") },
    { name: "waiting", kind: "third", values: values("queued") },
  ];
  return <Chart title="Requests, in the last five minutes" lines={lines} written={count} />;
}

/** What was added to counters between one reading and the next, a second; null where a process began again. */
function rates(seen: readonly Seen<number>[]): (number | null)[] {
  return seen.slice(1).map(({ at, value }, before) => {
    const added = value - seen[before]!.value;
    return added < 0 ? null : (1000 * added) / Math.max(at - seen[before]!.at, 1);
  });
}

const sumOf = (samples: readonly Sample[], wanted: (one: Sample) => boolean) =>
  samples.reduce((sum, one) => sum + (wanted(one) ? one.value : 0), 0);

const asks = ({ labels }: Sample) => labels.method === "POST" && labels.route === "/v1/collections/{collection}/queries";

export function QueryCharts({ samples }: { readonly samples: readonly Sample[] }) {
  const seen = useHistory(samples);
  const counted = (wanted: (one: Sample) => boolean) =>
    rates(seen.map(({ at, value }) => ({ at, value: sumOf(value, wanted) })));
  const verdict = (name: string) =>
    counted((one) => one.name === "urquhart_query_verdicts_total" && one.labels.verdict === name);
  const requests = counted((one) => one.name === "urquhart_request_seconds_count" && asks(one));
  const seconds = counted((one) => one.name === "urquhart_request_seconds_sum" && asks(one));
  const mean = requests.map((rate, at) => (rate && seconds[at] !== null ? (1000 * seconds[at]!) / rate : null));
  const verdicts: Line[] = [
    { name: "matched", kind: "first", values: verdict("matched") },
    { name: "ambiguous", kind: "second", values: verdict("ambiguous") },
    { name: "no match", kind: "third", values: verdict("no_match") },
  ];
  return (
    <div class="charts">
      <Chart title="Verdicts a second" lines={verdicts} written={(value) => value.toFixed(1)} />
      <Chart title="Mean time of a query" lines={[{ name: "mean", kind: "first", values: mean }]} written={duration} />
    </div>
  );
}
