/** The part of a plane, in metres with y up, that a canvas shows. */

export interface View {
  /** Metres at the middle of the canvas. */
  readonly x: number;
  readonly y: number;
  /** Pixels for each metre. */
  readonly scale: number;
}

export interface Size {
  readonly width: number;
  readonly height: number;
}

export interface Box {
  readonly west: number;
  readonly south: number;
  readonly east: number;
  readonly north: number;
}

const MOST_SCALE = 2000;
const LEAST_SCALE = 1e-4;

export const toPixelX = (view: View, size: Size, x: number) => size.width / 2 + (x - view.x) * view.scale;
export const toPixelY = (view: View, size: Size, y: number) => size.height / 2 - (y - view.y) * view.scale;
export const toMetresX = (view: View, size: Size, x: number) => view.x + (x - size.width / 2) / view.scale;
export const toMetresY = (view: View, size: Size, y: number) => view.y - (y - size.height / 2) / view.scale;

/** The box around points, [x0, y0, x1, y1, ...]; null if there are none. */
export function boxAround(...all: readonly ArrayLike<number>[]): Box | null {
  let [west, south, east, north] = [Infinity, Infinity, -Infinity, -Infinity];
  for (const points of all) {
    for (let at = 0; at + 1 < points.length; at += 2) {
      west = Math.min(west, points[at]!);
      east = Math.max(east, points[at]!);
      south = Math.min(south, points[at + 1]!);
      north = Math.max(north, points[at + 1]!);
    }
  }
  return west <= east ? { west, south, east, north } : null;
}

/** The view that shows a whole box, with a margin in pixels. */
export function fit(box: Box, size: Size, margin = 36): View {
  const width = Math.max(box.east - box.west, 1e-3);
  const height = Math.max(box.north - box.south, 1e-3);
  const room = (pixels: number) => Math.max(pixels - 2 * margin, 40);
  const scale = Math.min(room(size.width) / width, room(size.height) / height, MOST_SCALE);
  return { x: (box.west + box.east) / 2, y: (box.south + box.north) / 2, scale };
}

/** Zooms by a factor about a pixel, which keeps its place. */
export function zoom(view: View, size: Size, factor: number, x: number, y: number): View {
  const scale = Math.min(Math.max(view.scale * factor, LEAST_SCALE), MOST_SCALE);
  const [left, up] = [x - size.width / 2, y - size.height / 2];
  return {
    x: view.x + left / view.scale - left / scale,
    y: view.y - up / view.scale + up / scale,
    scale,
  };
}

export function pan(view: View, right: number, down: number): View {
  return { ...view, x: view.x - right / view.scale, y: view.y + down / view.scale };
}

/** A round length for a scale bar, in metres: at most `most` pixels long. */
export function roundLength(view: View, most: number): number {
  const longest = most / view.scale;
  const power = 10 ** Math.floor(Math.log10(longest));
  const step = [5, 2, 1].find((one) => one * power <= longest) ?? 1;
  return step * power;
}

/** The convex hull of points, counter-clockwise, as [x0, y0, x1, y1, ...]. */
export function hull(points: ArrayLike<number>): number[] {
  const order = Array.from({ length: Math.floor(points.length / 2) }, (_, at) => at);
  order.sort((one, other) => points[2 * one]! - points[2 * other]! || points[2 * one + 1]! - points[2 * other + 1]!);
  const half = (sequence: readonly number[]) => {
    const kept: number[] = [];
    for (const at of sequence) {
      while (kept.length > 1 && turn(points, kept.at(-2)!, kept.at(-1)!, at) <= 0) kept.pop();
      kept.push(at);
    }
    return kept.slice(0, -1);
  };
  return [...half(order), ...half([...order].reverse())].flatMap((at) => [points[2 * at]!, points[2 * at + 1]!]);
}

function turn(points: ArrayLike<number>, a: number, b: number, c: number): number {
  const [x, y] = [points[2 * a]!, points[2 * a + 1]!];
  return (
    (points[2 * b]! - x) * (points[2 * c + 1]! - y) - (points[2 * b + 1]! - y) * (points[2 * c]! - x)
  );
}

/** Whether a point lies in a convex polygon that runs counter-clockwise. */
export function inHull(polygon: readonly number[], x: number, y: number): boolean {
  const count = polygon.length / 2;
  if (count < 3) return false;
  for (let at = 0; at < count; at++) {
    const next = (at + 1) % count;
    const [ax, ay, bx, by] = [polygon[2 * at]!, polygon[2 * at + 1]!, polygon[2 * next]!, polygon[2 * next + 1]!];
    if ((bx - ax) * (y - ay) - (by - ay) * (x - ax) < 0) return false;
  }
  return true;
}
