/** Draws two forests over each other, on the screen and into files. */

import type { Painter } from "../draw/painter";
import type { Palette } from "../draw/palette";
import { roundLength, type Size, toPixelX, toPixelY, type View } from "../draw/view";
import { metres } from "../parts/text";
import type { Overlay, Tree } from "./overlay";

export interface Shown {
  readonly query: boolean;
  readonly submap: boolean;
  readonly pairs: boolean;
  /** Residual vectors are drawn this many times as long; 0: not at all. */
  readonly stretch: number;
  /** Pixels from the left where the query ends and the submap begins; null: both everywhere. */
  readonly swipe: number | null;
  readonly selected: Tree | null;
}

const FAINT = 0.32;

export function drawOverlay(painter: Painter, overlay: Overlay, view: View, size: Size, palette: Palette, shown: Shown): void {
  painter.rectangle(0, 0, size.width, size.height, { fill: palette.paper });
  drawGrid(painter, view, size, palette);
  const pen = new Pen(painter, overlay, view, size, palette);
  const { swipe } = shown;
  if (swipe === null) {
    if (shown.submap) pen.footprint(overlay.submapHull, palette.map);
    if (shown.query) pen.footprint(overlay.queryHull, palette.query);
    if (shown.submap) pen.submapTrees();
    if (shown.pairs && shown.query && shown.submap) pen.pairs(shown.stretch);
    if (shown.query) pen.queryTrees();
  } else {
    painter.clipped(0, 0, swipe, size.height, () => {
      pen.footprint(overlay.queryHull, palette.query);
      pen.queryTrees();
    });
    painter.clipped(swipe, 0, size.width - swipe, size.height, () => {
      pen.footprint(overlay.submapHull, palette.map);
      pen.submapTrees();
    });
    painter.line([swipe, 0, swipe, size.height], { stroke: palette.ink, width: 1.5 });
  }
  if (shown.selected) pen.select(shown.selected);
  drawScale(painter, view, size, palette);
}

class Pen {
  private readonly radius: number;

  constructor(
    private readonly painter: Painter,
    private readonly overlay: Overlay,
    private readonly view: View,
    private readonly size: Size,
    private readonly palette: Palette,
  ) {
    // A stem is drawn larger than it is, but never so large that neighbours two metres apart touch.
    this.radius = Math.min(Math.max(0.42 * view.scale, 2.2), 7);
  }

  footprint(polygon: readonly number[], colour: string): void {
    if (polygon.length < 6) return;
    const points = polygon.map((value, at) => (at % 2 === 0 ? this.x(value) : this.y(value)));
    this.painter.line(points, { fill: colour, opacity: 0.06 }, true);
    this.painter.line(points, { stroke: colour, width: 1, dash: [3, 4], opacity: 0.55 }, true);
  }

  submapTrees(): void {
    const { submap, submapPaired, submapInside } = this.overlay;
    const { map, paper } = this.palette;
    this.each(submap, (x, y, at) => {
      const opacity = submapPaired[at] || submapInside[at] ? 1 : FAINT;
      const missed = this.overlay.pairs !== null && !submapPaired[at] && submapInside[at];
      this.painter.circle(x, y, this.radius + 1.6, {
        stroke: map,
        width: 1.8,
        opacity,
        fill: missed ? paper : undefined,
        ...(missed && { dash: [2.5, 2] }),
      });
    });
  }

  queryTrees(): void {
    const { query, queryPaired, queryInside, pairs } = this.overlay;
    const { query: colour, paper, miss } = this.palette;
    this.each(query, (x, y, at) => {
      if (pairs === null || queryPaired[at]) {
        this.painter.circle(x, y, this.radius, { fill: colour, stroke: paper, width: 0.8 });
      } else {
        // A cross: it differs from a filled circle without colours, too.
        const arm = this.radius * 0.85;
        const style = { stroke: queryInside[at] ? miss : colour, width: 2, opacity: queryInside[at] ? 1 : 0.6 };
        this.painter.line([x - arm, y - arm, x + arm, y + arm], style);
        this.painter.line([x - arm, y + arm, x + arm, y - arm], style);
      }
    });
  }

