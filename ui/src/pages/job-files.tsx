/** What a coregistration left: the files that it wrote, and the plots that it could not use. */

import { ok, type Schemas } from "urquhart-client";

import { Ready } from "../parts/common";
import { asSentence, bytes, count, plural } from "../parts/text";
import { api } from "../service/api";
import { useLoaded } from "../service/load";

type Job = Schemas["JobAnswer"];
type JobFile = Schemas["JobFile"];

/** How many lines or plots of a job were not used. */
export function unused(job: Job): number {
  return ["refused", "not_read", "failed"].reduce((sum, name) => sum + (job.counts[name] ?? 0), 0);
}

/** A count that should be 0, in a colour that warns if it is not. */
export function Unused({ value }: { readonly value: number }) {
  return value > 0 ? <b class="warns">{count(value)}</b> : <>{count(value)}</>;
}

const REPORT = "report.html";

export function Files({ job }: { readonly job: Job }) {
  const loaded = useLoaded((signal) => ok(api.GET("/v1/jobs/{job}/files", { params: { path: { job: job.id } }, signal })), [job.id]);
  return (
    <section class="panel">
      <h2>Files</h2>
      <Ready of={loaded} what="the files">
        {({ files }) => {
          const folders = new Map<string, JobFile[]>();
          for (const file of files) {
            const folder = file.name.includes("/") ? file.name.slice(0, file.name.lastIndexOf("/")) : "";
            folders.set(folder, [...(folders.get(folder) ?? []), file]);
          }
          const top = (folders.get("") ?? []).sort((one, other) => Number(other.name === REPORT) - Number(one.name === REPORT));
          folders.delete("");
          return (
            <>
              <List files={top} />
              {[...folders].map(([folder, inside]) => (
                <details key={folder}>
                  <summary>
                    {folder} ({plural(inside.length, "file")})
                  </summary>
                  <List files={inside} />
                </details>
              ))}
            </>
          );
        }}
      </Ready>
    </section>
  );
}

function List({ files }: { readonly files: readonly JobFile[] }) {
  return (
    <ul class="plain">
      {files.map((file) => (
        <li key={file.name}>
          <a href={file.href} class="id">
            {file.name}
          </a>{" "}
          <small>{bytes(file.bytes)}</small>
        </li>
      ))}
    </ul>
  );
}

const MOST = 200;

export function NotUsed({ job }: { readonly job: Job }) {
  const loaded = useLoaded(
    async (signal) => {
      const { data } = await api.GET("/v1/jobs/{job}/results", { params: { path: { job: job.id } }, parseAs: "text", signal });
      const lines = ((data as string | undefined) ?? "").split("\n").filter(Boolean);
      const plots = lines.map((line) => JSON.parse(line) as Schemas["PlotRow"]);
      return plots.filter(({ verdict }) => verdict === "not_read" || verdict === "failed");
    },
    [job.id],
  );
  return (
    <section class="panel">
      <h2>Plots that were not used</h2>
      <Ready of={loaded} what="the plots">
        {(plots) => (
          <>
            <p class="note warn">{plural(plots.length, "plot")} could not be read or looked up. The others were placed.</p>
            <div class="scroll" tabIndex={0} role="region" aria-label="Table of plots that were not used">
              <table>
                <thead>
                  <tr>
                    <th scope="col">Plot</th>
                    <th scope="col">File</th>
                    <th scope="col">Why</th>
                  </tr>
                </thead>
                <tbody>
                  {plots.slice(0, MOST).map((plot, index) => (
                    <tr key={index}>
                      <td class="id">{plot.plot}</td>
                      <td class="id">{plot.file}</td>
                      <td>{asSentence(plot.sentence)}</td>
                    </tr>
                  ))}
                </tbody>
              </table>
            </div>
            {plots.length > MOST && <p class="meta">These are the first {MOST}. All are in plots.csv.</p>}
          </>
        )}
      </Ready>
    </section>
  );
}
