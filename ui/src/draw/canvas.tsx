/** A canvas that can be dragged, pinched, scrolled and steered by keys. */

import type { ComponentChildren } from "preact";
import { useEffect, useLayoutEffect, useRef, useState } from "preact/hooks";

import { pan, type Size, type View, zoom } from "./view";

export interface CanvasProps {
  readonly label: string;
  readonly view: View | null;
  readonly onView: (view: View) => void;
  readonly onSize: (size: Size) => void;
  readonly onFit: () => void;
  /** Called with every pointer over the canvas, in pixels; null when it leaves. */
  readonly onPoint?: (point: { x: number; y: number } | null) => void;
  readonly onPick?: (point: { x: number; y: number }) => void;
  /** Draws. Called again whenever it is another function, or the size of the canvas changes. */
  readonly draw: (canvas: HTMLCanvasElement, size: Size, ratio: number) => void;
  readonly children?: ComponentChildren;
}

const STEP = 60;
const FACTOR = 1.3;
const CLICK = 4;

export function Canvas(props: CanvasProps) {
  const holder = useRef<HTMLDivElement>(null);
  const canvas = useRef<HTMLCanvasElement>(null);
  const [size, setSize] = useState<Size | null>(null);
  const latest = useRef(props);
  latest.current = props;

  useLayoutEffect(() => {
    const element = holder.current!;
    const measure = () => {
      const next = { width: element.clientWidth, height: element.clientHeight };
      if (next.width === 0 || next.height === 0) return;
      setSize(next);
      latest.current.onSize(next);
    };
    const observer = new ResizeObserver(measure);
    observer.observe(element);
    measure();
    return () => observer.disconnect();
  }, []);

  const { draw, view } = props;
  useEffect(() => {
    if (size === null || canvas.current === null) return;
    const element = canvas.current;
    const frame = requestAnimationFrame(() => {
      const ratio = devicePixelRatio || 1;
      const [width, height] = [Math.round(size.width * ratio), Math.round(size.height * ratio)];
      if (element.width !== width) element.width = width;
      if (element.height !== height) element.height = height;
      draw(element, size, ratio);
    });
    return () => cancelAnimationFrame(frame);
  }, [draw, size]);

  useEffect(() => (size === null ? undefined : pointers(canvas.current!, latest)), [size !== null]);

  const keys = (event: KeyboardEvent) => {
    if (view === null || size === null || event.metaKey || event.ctrlKey || event.altKey) return;
    const [x, y] = [size.width / 2, size.height / 2];
    const moves: Record<string, () => View> = {
      ArrowLeft: () => pan(view, STEP, 0),
      ArrowRight: () => pan(view, -STEP, 0),
      ArrowUp: () => pan(view, 0, STEP),
      ArrowDown: () => pan(view, 0, -STEP),
      "+": () => zoom(view, size, FACTOR, x, y),
      "=": () => zoom(view, size, FACTOR, x, y),
      "-": () => zoom(view, size, 1 / FACTOR, x, y),
    };
    const move = moves[event.key];
    if (move) props.onView(move());
    else if (event.key === "0" || event.key === "Home") props.onFit();
    else return;
    event.preventDefault();
  };

  return (
    <div class="canvas" ref={holder}>
      <canvas
        ref={canvas}
        role="img"
        tabIndex={0}
        aria-label={`${props.label} Move with the arrow keys, zoom with + and -, show everything with 0.`}
        onKeyDown={keys}
      />
      {props.children}
    </div>
  );
}

/** Listens to pointers and the wheel. Returns how to stop. */
function pointers(element: HTMLCanvasElement, latest: { current: CanvasProps }): () => void {
  const down = new Map<number, { x: number; y: number }>();
  let moved = 0;
  const place = (event: MouseEvent) => {
    const box = element.getBoundingClientRect();
    return { x: event.clientX - box.left, y: event.clientY - box.top };
  };
  const size = () => ({ width: element.clientWidth, height: element.clientHeight });
  const wheel = (event: WheelEvent) => {
    const { view, onView } = latest.current;
    if (view === null) return;
    event.preventDefault();
    const { x, y } = place(event);
    const pixels = event.deltaMode === WheelEvent.DOM_DELTA_LINE ? event.deltaY * 20 : event.deltaY;
    onView(zoom(view, size(), Math.exp(-pixels * 0.0015), x, y));
  };
  const begin = (event: PointerEvent) => {
    element.setPointerCapture(event.pointerId);
    if (down.size === 0) moved = 0;
    down.set(event.pointerId, place(event));
  };
  const move = (event: PointerEvent) => {
    const { view, onView, onPoint } = latest.current;
    const [now, before] = [place(event), down.get(event.pointerId)];
    if (before === undefined || view === null) {
      onPoint?.(now);
      return;
    }
    moved += Math.abs(now.x - before.x) + Math.abs(now.y - before.y);
    const other = [...down].find(([id]) => id !== event.pointerId)?.[1];
    down.set(event.pointerId, now);
    let next = pan(view, (now.x - before.x) / (other ? 2 : 1), (now.y - before.y) / (other ? 2 : 1));
    if (other) {
      const apart = (one: { x: number; y: number }) => Math.hypot(one.x - other.x, one.y - other.y);
      next = zoom(next, size(), apart(now) / Math.max(apart(before), 1), (now.x + other.x) / 2, (now.y + other.y) / 2);
    }
    if (moved > CLICK) onView(next);
  };
  const end = (event: PointerEvent) => {
    if (down.delete(event.pointerId) && down.size === 0 && moved <= CLICK && event.type === "pointerup") {
      latest.current.onPick?.(place(event));
    }
  };
  const leave = () => latest.current.onPoint?.(null);
  const listeners: [string, (event: never) => void][] = [
    ["pointerdown", begin],
    ["pointermove", move],
    ["pointerup", end],
    ["pointercancel", end],
    ["pointerleave", leave],
  ];
  for (const [name, listener] of listeners) element.addEventListener(name, listener as EventListener);
  element.addEventListener("wheel", wheel, { passive: false });
  return () => {
    for (const [name, listener] of listeners) element.removeEventListener(name, listener as EventListener);
    element.removeEventListener("wheel", wheel);
  };
}