  pairs(stretch: number): void {
    const { query, submap, pairs } = this.overlay;
    for (const pair of pairs ?? []) {
      const [x, y] = [submap[2 * pair.submap]!, submap[2 * pair.submap + 1]!];
      const [dx, dy] = [query[2 * pair.query]! - x, query[2 * pair.query + 1]! - y];
      const [px, py] = [this.x(x), this.y(y)];
      if (!this.isNear(px, py)) continue;
      this.painter.line([px, py, this.x(x + dx), this.y(y + dy)], { stroke: this.palette.pair, width: 2 });
      if (stretch > 0) this.arrow(px, py, dx * stretch * this.view.scale, -dy * stretch * this.view.scale);
    }
  }

  select({ side, at }: Tree): void {
    const points = this.overlay[side];
    const [x, y] = [this.x(points[2 * at]!), this.y(points[2 * at + 1]!)];
    this.painter.circle(x, y, this.radius + 7, { stroke: this.palette.select, width: 2.5 });
  }

  private arrow(x: number, y: number, right: number, down: number): void {
    const length = Math.hypot(right, down);
    if (length < 2) return;
    const style = { stroke: this.palette.pair, width: 1.6 };
    const [endX, endY] = [x + right, y + down];
    const head = Math.min(5, length / 2) / length;
    this.painter.line([x, y, endX, endY], style);
    const wing = (turn: number) => [endX - head * (right - turn * down * 0.6), endY - head * (down + turn * right * 0.6)];
    this.painter.line([...wing(1), endX, endY, ...wing(-1)], style);
  }

  private each(points: Float64Array, draw: (x: number, y: number, at: number) => void): void {
    for (let at = 0; at < points.length / 2; at++) {
      const [x, y] = [this.x(points[2 * at]!), this.y(points[2 * at + 1]!)];
      if (this.isNear(x, y)) draw(x, y, at);
    }
  }

  private isNear(x: number, y: number): boolean {
    return x > -40 && y > -40 && x < this.size.width + 40 && y < this.size.height + 40;
  }

  private x(value: number): number {
    return toPixelX(this.view, this.size, value);
  }

  private y(value: number): number {
    return toPixelY(this.view, this.size, value);
  }
}

/** Lines at round metres. */
export function drawGrid(painter: Painter, view: View, size: Size, palette: Palette): void {
  const step = roundLength(view, Math.max(size.width, size.height) / 4);
  const style = { stroke: palette.grid, width: 1 };
  const [halfWidth, halfHeight] = [size.width / 2 / view.scale, size.height / 2 / view.scale];
  for (let x = Math.ceil((view.x - halfWidth) / step) * step; x <= view.x + halfWidth; x += step) {
    const at = Math.round(toPixelX(view, size, x)) + 0.5;
    painter.line([at, 0, at, size.height], style);
  }
  for (let y = Math.ceil((view.y - halfHeight) / step) * step; y <= view.y + halfHeight; y += step) {
    const at = Math.round(toPixelY(view, size, y)) + 0.5;
    painter.line([0, at, size.width, at], style);
  }
}

/** A bar of a round length at the lower left. */
export function drawScale(painter: Painter, view: View, size: Size, palette: Palette): void {
  const length = roundLength(view, 140);
  const [left, bottom, width] = [16, size.height - 16, length * view.scale];
  painter.line([left, bottom - 5, left, bottom, left + width, bottom, left + width, bottom - 5], {
    stroke: palette.soft,
    width: 1.5,
  });
  const shown = length >= 1 ? `${length} m` : metres(length);
  painter.text(left + width + 8, bottom, shown, { size: 12, fill: palette.soft });
}
