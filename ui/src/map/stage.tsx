/** The drawing of a map: trees and outlines by WebGL, the chosen submap and the scale above them. */

import { useCallback, useEffect, useMemo, useRef, useState } from "preact/hooks";

import { Canvas } from "../draw/canvas";
import { CanvasPainter } from "../draw/painter";
import { usePalette } from "../draw/palette";
import { type Box, fit, type Size, toMetresX, toMetresY, toPixelX, toPixelY, type View, zoom } from "../draw/view";
import { drawScale } from "../match/draw-overlay";
import { Message } from "../parts/common";
import { at, Link, setQuery, useAddress } from "../parts/router";
import { plural } from "../parts/text";
import type { Columns } from "./columns";
import { Layer } from "./layer";
import { drawLines, drawMoves, linesBetween } from "./constraints";
import { momentsOf, type Over, OverLegend, TimeSlider } from "./over";
import { boxOf, colourOf, type Hidden, inkOf, linesOf, outlineColours, outlines, sideOf, submapAt, treeColours } from "./submaps";

interface StageProps {
  readonly collection: string;
  readonly columns: Columns;
  readonly over: Over;
  readonly part: string | null;
  readonly onPart: (part: string | null) => void;
}

const SETTLED = 300;
const WIDER = 0.5;
const LABELS = 60;
const LEAST_SIDE = 14;

