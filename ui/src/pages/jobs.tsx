/** Jobs: what runs, how far it is, what was refused and why, and how to cancel. */

import { useState } from "preact/hooks";
import { ok, type Schemas } from "urquhart-client";

import { Facts, Message, Pager, Ready, Title } from "../parts/common";
import { at, Link, setQuery, useAddress } from "../parts/router";
import { ago, count, duration, moment, plural } from "../parts/text";
import { api, sentenceOf } from "../service/api";
import { useLoaded } from "../service/load";
import type { Session } from "../service/session";
import { Files, NotUsed, Unused, unused } from "./job-files";

type Job = Schemas["JobAnswer"];

const UNDER_WAY = new Set(["accepted", "running"]);
const STATES = ["accepted", "running", "successful", "failed", "dismissed"] as const;
/** The states in the words of this page: the API has those of OGC API - Processes. */
const WORDS: Readonly<Record<Job["state"], string>> = {
  accepted: "waiting",
  running: "running",
  successful: "successful",
  failed: "failed",
  dismissed: "cancelled",
};
const AMISS = new Set(["refused", "not_read", "failed"]);
const SOON = 1.5;
const LATER = 10;
const PAGE = 50;

export function JobsPage() {
  const { query } = useAddress();
  const state = STATES.find((one) => one === query.get("state"));
  const cursor = query.get("cursor");
  const loaded = useLoaded(
    (signal) => {
      const asked = { limit: PAGE, ...(state && { state }), ...(cursor && { cursor }) };
      return ok(api.GET("/v1/jobs", { params: { query: asked }, signal }));
    },
    [state, cursor],
    (page) => (page.jobs.some((job) => UNDER_WAY.has(job.state)) ? SOON : LATER),
  );
  return (
    <main class="page">
      <Title>Jobs</Title>
      <header class="page-head">
        <h1>Jobs</h1>
        <label>
          State
          <select value={state ?? ""} onChange={(event) => setQuery({ state: event.currentTarget.value || null, cursor: null })}>
            <option value="">All</option>
            {STATES.map((one) => (
              <option key={one} value={one}>
                {WORDS[one]}
              </option>
            ))}
          </select>
        </label>
      </header>
      <Ready of={loaded} what="the jobs">
        {(page) =>
          page.jobs.length === 0 ? (
            <Message title={state ? `No job is ${WORDS[state]}` : "No jobs yet"}>
              <p>Imports, constraints, maps and new indexes run as jobs, and are listed here.</p>
            </Message>
          ) : (
            <>
              <div class="scroll" tabIndex={0} role="region" aria-label="Table of jobs">
                <table>
                  <thead>
                    <tr>
                      <th scope="col">Job</th>
                      <th scope="col">Collection</th>
                      <th scope="col">State</th>
                      <th scope="col">Progress</th>
                      <th scope="col" class="number">Refused or not read</th>
                      <th scope="col" class="number">Accepted</th>
                    </tr>
                  </thead>
                  <tbody>
                    {page.jobs.map((job) => (
                      <tr key={job.id}>
                        <td>
                          <Link to={at("jobs", job.id)}>{job.type}</Link>
                        </td>
                        <td>
                          <Link to={at("collections", job.collection)}>{job.collection}</Link>
                        </td>
                        <td>
                          <State job={job} />
                        </td>
                        <td>
                          <Progress job={job} />
                        </td>
                        <td class="number">
                          <Unused value={unused(job)} />
                        </td>
                        <td class="number" title={moment(job.created)}>
                          {ago(job.created)}
                        </td>
                      </tr>
                    ))}
                  </tbody>
                </table>
              </div>
              <Pager cursor={cursor} next={page.next} first="Newest jobs" more="Older jobs" />
            </>
          )
        }
      </Ready>
    </main>
  );
}

function State({ job: { state } }: { readonly job: Job }) {
  return (
    <span class={`badge ${state}`} title={WORDS[state] === state ? undefined : `${state} in the API`}>
      {WORDS[state]}
    </span>
  );
}

function Progress({ job }: { readonly job: Job }) {
  const { total, done } = job;
  const text = total == null ? count(done) : `${count(done)} of ${count(total)}`;
  return (
    <span class="progress">
      {total != null && total > 0 && <progress max={total} value={Math.min(done, total)} aria-label={text} />}
      <span class="number">{text}</span>
      {job.eta_seconds != null && UNDER_WAY.has(job.state) && <small>{duration(1000 * job.eta_seconds)} left</small>}
    </span>
  );
}

