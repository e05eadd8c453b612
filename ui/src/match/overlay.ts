/** Two forests in one frame: the trees of a query under a pose, and those of the submap. */

import type { Schemas } from "urquhart-client";

import { type Box, boxAround, hull, inHull } from "../draw/view";

export interface Pose {
  readonly x: number;
  readonly y: number;
  readonly yaw: number;
}

/** A pair of trees that are the same one, by their places in the two lists. */
export interface Pair {
  readonly query: number;
  readonly submap: number;
  /** Metres between the two under the pose. */
  readonly residual: number;
}

export interface Overlay {
  /** What is shown, for titles: "candidate 1: p7". */
  readonly name: string;
  readonly submapId: string;
  readonly pose: Pose;
  /** Positions in the submap's frame, metres, [x0, y0, x1, y1, ...]. */
  readonly query: Float64Array;
  readonly submap: Float64Array;
  readonly queryIds: readonly string[];
  readonly submapIds: readonly string[];
  /** Null if the answer lists no pairs for this pose. */
  readonly pairs: readonly Pair[] | null;
  readonly queryPaired: Uint8Array;
  readonly submapPaired: Uint8Array;
  /** Whether a tree lies inside the footprint of the other side, where it should have a partner. */
  readonly queryInside: Uint8Array;
  readonly submapInside: Uint8Array;
  readonly queryHull: readonly number[];
  readonly submapHull: readonly number[];
  /** The box of the query's trees, with their surroundings. */
  readonly box: Box;
}

interface Trees {
  readonly xy: readonly (readonly number[])[];
  readonly ids: readonly string[];
}

/** Lays a query over a submap. `inliers`: the pairs as the answer lists them. */
export function layOver(
  about: { name: string; submapId: string; pose: Pose },
  query: Trees,
  submap: Trees,
  inliers: readonly Schemas["Inlier"][] | null,
): Overlay {
  const moved = transformed(query.xy, about.pose);
  const fixed = Float64Array.from(submap.xy.flat());
  const queryPaired = new Uint8Array(query.ids.length);
  const submapPaired = new Uint8Array(submap.ids.length);
  const pairs = inliers && pairsOf(inliers, query.ids, submap.ids);
  for (const pair of pairs ?? []) queryPaired[pair.query] = submapPaired[pair.submap] = 1;
  const [queryHull, submapHull] = [hull(moved), hull(fixed)];
  return {
    ...about,
    query: moved,
    submap: fixed,
    queryIds: query.ids,
    submapIds: submap.ids,
    pairs,
    queryPaired,
    submapPaired,
    queryInside: insideOf(submapHull, moved),
    submapInside: insideOf(queryHull, fixed),
    queryHull,
    submapHull,
    box: boxAround(moved) ?? boxAround(fixed) ?? { west: 0, south: 0, east: 1, north: 1 },
  };
}

/** Points of the query in the submap's frame: R(yaw) p + t. */
export function transformed(xy: readonly (readonly number[])[], pose: Pose): Float64Array {
  const [cosine, sine] = [Math.cos(pose.yaw), Math.sin(pose.yaw)];
  const moved = new Float64Array(2 * xy.length);
  xy.forEach(([x, y], at) => {
    moved[2 * at] = cosine * x! - sine * y! + pose.x;
    moved[2 * at + 1] = sine * x! + cosine * y! + pose.y;
  });
  return moved;
}

function pairsOf(
  inliers: readonly Schemas["Inlier"][],
  queryIds: readonly string[],
  submapIds: readonly string[],
): Pair[] {
  const places = (ids: readonly string[]) => new Map(ids.map((id, at) => [id, at]));
  const [inQuery, inSubmap] = [places(queryIds), places(submapIds)];
  return inliers.flatMap(({ query, submap, residual }) => {
    const [one, other] = [inQuery.get(query), inSubmap.get(submap)];
    return one === undefined || other === undefined ? [] : [{ query: one, submap: other, residual }];
  });
}

function insideOf(polygon: readonly number[], points: Float64Array): Uint8Array {
  const inside = new Uint8Array(points.length / 2);
  for (let at = 0; at < inside.length; at++) {
    inside[at] = inHull(polygon, points[2 * at]!, points[2 * at + 1]!) ? 1 : 0;
  }
  return inside;
}

/** How many trees have no partner although the other side covers their place. */
export function missing(paired: Uint8Array, inside: Uint8Array): number {
  let count = 0;
  for (let at = 0; at < paired.length; at++) if (!paired[at] && inside[at]) count++;
  return count;
}

/** A tree of either side. */
export interface Tree {
  readonly side: "query" | "submap";
  readonly at: number;
}

/** The tree nearest to a place, at most `reach` metres away. */
export function nearest(overlay: Overlay, x: number, y: number, reach: number): Tree | null {
  let best: Tree | null = null;
  let least = reach * reach;
  for (const side of ["query", "submap"] as const) {
    const points = overlay[side];
    for (let at = 0; at < points.length / 2; at++) {
      const away = (points[2 * at]! - x) ** 2 + (points[2 * at + 1]! - y) ** 2;
      if (away < least) [least, best] = [away, { side, at }];
    }
  }
  return best;
}

/** The pair that a tree is part of. */
export function pairOf(overlay: Overlay, tree: Tree): Pair | undefined {
  return overlay.pairs?.find((pair) => pair[tree.side] === tree.at);
}
