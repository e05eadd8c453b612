/** Constraints between submaps and the moves of a map, as lines over the trees. */

import { ok, type Schemas } from "urquhart-client";

import type { Palette } from "../draw/palette";
import { type Size, toPixelX, toPixelY, type View } from "../draw/view";
import { api } from "../service/api";
import type { Columns } from "./columns";

export type Constraint = Schemas["KeptConstraint"];
type State = Constraint["state"];

export interface Constraints {
  readonly rows: readonly Constraint[];
  /** Whether the collection has more than are here. */
  readonly more: boolean;
}

export const STATES = {
  active: "used by maps",
  stale: "stale: its trees changed since",
  refused: "refused by the last map",
} as const satisfies Record<State, string>;

/** Five pages are 5,000 lines, which are drawn in a few milliseconds, and more than an eye tells apart. */
const PAGE = 1000;
const PAGES = 5;

export async function readConstraints(collection: string, signal: AbortSignal): Promise<Constraints> {
  const rows: Constraint[] = [];
  let cursor: string | undefined;
  for (let page = 0; page < PAGES; page++) {
    const query = { limit: PAGE, ...(cursor && { cursor }) };
    const asked = { params: { path: { collection }, query }, signal };
    const read = (await ok(api.GET("/v1/collections/{collection}/constraints", asked))) as Schemas["ConstraintPage"];
    rows.push(...read.constraints);
    if (!read.next) return { rows, more: false };
    cursor = read.next;
  }
  return { rows, more: true };
}

/** Lines of each state, from the middle of one submap to that of another: x, y, x, y. */
export type Lines = Readonly<Record<State, Float32Array>>;

export function linesBetween(columns: Columns, rows: readonly Constraint[], hidden: (submap: number) => boolean): Lines {
  const number = new Map(columns.submaps.map((id, at) => [id, at]));
  const made: Record<State, number[]> = { active: [], stale: [], refused: [] };
  for (const row of rows) {
    const [from, to] = [number.get(row.from), number.get(row.to)];
    if (from === undefined || to === undefined || hidden(from) || hidden(to)) continue;
    made[row.state].push(...middle(columns, from), ...middle(columns, to));
  }
  return {
    active: Float32Array.from(made.active),
    stale: Float32Array.from(made.stale),
    refused: Float32Array.from(made.refused),
  };
}

function middle({ boxes }: Columns, submap: number): readonly [number, number] {
  const [west, south, east, north] = boxes.subarray(4 * submap, 4 * submap + 4);
  return [(west! + east!) / 2, (south! + north!) / 2];
}

/** Each state has a dash of its own, so that nobody needs the colours to tell them apart. */
const DASHES: Readonly<Record<State, readonly number[]>> = { active: [], stale: [2, 4], refused: [9, 5] };

export function drawLines(context: CanvasRenderingContext2D, lines: Lines, view: View, size: Size, palette: Palette): void {
  const strokes = { active: palette.pair, stale: palette.soft, refused: palette.miss };
  context.save();
  context.globalAlpha = 0.85;
  for (const state of ["active", "stale", "refused"] as const) {
    context.strokeStyle = strokes[state];
    context.lineWidth = state === "active" ? 1.5 : 2;
    context.setLineDash([...DASHES[state]]);
    stroke(context, lines[state], view, size);
  }
  context.restore();
}

/** All lines in one path, but for those that lie outside of the view on one side. */
function stroke(context: CanvasRenderingContext2D, xy: Float32Array, view: View, size: Size): void {
  context.beginPath();
  for (let at = 0; at < xy.length; at += 4) {
    const [x1, x2] = [toPixelX(view, size, xy[at]!), toPixelX(view, size, xy[at + 2]!)];
    const [y1, y2] = [toPixelY(view, size, xy[at + 1]!), toPixelY(view, size, xy[at + 3]!)];
    if (Math.max(x1, x2) < 0 || Math.max(y1, y2) < 0 || Math.min(x1, x2) > size.width || Math.min(y1, y2) > size.height) continue;
    context.moveTo(x1, y1);
    context.lineTo(x2, y2);
  }
  context.stroke();
}

/** Where a map puts submaps, beside where they are: x, y now, and x, y in the map. */
export interface Moves {
  readonly job: string;
  readonly xy: Float32Array;
  /** The longest move, in metres. */
  readonly longest: number;
}

/** The moves that the map of a job makes in a map frame. Compares the poses of at most 5,000 submaps. */
export async function readMoves(collection: string, map: string, columns: Columns, signal: AbortSignal): Promise<Moves> {
  const path = { collection, map };
  const { poses } = await ok(api.GET("/v1/collections/{collection}/maps/{map}", { params: { path }, signal }));
  const there = new Map(poses.map((one) => [one.id, one.map_pose]));
  const xy: number[] = [];
  let longest = 0;
  let cursor: string | undefined;
  for (let page = 0; page < PAGES; page++) {
    const query = { limit: PAGE, frame_id: columns.frame, ...(cursor && { cursor }) };
    const asked = { params: { path: { collection }, query }, signal };
    const read = (await ok(api.GET("/v1/collections/{collection}/submaps", asked))) as Schemas["SubmapPage"];
    for (const { id, map_pose: here } of read.submaps) {
      const target = there.get(id);
      if (here == null || target == null || target.frame_id !== here.frame_id) continue;
      const [east, north] = columns.origin;
      xy.push(here.x - east, here.y - north, target.x - east, target.y - north);
      longest = Math.max(longest, Math.hypot(target.x - here.x, target.y - here.y));
    }
    if (!read.next) break;
    cursor = read.next;
  }
  return { job: map, xy: Float32Array.from(xy), longest };
}

/** A ring where a submap is, a line to where the map puts it, and a dot there. */
export function drawMoves(context: CanvasRenderingContext2D, { xy }: Moves, view: View, size: Size, palette: Palette): void {
  context.save();
  context.strokeStyle = context.fillStyle = palette.query;
  context.lineWidth = 2;
  stroke(context, xy, view, size);
  for (const end of [0, 2]) {
    context.beginPath();
    for (let at = end; at < xy.length; at += 4) {
      const [x, y] = [toPixelX(view, size, xy[at]!), toPixelY(view, size, xy[at + 1]!)];
      if (x < -5 || y < -5 || x > size.width + 5 || y > size.height + 5) continue;
      context.moveTo(x + 4, y);
      context.arc(x, y, 4, 0, 2 * Math.PI);
    }
    if (end === 0) context.stroke();
    else context.fill();
  }
  context.restore();
}
