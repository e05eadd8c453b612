/** Try it: drop a file of trees, see what was understood, look it up, or store it. */

import { useCallback, useMemo, useState } from "preact/hooks";
import { ok, pages, ProblemError, type Schemas } from "urquhart-client";

import { Canvas } from "../draw/canvas";
import { CanvasPainter } from "../draw/painter";
import { usePalette } from "../draw/palette";
import { boxAround, fit, type Size, toPixelX, toPixelY, type View } from "../draw/view";
import { drawGrid, drawScale } from "../match/draw-overlay";
import { Message, Ready, Title } from "../parts/common";
import { at, go, setQuery, useAddress } from "../parts/router";
import { asSentence, bytes, percent, plural } from "../parts/text";
import { api, sentenceOf } from "../service/api";
import { useLoaded } from "../service/load";
import { VERDICTS } from "../match/why";
import { may, type Session } from "../service/session";
import { NewCollection } from "./collections";
import { inFields, type Options, OptionsForm, Refused } from "./try-options";
import { Store } from "./try-store";

type StemMap = Schemas["StemMapAnswer"];

const ACCEPTED = ".csv,.txt,.tsv,.xlsx,.gpkg,.fgb,.geojson,.json,.kml,.gpx,.las,.laz,.parquet";

interface Dropped {
  readonly name: string;
  readonly data: Blob;
}

export function TryPage({ session }: { readonly session: Session }) {
  const { query } = useAddress();
  const [file, setFile] = useState<Dropped | null>(null);
  const [options, setOptions] = useState<Options>({});
  const [making, setMaking] = useState(false);
  const [made, setMade] = useState<readonly string[]>([]);
  const collections = useLoaded(async (signal) => {
    const all: string[] = [];
    const read = (cursor?: string) =>
      ok(api.GET("/v1/collections", { params: { query: cursor === undefined ? {} : { cursor } }, signal }));
    for await (const page of pages(read)) all.push(...page.collections.map(({ id }) => id));
    return all;
  }, []);
  return (
    <main class="page">
      <Title>Try it</Title>
      <header class="page-head">
        <h1>Where is this?</h1>
      </header>
      <Drop onFile={(dropped) => (setFile(dropped), setOptions({}))} file={file} />
      <Ready of={collections} what="the collections">
        {(listed) => {
          // A collection that was made here is chosen at once, before the list is read again.
          const known = [...new Set([...listed, ...made])].sort();
          return known.length === 0 ? (
            <NoCollection session={session} onNew={() => setMaking(true)} />
          ) : (
            file && (
              <Reading
                key={`${file.name}${file.data.size}`}
                file={file}
                options={options}
                onOptions={setOptions}
                collections={known}
                collection={known.find((name) => name === query.get("collection")) ?? known[0]!}
                session={session}
                onNew={() => setMaking(true)}
              />
            )
          );
        }}
      </Ready>
      {making && (
        <NewCollection
          onClose={() => setMaking(false)}
          onMade={(id) => {
            setMaking(false);
            setMade([...made, id]);
            setQuery({ collection: id });
          }}
        />
      )}
    </main>
  );
}

function NoCollection({ session, onNew }: { readonly session: Session; readonly onNew: () => void }) {
  return (
    <Message title="There is no collection yet">
      <p>A collection holds the forests that plots are looked up in. Make one, and store a stem map in it. A file that you dropped stays here.</p>
      {may(session, "admin") ? (
        <button type="button" class="primary" onClick={onNew}>
          New collection …
        </button>
      ) : (
        <p>Your key may not make collections: that needs the scope admin.</p>
      )}
    </Message>
  );
}

function Drop({ onFile, file }: { readonly onFile: (file: Dropped) => void; readonly file: Dropped | null }) {
  const [over, setOver] = useState(false);
  const take = (list: FileList | null | undefined) => {
    const first = list?.[0];
    if (first) onFile({ name: first.name, data: first });
  };
  return (
    <label
      class={`drop ${over ? "over" : ""}`}
      onDragOver={(event) => {
        event.preventDefault();
        setOver(true);
      }}
      onDragLeave={() => setOver(false)}
      onDrop={(event) => {
        event.preventDefault();
        setOver(false);
        take(event.dataTransfer?.files);
      }}
    >
      <b>{file ? file.name : "Drop a file of trees here"}</b>
      <span>
        {file
          ? `${bytes(file.data.size)} · drop another one, or choose it`
          : "or choose one: CSV, xlsx, GeoPackage, GeoJSON, KML, GPX, LAS and more. It is read, not stored."}
      </span>
      <input type="file" accept={ACCEPTED} onChange={(event) => take(event.currentTarget.files)} />
    </label>
  );
}

interface ReadingProps {
  readonly file: Dropped;
  readonly options: Options;
  readonly onOptions: (options: Options) => void;
  readonly collections: readonly string[];
  readonly collection: string;
  readonly session: Session;
  readonly onNew: () => void;
}

function Reading(props: ReadingProps) {
  const { file, options, onOptions } = props;
  const read = useLoaded(
    (signal) =>
      ok(
        api.POST("/v1/stem-maps", {
          params: { query: { file: file.name, ...options } },
          body: file.data as unknown as string,
          bodySerializer: (body: unknown) => body as BodyInit,
          headers: { "Content-Type": "application/octet-stream" },
          signal,
        }),
      ),
    [file.name, file.data.size, options],
  );
  return (
    <>
      {read.error instanceof ProblemError ? (
        <Refused error={read.error} />
      ) : (
        <Ready of={read} what="the file">
          {(map) => <Understood {...props} map={map} />}
        </Ready>
      )}
      <OptionsForm options={options} onOptions={onOptions} open={read.error !== undefined} />
    </>
  );
}