export function MapStage({ collection, columns, over, part, onPart }: StageProps) {
  const palette = usePalette();
  const { query } = useAddress();
  const under = useRef<HTMLCanvasElement>(null);
  const layer = useRef<Layer | null>(null);
  const [broken, setBroken] = useState(false);
  const [size, setSize] = useState<Size | null>(null);
  const [moved, setMoved] = useState<View | null>(() => viewOf(query, columns));
  const [until, setUntil] = useState<number | null>(() => (query.get("until") ? Number(query.get("until")) : null));
  const hidden = useCallback<Hidden>((submap) => until !== null && columns.stamps[submap]! > until, [columns, until]);
  const moments = useMemo(() => momentsOf(columns), [columns]);
  const lines = useMemo(() => linesBetween(columns, over.constraints?.rows ?? [], hidden), [columns, over.constraints, hidden]);
  const shapes = useMemo(() => outlines(columns), [columns]);
  const chosen = columns.submaps.indexOf(query.get("submap") ?? "");
  const mark = useMemo(() => markOf(query.get("mark"), columns), [query.get("mark"), columns]);
  const marked = query.get("query");
  const whole = useRef<Box | null>(null);
  if (part === null) whole.current = boxOf(columns);

  // A submap that somebody searched for is shown, wherever the view was.
  const target = query.get("x") === null && chosen >= 0 ? chosen : -1;
  useEffect(() => {
    if (size && target >= 0) setMoved(withRoom(fit(boxOf(columns, target)!, size)));
  }, [target, size?.width, columns]);

  useEffect(() => {
    layer.current = Layer.on(under.current!);
    setBroken(layer.current === null);
    return () => layer.current?.dispose();
  }, []);
  useEffect(() => {
    layer.current?.setPoints({ xy: columns.xy, colour: treeColours(columns, hidden) });
    layer.current?.setLines({ xy: linesOf(shapes), colour: outlineColours(columns, shapes, hidden) });
  }, [columns, shapes]);
  useEffect(() => {
    layer.current?.recolour(treeColours(columns, hidden), outlineColours(columns, shapes, hidden));
  }, [until]);

  const fitted = useMemo(() => size && whole.current && fit(whole.current, size, 24), [size, columns]);
  const view = moved ?? fitted;
  const colours = useMemo(() => paletteOf(palette), [palette]);
  const ink = useMemo(() => inkOf(columns), [columns]);
  const side = useMemo(() => sideOf(columns), [columns]);
  const draw = useCallback(
    (canvas: HTMLCanvasElement, pixels: Size, ratio: number) => {
      if (view === null) return;
      const below = under.current!;
      if (below.width !== canvas.width || below.height !== canvas.height) {
        below.width = canvas.width;
        below.height = canvas.height;
      }
      // Outlines of a few pixels tell nothing, and cost more than all trees.
      layer.current?.draw(view, pixels, ratio, colours, side * view.scale < LEAST_SIDE ? 0 : ink);
      const context = canvas.getContext("2d")!;
      context.setTransform(ratio, 0, 0, ratio, 0, 0);
      context.clearRect(0, 0, pixels.width, pixels.height);
      const painter = new CanvasPainter(context);
      const toPixels = (shape: readonly number[]) =>
        shape.map((value, at) => (at % 2 ? toPixelY(view, pixels, value) : toPixelX(view, pixels, value)));
      if (chosen >= 0) {
        painter.line(toPixels(shapes[chosen]!), { fill: palette.select, opacity: 0.14 }, true);
        painter.line(toPixels(shapes[chosen]!), { stroke: palette.select, width: 2.5 }, true);
      }
      drawLines(context, lines, view, pixels, palette);
      if (over.moves) drawMoves(context, over.moves, view, pixels, palette);
      drawLabels(painter, columns, hidden, view, pixels, palette.ink);
      if (mark) drawMark(painter, toPixels(mark), palette);
      drawScale(painter, view, pixels, palette);
    },
    [view?.x, view?.y, view?.scale, columns, shapes, chosen, colours, lines, over.moves, mark],
  );

  useSettled(moved, (settled) => {
    setQuery(addressOf(settled, columns));
    if (size) onPart(nextPart(settled, size, columns, part, whole.current));
  });

  const place = (point: { x: number; y: number }) =>
    view && size ? submapAt(columns, shapes, hidden, toMetresX(view, size, point.x), toMetresY(view, size, point.y)) : null;
  const pick = (point: { x: number; y: number }) => {
    const submap = place(point);
    const here = view && addressOf(view, columns);
    setQuery({ ...here, submap: submap === null ? null : columns.submaps[submap]! });
  };
  const closer = (factor: number) => view && size && setMoved(zoom(view, size, factor, size.width / 2, size.height / 2));
  const all = () => {
    onPart(null);
    setMoved(fitted);
  };

  return (
    <section class="stage" aria-label="Map">
      <Canvas
        label={`${plural(columns.submaps.length, "submap")} with ${plural(columns.landmarks, "tree")} in ${columns.frame}.`}
        view={view}
        onView={setMoved}
        onSize={setSize}
        onFit={all}
        onPick={pick}
        draw={draw}
      >
        <canvas class="under" ref={under} aria-hidden="true" />
        {broken && (
          <Message kind="error" title="This browser cannot draw the map">
            <p>It has no WebGL2. Turn on hardware acceleration, or use another browser.</p>
          </Message>
        )}
        <div class="zoom" role="group" aria-label="Zoom">
          <button type="button" aria-label="Zoom in" onClick={() => closer(1.5)}>+</button>
          <button type="button" aria-label="Zoom out" onClick={() => closer(1 / 1.5)}>−</button>
          <button type="button" aria-label="Show everything" title="Show everything" onClick={all}>⤢</button>
        </div>
      </Canvas>
      <TimeSlider moments={moments} until={until} onUntil={setUntil} />
      <ul class="legend" aria-label="Legend">
        {columns.sessions.slice(0, 12).map((session, index) => (
          <li key={session} class={`session c${colourOf(index)}`}>
            {session}
          </li>
        ))}
        {columns.sessions.length > 12 && <li>and {columns.sessions.length - 12} more</li>}
        {columns.sessionOf.includes(-1) && <li class="session c0">without a session</li>}
        {mark && (
          <li class="mark">
            point (0, 0) of {marked ? <Link to={at("collections", collection, "queries", marked)}>query {marked}</Link> : "a query"}
          </li>
        )}
        <OverLegend {...over} />
      </ul>
    </section>
  );
}

const addressOf = (view: View, { origin }: Columns) => ({
  x: (view.x + origin[0]).toFixed(1),
  y: (view.y + origin[1]).toFixed(1),
  scale: view.scale.toPrecision(4),
});

/** The view in the address, which has coordinates of the map frame. */
function viewOf(query: URLSearchParams, columns: Columns): View | null {
  const [x, y, scale] = ["x", "y", "scale"].map((name) => Number(query.get(name) ?? NaN));
  if (!columns || ![x, y, scale].every((value) => Number.isFinite(value)) || scale! <= 0) return null;
  return { x: x! - columns.origin[0], y: y! - columns.origin[1], scale: scale! };
}