export function JobPage({ id, session }: { readonly id: string; readonly session: Session }) {
  const loaded = useLoaded(
    (signal) => ok(api.GET("/v1/jobs/{job}", { params: { path: { job: id } }, signal })),
    [id],
    (job) => (UNDER_WAY.has(job.state) ? SOON : undefined),
  );
  return (
    <main class="page">
      <Title>{`Job ${id}`}</Title>
      <Ready of={loaded} what="the job">
        {(job) => <JobDetails job={job} session={session} onChange={loaded.reload} />}
      </Ready>
    </main>
  );
}

function JobDetails({ job, session, onChange }: { readonly job: Job; readonly session: Session; readonly onChange: () => void }) {
  const [refusal, setRefusal] = useState("");
  const cancel = async () => {
    try {
      await api.DELETE("/v1/jobs/{job}", { params: { path: { job: job.id } } });
      onChange();
    } catch (error) {
      setRefusal(sentenceOf(error));
    }
  };
  const problem = job.problem as { title?: string; detail?: string } | null | undefined;
  return (
    <>
      <header class="page-head">
        <div>
          <nav class="crumbs" aria-label="Where you are">
            <Link to="/jobs">Jobs</Link>
            <span class="id">{job.id}</span>
          </nav>
          <h1>
            {job.type} on {job.collection} <State job={job} />
          </h1>
        </div>
        {UNDER_WAY.has(job.state) && !job.dismissed && (session.scopes?.length ?? 0) > 0 && (
          <button type="button" class="danger" onClick={cancel}>
            Cancel the job
          </button>
        )}
      </header>
      {refusal && (
        <p class="note bad" role="alert">
          {refusal}
        </p>
      )}
      {job.dismissed && UNDER_WAY.has(job.state) && <p class="note warn">The job was cancelled and is stopping.</p>}
      {job.state === "accepted" && !job.dismissed && (
        <p class="note warn">The job waits for its turn.</p>
      )}
      {job.state === "dismissed" && (
        <p class="note warn">The job was cancelled before its work was done. What it had stored until then stays.</p>
      )}
      {problem && (
        <p class="note bad">
          {problem.title}: {problem.detail}
        </p>
      )}
      <section class="panel">
        <Progress job={job} />
        <Facts
          rows={[
            ...Object.entries(job.counts).map(([name, value]) => [name.replaceAll("_", " "), AMISS.has(name) ? <Unused value={value} /> : count(value)] as const),
            ["Accepted", moment(job.created)],
            ...(job.started ? ([["Started", moment(job.started)]] as const) : []),
            ...(job.finished ? ([["Ended", moment(job.finished)]] as const) : []),
            ["Collection", <Link to={at("collections", job.collection)}>{job.collection}</Link>],
          ]}
        />
      </section>
      {job.links.files != null && job.state === "successful" && (
        <>
          <Files job={job} />
          {unused(job) > 0 && <NotUsed job={job} />}
        </>
      )}
      {(job.counts.refused ?? 0) > 0 && <Refused job={job} />}
    </>
  );
}

const FIRST = 100;

interface Line {
  readonly line?: number;
  readonly id?: string;
  readonly problem?: { readonly detail?: string; readonly title?: string };
}

function Refused({ job }: { readonly job: Job }) {
  const loaded = useLoaded(
    async (signal) => {
      const { data } = await api.GET("/v1/jobs/{job}/errors", { params: { path: { job: job.id } }, parseAs: "text", signal });
      const lines = ((data as string | undefined) ?? "").split("\n").filter(Boolean);
      return { total: lines.length, lines: lines.slice(0, FIRST).map((line) => JSON.parse(line) as Line) };
    },
    [job.id, job.counts.refused],
  );
  return (
    <section>
      <h2>Lines that were refused</h2>
      <Ready of={loaded} what="the refused lines">
        {({ total, lines }) => (
          <>
            <div class="scroll" tabIndex={0} role="region" aria-label="Table of refused lines">
              <table>
                <thead>
                  <tr>
                    <th scope="col" class="number">Line</th>
                    <th scope="col">Submap</th>
                    <th scope="col">Why</th>
                  </tr>
                </thead>
                <tbody>
                  {lines.map((one, index) => (
                    <tr key={one.line ?? index}>
                      <td class="number">{one.line}</td>
                      <td class="id">{one.id}</td>
                      <td>{one.problem?.detail ?? one.problem?.title}</td>
                    </tr>
                  ))}
                </tbody>
              </table>
            </div>
            <p>
              {total > FIRST && `These are the first ${FIRST} of ${count(total)}. `}
              {job.state !== "failed" && "Correct these lines, and send them again. "}
              <a href={`/v1/jobs/${encodeURIComponent(job.id)}/errors`} download={`refused-${job.id}.ndjson`}>
                {plural(total, "refused line")} as a file
              </a>
            </p>
          </>
        )}
      </Ready>
    </section>
  );
}
