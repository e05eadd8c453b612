/** The drawing of a match, with what one can do to it: move, blink, swipe, pick trees, export. */

import { useCallback, useEffect, useMemo, useState } from "preact/hooks";
import type { Schemas } from "urquhart-client";

import { Canvas } from "../draw/canvas";
import { CanvasPainter } from "../draw/painter";
import { usePalette } from "../draw/palette";
import { boxAround, fit, type Size, toMetresX, toMetresY, toPixelX, toPixelY, type View, zoom } from "../draw/view";
import { Choices } from "../parts/common";
import { setQuery, useAddress } from "../parts/router";
import { metres } from "../parts/text";
import { drawOverlay, type Shown } from "./draw-overlay";
import { pngOf, save, svgOf } from "./export";
import { missing, nearest, type Overlay, pairOf, type Tree } from "./overlay";
import { useSelected } from "./selection";
import { summary, VERDICTS } from "./why";

const MODES = [
  ["overlay", "Overlay"],
  ["blink", "Blink"],
  ["swipe", "Swipe"],
] as const;
type Mode = (typeof MODES)[number][0];

const BLINK = 800;
const STRETCH = 5;
const REACH = 14;

interface StageProps {
  readonly overlay: Overlay;
  readonly answer: Schemas["QueryAnswer"];
  readonly explanation: Schemas["ExplanationAnswer"];
}

export function Stage({ overlay, answer, explanation }: StageProps) {
  const palette = usePalette();
  const address = useAddress().query;
  const mode = (MODES.find(([name]) => name === address.get("mode"))?.[0] ?? "overlay") as Mode;
  const stretched = address.get("residuals") !== "0";
  const [size, setSize] = useState<Size | null>(null);
  const [moved, setMoved] = useState<View | null>(null);
  const [swipe, setSwipe] = useState(0.5);
  const [selected, select] = useSelected();
  const [hovered, setHovered] = useState<Tree | null>(null);
  const phase = useBlink(mode === "blink");

  useEffect(() => setMoved(null), [overlay.submapId]);
  const view = moved ?? (size && fit(overlay.box, size));
  const shown = useMemo<Shown>(
    () => ({
      query: mode !== "blink" || phase === 0,
      submap: mode !== "blink" || phase === 1,
      pairs: mode === "overlay",
      stretch: stretched ? STRETCH : 0,
      swipe: mode === "swipe" && size ? swipe * size.width : null,
      selected,
    }),
    [mode, phase, stretched, swipe, size, selected],
  );
  const draw = useCallback(
    (canvas: HTMLCanvasElement, pixels: Size, ratio: number) => {
      const context = canvas.getContext("2d");
      if (context === null || view === null) return;
      context.setTransform(ratio, 0, 0, ratio, 0, 0);
      drawOverlay(new CanvasPainter(context), overlay, view, pixels, palette, shown);
    },
    [overlay, view?.x, view?.y, view?.scale, palette, shown],
  );
  const treeAt = (point: { x: number; y: number }) =>
    view && size && nearest(overlay, toMetresX(view, size, point.x), toMetresY(view, size, point.y), REACH / view.scale);
  const showAll = () => size && setMoved(fit(boxAround(overlay.query, overlay.submap) ?? overlay.box, size));
  const closer = (factor: number) => view && size && setMoved(zoom(view, size, factor, size.width / 2, size.height / 2));
  const sheet = () => ({
    overlay,
    view: view!,
    size: size!,
    palette,
    shown: { ...shown, query: true, submap: true, pairs: mode !== "swipe" },
    lines: [
      `Query ${answer.id} in ${answer.collection}: ${VERDICTS[answer.verdict]}`,
      `${overlay.name}. ${summary(answer, explanation)}`,
      "Filled: query, ring: stored map, joined: pairs, cross or dashed ring: no partner.",
    ],
  });
  const name = `${answer.collection}-query-${answer.id}`;
  const saveSvg = () => save(new Blob([svgOf(sheet())], { type: "image/svg+xml" }), `${name}.svg`);
  const savePng = async () => save(await pngOf(sheet()), `${name}.png`);

  return (
    <section class="stage" aria-label="The two forests">
      <div class="stage-tools">
        <Choices label="How the forests are compared" value={mode} options={MODES} onChange={(value) => setQuery({ mode: value === "overlay" ? null : value })} />
        {overlay.pairs && mode === "overlay" && (
          <label class="switch">
            <input type="checkbox" checked={stretched} onChange={() => setQuery({ residuals: stretched ? "0" : null })} />
            Distances ×{STRETCH}
          </label>
        )}
        <span class="space" />
        <button type="button" class="quiet" onClick={savePng} disabled={view === null}>
          Save PNG
        </button>
        <button type="button" class="quiet" onClick={saveSvg} disabled={view === null}>
          Save SVG
        </button>
      </div>
      <Canvas
        label={label(overlay)}
        view={view}
        onView={setMoved}
        onSize={setSize}
        onFit={() => setMoved(null)}
        onPoint={(point) => setHovered(point && treeAt(point))}
        onPick={(point) => select(treeAt(point))}
        draw={draw}
      >
        <div class="zoom" role="group" aria-label="Zoom">
          <button type="button" aria-label="Zoom in" onClick={() => closer(1.5)}>+</button>
          <button type="button" aria-label="Zoom out" onClick={() => closer(1 / 1.5)}>−</button>
          <button type="button" aria-label="Show the query" title="Show the query" onClick={() => setMoved(null)}>◎</button>
          <button type="button" aria-label="Show everything" title="Show everything" onClick={showAll}>⤢</button>
        </div>
        {mode === "swipe" && size && <Swipe at={swipe} onMove={setSwipe} width={size.width} />}
        {mode === "blink" && <p class="phase">{phase === 0 ? "Query" : "Stored map"}</p>}
        {view && size && (hovered ?? selected) && (
          <Tip overlay={overlay} tree={(hovered ?? selected)!} view={view} size={size} />
        )}
      </Canvas>
      <Legend overlay={overlay} />
    </section>
  );
}