/** The marked point of the address, such as "12.5,-3", which has coordinates of the map frame. */
function markOf(text: string | null, { origin }: Columns): readonly [number, number] | null {
  const [x, y] = (text ?? "").split(",").map((part) => (part.trim() === "" ? NaN : Number(part)));
  return Number.isFinite(x) && Number.isFinite(y) ? [x! - origin[0], y! - origin[1]] : null;
}

/** A ring around a dot, larger than any tree. */
function drawMark(painter: CanvasPainter, [x, y]: readonly number[], palette: { readonly paper: string; readonly query: string }): void {
  painter.circle(x!, y!, 11, { stroke: palette.paper, width: 6 });
  painter.circle(x!, y!, 11, { stroke: palette.query, width: 3 });
  painter.circle(x!, y!, 4, { fill: palette.query });
}

const withRoom = (view: View): View => ({ ...view, scale: view.scale * 0.45 });

/** Calls `then` once the view has not changed for a moment. */
function useSettled(view: View | null, then: (view: View) => void): void {
  const latest = useRef(then);
  latest.current = then;
  useEffect(() => {
    if (view === null) return undefined;
    const timer = setTimeout(() => latest.current(view), SETTLED);
    return () => clearTimeout(timer);
  }, [view?.x, view?.y, view?.scale]);
}

/** Which part of the frame to load for a view: all of it, unless that is too much to be sent whole. */
function nextPart(view: View, size: Size, columns: Columns, part: string | null, whole: Box | null): string | null {
  if (part === null && columns.every === 1) return null;
  const [width, height] = [size.width / view.scale, size.height / view.scale];
  if (whole && width > WIDER * (whole.east - whole.west) && height > WIDER * (whole.north - whole.south)) return null;
  const [x, y] = [view.x + columns.origin[0], view.y + columns.origin[1]];
  // On a grid of half a view, so that small moves ask for what is there already.
  const [stepX, stepY] = [2 ** Math.ceil(Math.log2(width)), 2 ** Math.ceil(Math.log2(height))].map((step) => step / 2);
  const [left, bottom] = [Math.floor((x - width / 2) / stepX!) * stepX!, Math.floor((y - height / 2) / stepY!) * stepY!];
  const [right, top] = [Math.ceil((x + width / 2) / stepX!) * stepX!, Math.ceil((y + height / 2) / stepY!) * stepY!];
  return [left, bottom, right, top].join(",");
}

function drawLabels(painter: CanvasPainter, columns: Columns, hidden: Hidden, view: View, size: Size, ink: string): void {
  const shown: number[] = [];
  for (let submap = 0; submap < columns.submaps.length && shown.length <= LABELS; submap++) {
    const [west, south, east, north] = columns.boxes.subarray(4 * submap, 4 * submap + 4);
    const [x, y] = [toPixelX(view, size, (west! + east!) / 2), toPixelY(view, size, (south! + north!) / 2)];
    if (!hidden(submap) && x > 0 && y > 0 && x < size.width && y < size.height) shown.push(submap);
  }
  if (shown.length > LABELS) return;
  const placed: [number, number, number][] = [];
  for (const submap of shown) {
    const [west, south, east, north] = columns.boxes.subarray(4 * submap, 4 * submap + 4);
    const [x, y] = [toPixelX(view, size, (west! + east!) / 2), toPixelY(view, size, (south! + north!) / 2)];
    const half = 4 * columns.submaps[submap]!.length + 6;
    if (placed.some(([left, top, other]) => Math.abs(left - x) < half + other && Math.abs(top - y) < 18)) continue;
    placed.push([x, y, half]);
    painter.text(x, y + 4, columns.submaps[submap]!, { size: 12, fill: ink, anchor: "middle", bold: true });
  }
}

/** The colours of sessions, as numbers. */
function paletteOf(palette: { readonly map: string }): Float32Array {
  const style = getComputedStyle(document.documentElement);
  const names = Array.from({ length: 8 }, (_, at) => style.getPropertyValue(`--session-${at + 1}`).trim());
  return Float32Array.from([palette.map, ...names].flatMap(numbersOf));
}

function numbersOf(colour: string): number[] {
  const value = Number.parseInt(colour.slice(1), 16);
  return [(value >> 16) & 255, (value >> 8) & 255, value & 255].map((channel) => channel / 255);
}
