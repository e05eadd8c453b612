/** Line charts of the last minutes, as SVG. They grow while the page is open, and hold nothing of earlier. */

import { useRef } from "preact/hooks";

export interface Line {
  readonly name: string;
  /** Which colour and dash: one of the classes of the style sheet. */
  readonly kind: "first" | "second" | "third";
  /** The oldest first; null where nothing is known. */
  readonly values: readonly (number | null)[];
}

export interface Seen<T> {
  /** Milliseconds since 1970. */
  readonly at: number;
  readonly value: T;
}

const MOST = 60;
const WIDTH = 300;
const HEIGHT = 72;

/** The last values that a part was given, the oldest first. */
export function useHistory<T>(value: T): readonly Seen<T>[] {
  const kept = useRef<readonly Seen<T>[]>([]);
  if (kept.current.at(-1)?.value !== value) kept.current = [...kept.current, { at: Date.now(), value }].slice(-MOST);
  return kept.current;
}

interface ChartProps {
  readonly title: string;
  readonly lines: readonly Line[];
  /** How a value is written. */
  readonly written: (value: number) => string;
}

export function Chart({ title, lines, written }: ChartProps) {
  const most = Math.max(...lines.flatMap(({ values }) => values.map((value) => value ?? 0)), 0);
  const now = (line: Line) => {
    const value = line.values.findLast((one) => one !== null);
    return value == null ? "–" : written(value);
  };
  const told = lines.map((line) => `${line.name} ${now(line)}`).join(", ");
  return (
    <figure class="chart">
      <figcaption>{title}</figcaption>
      <svg viewBox={`0 0 ${WIDTH} ${HEIGHT}`} preserveAspectRatio="none" role="img" aria-label={`${title}, now: ${told}`}>
        <path class="axis" d={`M0 ${HEIGHT - 1}H${WIDTH}`} />
        {lines.map((line) => (
          <path key={line.name} class={line.kind} d={pathOf(line.values, most)} />
        ))}
      </svg>
      <ul class="chart-lines">
        {lines.map((line) => (
          <li key={line.name} class={line.kind}>
            {line.name} <b>{now(line)}</b>
          </li>
        ))}
        <li class="most">highest {written(most)}</li>
      </ul>
    </figure>
  );
}

/** From right to left: the newest value is always at the right edge. */
function pathOf(values: readonly (number | null)[], most: number): string {
  const step = WIDTH / (MOST - 1);
  let path = "";
  let joined = false;
  values.forEach((value, index) => {
    if (value === null) {
      joined = false;
      return;
    }
    const x = WIDTH - (values.length - 1 - index) * step;
    const y = HEIGHT - 2 - (most > 0 ? value / most : 0) * (HEIGHT - 6);
    // A value between two gaps is a short line.
    path += joined ? `L${x.toFixed(1)} ${y.toFixed(1)}` : `M${(x - 1).toFixed(1)} ${y.toFixed(1)}h1`;
    joined = true;
  });
  return path;
}
