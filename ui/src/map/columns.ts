/** Landmarks of a map frame as the service sends them: binary columns. */

import { call } from "../service/api";

export interface Columns {
  /** Of the map frame; positions and boxes are relative to it. */
  readonly origin: readonly [number, number];
  readonly frame: string;
  /** Trees in all, and every how-many-th of them is here. */
  readonly landmarks: number;
  readonly every: number;
  readonly submaps: readonly string[];
  readonly sessions: readonly string[];
  readonly sessionOf: readonly number[];
  /** When each submap was observed, in seconds since 1970; NaN if nobody said. */
  readonly stamps: Float64Array;
  /** [west, south, east, north] of each submap. */
  readonly boxes: Float32Array;
  /** Where the positions of each submap begin; one more than there are submaps. */
  readonly starts: Uint32Array;
  readonly xy: Float32Array;
}

const MAGIC = "URQCOL1\n";

export async function readColumns(
  collection: string,
  query: Readonly<Record<string, string>>,
  base: readonly [number, number],
  signal: AbortSignal,
): Promise<Columns> {
  const path = `/v1/collections/${encodeURIComponent(collection)}/landmarks?${new URLSearchParams(query)}`;
  const response = await call(path, { signal });
  return rebased(columnsOf(await response.arrayBuffer()), base);
}

/** The same with another origin, so that views stay right when another part of a map is loaded. */
function rebased(columns: Columns, base: readonly [number, number]): Columns {
  const [east, north] = [columns.origin[0] - base[0], columns.origin[1] - base[1]];
  const move = (values: Float32Array) => values.map((value, at) => value + (at % 2 ? north : east));
  return { ...columns, origin: base, boxes: move(columns.boxes), xy: move(columns.xy) };
}

export function columnsOf(data: ArrayBuffer): Columns {
  const text = new TextDecoder();
  if (text.decode(data.slice(0, MAGIC.length)) !== MAGIC) throw new Error("The service sent something else than landmarks.");
  const length = new DataView(data).getUint32(MAGIC.length, true);
  const begin = MAGIC.length + 4;
  const head = JSON.parse(text.decode(data.slice(begin, begin + length))) as {
    origin: [number, number];
    frame_id: string;
    landmarks: number;
    every: number;
    submaps: string[];
    sessions: string[];
    stamps: (number | null)[];
    session_of: number[];
  };
  const count = head.submaps.length;
  const at = begin + length;
  const counts = new Uint32Array(data, at + 16 * count, count);
  const starts = new Uint32Array(count + 1);
  counts.forEach((value, submap) => (starts[submap + 1] = starts[submap]! + value));
  return {
    origin: head.origin,
    frame: head.frame_id,
    landmarks: head.landmarks,
    every: head.every,
    submaps: head.submaps,
    sessions: head.sessions,
    sessionOf: head.session_of,
    stamps: Float64Array.from(head.stamps, (one) => one ?? NaN),
    boxes: new Float32Array(data, at, 4 * count),
    starts,
    xy: new Float32Array(data, at + 20 * count),
  };
}
