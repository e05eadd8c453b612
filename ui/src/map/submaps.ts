/** Submaps as shapes: outlines, colours by session, and which one lies under the pointer. */

import { type Box, hull, inHull } from "../draw/view";
import type { Columns } from "./columns";
import { HIDDEN } from "./layer";

/** Colour 0 is for submaps without a session; sessions take the others in turn. */
export const COLOURS = 8;

export const colourOf = (session: number) => (session < 0 ? 0 : 1 + (session % COLOURS));

/** The outline of a submap: the convex hull of its trees, or its box if not all of them are here. */
export function outline(columns: Columns, submap: number): number[] {
  const { every, xy, starts, boxes } = columns;
  if (every === 1) {
    const found = hull(xy.subarray(2 * starts[submap]!, 2 * starts[submap + 1]!));
    if (found.length >= 6) return found;
  }
  const [west, south, east, north] = boxes.subarray(4 * submap, 4 * submap + 4);
  return [west!, south!, east!, south!, east!, north!, west!, north!];
}

export function outlines(columns: Columns): readonly number[][] {
  return columns.submaps.map((_, submap) => outline(columns, submap));
}

/** Which submaps are not shown. */
export type Hidden = (submap: number) => boolean;

/** The colour of every tree. */
export function treeColours(columns: Columns, hidden: Hidden): Uint8Array {
  const colour = new Uint8Array(columns.xy.length / 2);
  columns.submaps.forEach((_, submap) => {
    const own = hidden(submap) ? HIDDEN : colourOf(columns.sessionOf[submap]!);
    colour.fill(own, columns.starts[submap], columns.starts[submap + 1]);
  });
  return colour;
}

/** The colour of every vertex of the outlines. */
export function outlineColours(columns: Columns, shapes: readonly number[][], hidden: Hidden): Uint8Array {
  const colour = new Uint8Array(shapes.reduce((sum, shape) => sum + shape.length, 0));
  let at = 0;
  shapes.forEach((shape, submap) => {
    colour.fill(hidden(submap) ? HIDDEN : colourOf(columns.sessionOf[submap]!), at, at + shape.length);
    at += shape.length;
  });
  return colour;
}

/** The outlines as pairs of vertices. */
export function linesOf(shapes: readonly number[][]): Float32Array {
  const count = shapes.reduce((sum, shape) => sum + shape.length, 0);
  const xy = new Float32Array(2 * count);
  let at = 0;
  shapes.forEach((shape) => {
    for (let corner = 0; corner < shape.length; corner += 2) {
      const next = (corner + 2) % shape.length;
      xy.set([shape[corner]!, shape[corner + 1]!, shape[next]!, shape[next + 1]!], 2 * at);
      at += 2;
    }
  });
  return xy;
}

/** The submap under a place: of those that cover it, the one whose middle is nearest; null if none does. */
export function submapAt(columns: Columns, shapes: readonly number[][], hidden: Hidden, x: number, y: number): number | null {
  let best: number | null = null;
  let least = Infinity;
  const { boxes } = columns;
  for (let submap = 0; submap < shapes.length; submap++) {
    const [west, south, east, north] = boxes.subarray(4 * submap, 4 * submap + 4);
    if (hidden(submap) || x < west! || x > east! || y < south! || y > north! || !inHull(shapes[submap]!, x, y)) continue;
    const away = Math.hypot(x - (west! + east!) / 2, y - (south! + north!) / 2);
    if (away < least) [best, least] = [submap, away];
  }
  return best;
}

/** The mean side of the boxes of all submaps, in metres. */
export function sideOf(columns: Columns): number {
  let sum = 0;
  for (let at = 0; at < columns.boxes.length; at += 4) sum += columns.boxes[at + 2]! - columns.boxes[at]!;
  return sum / Math.max(columns.submaps.length, 1);
}

/** How opaque outlines are drawn: the more submaps lie over each other, the fainter, so that trees stay visible. */
export function inkOf(columns: Columns): number {
  const whole = boxOf(columns);
  if (whole === null) return 1;
  let sum = 0;
  for (let at = 0; at < columns.boxes.length; at += 4) {
    const [west, south, east, north] = columns.boxes.subarray(at, at + 4);
    sum += (east! - west!) * (north! - south!);
  }
  const layers = sum / Math.max((whole.east - whole.west) * (whole.north - whole.south), 1e-6);
  return Math.min(Math.max(0.8 / layers, 0.14), 0.8);
}

/** The box around all submaps, or one. */
export function boxOf(columns: Columns, submap?: number): Box | null {
  const { boxes } = columns;
  const some = submap === undefined ? boxes : boxes.subarray(4 * submap, 4 * submap + 4);
  if (some.length === 0) return null;
  let [west, south, east, north] = [Infinity, Infinity, -Infinity, -Infinity];
  for (let at = 0; at < some.length; at += 4) {
    west = Math.min(west, some[at]!);
    south = Math.min(south, some[at + 1]!);
    east = Math.max(east, some[at + 2]!);
    north = Math.max(north, some[at + 3]!);
  }
  return { west, south, east, north };
}