function Understood(props: ReadingProps & { readonly map: StemMap }) {
  const { map, collections, collection, session, file, options } = props;
  const [plot, setPlot] = useState(0);
  const [busy, setBusy] = useState("");
  const [refusal, setRefusal] = useState("");
  const chosen = map.plots[plot] ?? map.plots[0];
  const trees = chosen?.landmarks ?? [];
  const attempt = async (what: string, work: () => Promise<void>) => {
    setBusy(what);
    setRefusal("");
    try {
      await work();
    } catch (error) {
      setRefusal(inFields(sentenceOf(error)));
    }
    setBusy("");
  };
  const stores = may(session, "write");
  const [answer, setAnswer] = useState<Schemas["QueryAnswer"] | null>(null);
  const lookUp = () =>
    attempt("look", async () => {
      const body = { landmarks: trees, store: stores, explain: true };
      const found = await ok(api.POST("/v1/collections/{collection}/queries", { params: { path: { collection } }, body }));
      if (found.id != null) go(at("collections", collection, "queries", found.id));
      else setAnswer(found);
    });
  return (
    <section class="understood">
      <div class="panel">
        <h2>What was understood</h2>
        <p>{asSentence(map.understood)}</p>
        <p class="meta">
          {plural(map.rows.read, "row")} read
          {map.rows.skipped > 0 && `, ${map.rows.skipped} left out`}
          {map.rows.further_stems > 0 && `, ${plural(map.rows.further_stems, "further stem")}`}
          {map.rows.merged > 0 && `, ${map.rows.merged} merged`}
          {map.crs && ` · ${map.crs}`}
        </p>
        {map.plots.length > 1 && (
          <label>
            Plot
            <select value={plot} onChange={(event) => setPlot(Number(event.currentTarget.value))}>
              {map.plots.map((one, index) => (
                <option key={one.name} value={index}>
                  {one.name} ({plural(one.landmarks.length, "tree")})
                </option>
              ))}
            </select>
          </label>
        )}
        <div class="beside">
          <label>
            Collection
            <select value={collection} onChange={(event) => setQuery({ collection: event.currentTarget.value })}>
              {collections.map((name) => (
                <option key={name}>{name}</option>
              ))}
            </select>
          </label>
          {may(session, "admin") && (
            <button type="button" class="quiet" onClick={props.onNew}>
              New collection …
            </button>
          )}
        </div>
        {refusal && (
          <p class="note bad" role="alert">
            {refusal}
          </p>
        )}
        <p class="actions">
          <button type="button" class="primary" onClick={lookUp} disabled={busy !== "" || trees.length === 0}>
            {busy === "look" ? "Looking …" : `Find ${plural(trees.length, "tree")}`}
          </button>
        </p>
        {stores && <Store file={file} options={options} map={map} collection={collection} />}
        {answer && <Told answer={answer} />}
      </div>
      <Preview trees={trees} />
    </section>
  );
}

/** The answer to whoever may not store one, and so has no page of it. */
function Told({ answer }: { readonly answer: Schemas["QueryAnswer"] }) {
  const best = answer.candidates[0];
  return (
    <div role="status">
      <p>
        <span class={`badge ${answer.verdict}`}>{VERDICTS[answer.verdict]}</span>{" "}
        {answer.verdict !== "no_match" && best && <b class="id">{best.submap_id}</b>}
      </p>
      <p>
        {asSentence(answer.sentences?.[answer.reason] ?? answer.reason)}
        {best && ` Confidence ${percent(best.confidence)}, ${plural(best.inlier_count, "pair")}.`}
      </p>
      <small>The page with the drawing needs an answer that is stored, and so a key with the scope write.</small>
    </div>
  );
}

function Preview({ trees }: { readonly trees: readonly { readonly x: number; readonly y: number }[] }) {
  const palette = usePalette();
  const [size, setSize] = useState<Size | null>(null);
  const [moved, setMoved] = useState<View | null>(null);
  const box = useMemo(() => boxAround(trees.flatMap(({ x, y }) => [x, y])), [trees]);
  const view = moved ?? (size && box && fit(box, size, 24));
  const draw = useCallback(
    (canvas: HTMLCanvasElement, pixels: Size, ratio: number) => {
      const context = canvas.getContext("2d");
      if (context === null || view === null) return;
      context.setTransform(ratio, 0, 0, ratio, 0, 0);
      const painter = new CanvasPainter(context);
      painter.rectangle(0, 0, pixels.width, pixels.height, { fill: palette.paper });
      drawGrid(painter, view, pixels, palette);
      const radius = Math.min(Math.max(0.42 * view.scale, 1.5), 6);
      for (const { x, y } of trees) {
        painter.circle(toPixelX(view, pixels, x), toPixelY(view, pixels, y), radius, { fill: palette.query });
      }
      drawScale(painter, view, pixels, palette);
    },
    [trees, view?.x, view?.y, view?.scale, palette],
  );
  return (
    <div class="stage preview">
      <Canvas
        label={`${plural(trees.length, "tree")} of the file.`}
        view={view}
        onView={setMoved}
        onSize={setSize}
        onFit={() => setMoved(null)}
        draw={draw}
      />
    </div>
  );
}