/** 0 or 1, in turn. Those who asked for less motion change it with the space bar or a click on the mode. */
function useBlink(on: boolean): number {
  const [phase, setPhase] = useState(0);
  useEffect(() => {
    if (!on) return undefined;
    const turn = () => setPhase((before) => 1 - before);
    const still = matchMedia("(prefers-reduced-motion: reduce)").matches;
    const timer = still ? undefined : setInterval(turn, BLINK);
    const key = (event: KeyboardEvent) => {
      if (event.key !== " " || (event.target as HTMLElement).tagName === "BUTTON") return;
      event.preventDefault();
      turn();
    };
    addEventListener("keydown", key);
    return () => {
      clearInterval(timer);
      removeEventListener("keydown", key);
    };
  }, [on]);
  return phase;
}

function label(overlay: Overlay): string {
  const trees = `${overlay.query.length / 2} trees of the query over ${overlay.submap.length / 2} of ${overlay.submapId}`;
  return overlay.pairs ? `${trees}, ${overlay.pairs.length} pairs joined.` : `${trees}.`;
}

function Swipe({ at, onMove, width }: { readonly at: number; readonly onMove: (at: number) => void; readonly width: number }) {
  return (
    <>
      <p class="side left">Query</p>
      <p class="side right">Stored map</p>
      <input
        class="swipe"
        type="range"
        min="0"
        max="1000"
        step="5"
        value={Math.round(at * 1000)}
        aria-label="Border between query and stored map"
        onInput={(event) => onMove(Number(event.currentTarget.value) / 1000)}
        data-width={width}
      />
    </>
  );
}

function Tip(props: { readonly overlay: Overlay; readonly tree: Tree; readonly view: View; readonly size: Size }) {
  const { overlay, tree, view, size } = props;
  const points = overlay[tree.side];
  const [x, y] = [points[2 * tree.at]!, points[2 * tree.at + 1]!];
  const pair = pairOf(overlay, tree);
  const [left, top] = [toPixelX(view, size, x), toPixelY(view, size, y)];
  const inside = (tree.side === "query" ? overlay.queryInside : overlay.submapInside)[tree.at];
  return (
    <div class={`tip ${left > size.width - 220 ? "before" : ""}`} style={{ left: `${left}px`, top: `${top}px` }}>
      <b>
        {tree.side === "query" ? "Query" : overlay.submapId}: tree {(tree.side === "query" ? overlay.queryIds : overlay.submapIds)[tree.at]}
      </b>
      <span>
        {x.toFixed(2)}, {y.toFixed(2)} m in {overlay.submapId}
      </span>
      {pair && (
        <span>
          {metres(pair.residual)} from {tree.side === "query" ? `tree ${overlay.submapIds[pair.submap]}` : `query tree ${overlay.queryIds[pair.query]}`}
        </span>
      )}
      {overlay.pairs && !pair && <span>{inside ? "No partner, although the other side covers this place" : "The other side does not cover this place"}</span>}
    </div>
  );
}

function Legend({ overlay }: { readonly overlay: Overlay }) {
  const { pairs } = overlay;
  const unseen = overlay.queryInside.filter((inside, at) => !inside && !overlay.queryPaired[at]).length;
  return (
    <ul class="legend" aria-label="Legend">
      <li class="query">{overlay.query.length / 2} trees seen</li>
      <li class="map">{overlay.submap.length / 2} trees of {overlay.submapId}</li>
      {pairs && <li class="pair">{pairs.length} of them are the same</li>}
      {pairs && <li class="query-miss">{missing(overlay.queryPaired, overlay.queryInside)} seen, not in the map</li>}
      {pairs && unseen > 0 && <li class="query-beyond">{unseen} seen beyond its edge</li>}
      {pairs && <li class="map-miss">{missing(overlay.submapPaired, overlay.submapInside)} in the map, not seen</li>}
      {!pairs && <li>The answer lists no pairs of a rival.</li>}
    </ul>
  );
}
