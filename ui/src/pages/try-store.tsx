/** Stores a dropped file as a stand: its name, how it is cut into submaps, and what became of it. */

import { useState } from "preact/hooks";
import { ok, ProblemError, type Schemas } from "urquhart-client";

import { boxAround } from "../draw/view";
import { at, Link } from "../parts/router";
import { asSentence, plural } from "../parts/text";
import { api, sentenceOf } from "../service/api";
import { inFields, type Options, RADIUS, SPACING } from "./try-options";

type StemMap = Schemas["StemMapAnswer"];
type Receipt = Schemas["StandReceipt"];

interface StoreProps {
  readonly file: { readonly name: string; readonly data: Blob };
  readonly options: Options;
  readonly map: StemMap;
  readonly collection: string;
}

export function Store({ file, options, map, collection }: StoreProps) {
  const [stand, setStand] = useState(map.name);
  const [cut, setCut] = useState(() => cuttingOf(map));
  const [busy, setBusy] = useState(false);
  const [refusal, setRefusal] = useState("");
  const [stored, setStored] = useState<{ readonly collection: string; readonly receipt: Receipt } | null>(null);
  const store = async (event: Event) => {
    event.preventDefault();
    setBusy(true);
    setRefusal("");
    setStored(null);
    const cutting = cut.one ? { one_submap: true } : { radius: Number(cut.radius), spacing: Number(cut.spacing) };
    try {
      const receipt = await ok(
        api.PUT("/v1/collections/{collection}/stands/{stand}", {
          params: {
            path: { collection, stand },
            query: { file: file.name, ...options, ...cutting },
            header: { "if-none-match": "*" },
          },
          body: file.data as unknown as string,
          bodySerializer: (sent: unknown) => sent as BodyInit,
          headers: { "Content-Type": "application/octet-stream" },
        }),
      );
      setStored({ collection, receipt });
    } catch (error) {
      const taken = error instanceof ProblemError && error.status === 412;
      setRefusal(taken ? `${collection} has a stand ${stand} already: enter another name.` : inFields(sentenceOf(error)));
    }
    setBusy(false);
  };
  return (
    <form class="store" onSubmit={store}>
      <div class="options">
        <label>
          Name of the stand
          <input required value={stand} onInput={(event) => setStand(event.currentTarget.value)} autoComplete="off" />
        </label>
        <CuttingFields cut={cut} onCut={setCut} plots={map.plots.length} />
      </div>
      {refusal && (
        <p class="note bad" role="alert">
          {refusal}
        </p>
      )}
      <p class="actions">
        <button type="submit" disabled={busy}>
          {busy ? "Storing …" : `Store in ${collection}`}
        </button>
      </p>
      {stored && <Stored collection={stored.collection} receipt={stored.receipt} />}
    </form>
  );
}

/** What was stored, what was left out of it, and where to see it. */
function Stored({ collection, receipt }: { readonly collection: string; readonly receipt: Receipt }) {
  const { name, frame_id, trees, submaps, understood } = receipt;
  const map = at("collections", collection, "map");
  return (
    <div role="status" class="note good">
      <p>
        <b>
          Stored as the stand {name} in {collection}: {plural(trees, "tree")} in {plural(submaps, "submap")}.
        </b>{" "}
        {asSentence(understood)}
      </p>
      <p>
        <Link to={`${map}?${new URLSearchParams({ frame: frame_id })}`}>See it on the map</Link> ·{" "}
        <Link to={at("collections", collection)}>All submaps of {collection}</Link>
      </p>
    </div>
  );
}

/** What a stand is cut into: one submap for each plot, or overlapping discs, in metres. */
interface Cutting {
  readonly one: boolean;
  readonly radius: string;
  readonly spacing: string;
}

const USUAL = { radius: 30, spacing: 20 };

/** One submap if each plot is so small that one disc covers it. */
function cuttingOf(map: StemMap): Cutting {
  const small = map.plots.every(({ landmarks }) => {
    const box = boxAround(landmarks.flatMap(({ x, y }) => [x, y]));
    return box === null || Math.hypot(box.east - box.west, box.north - box.south) <= 2 * USUAL.radius;
  });
  return { one: small, radius: String(USUAL.radius), spacing: String(USUAL.spacing) };
}

function CuttingFields(props: { readonly cut: Cutting; readonly onCut: (cut: Cutting) => void; readonly plots: number }) {
  const { cut, onCut } = props;
  const metres = (label: string, name: "radius" | "spacing") => (
    <label>
      {label}
      <input
        type="number"
        min="1"
        max="1000000"
        step="any"
        required
        value={cut[name]}
        onInput={(event) => onCut({ ...cut, [name]: event.currentTarget.value })}
      />
    </label>
  );
  return (
    <>
      <label>
        Stored as
        <select value={cut.one ? "one" : "discs"} onChange={(event) => onCut({ ...cut, one: event.currentTarget.value === "one" })}>
          <option value="one">{props.plots > 1 ? "one submap for each plot" : "one submap"}</option>
          <option value="discs">overlapping submaps</option>
        </select>
      </label>
      {!cut.one && metres(RADIUS, "radius")}
      {!cut.one && metres(SPACING, "spacing")}
    </>
  );
}
